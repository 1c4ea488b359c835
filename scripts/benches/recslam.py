"""RecSLAM's figures with runs of our own: when the map of all is there, where the time goes, against the cloud alone and other groupings

Needs the program (scripts/build). Simulates the apartments of the paper's section VI (0.20 m/s) and, where MAPWEAVE_DATA has them, cuts public
logs into teams; runs each team with its edges grouped by each method, and in the cloud alone. Before that it learns each place's latency model from
other drives there (other seeds; of a public log, which has no other drive, other cuts). Robots are Raspberry Pi 3B+, wires are WiFi. Runs that this program made are not made again. Writes the tables between <!-- bench:recslam -->
and <!-- /bench --> of datasets/RESULTS.md, out/bench/recslam.json, and plots (PNG) and report.html beside it. Maps of a robot, of each edge and of all (fig. 12 to 14) go to
out/bench/recslam-maps. A scene whose robots do not end in one map in every run has no times, and the exit code is 5; also where edges save less
than 55 % of what the cloud alone takes in 13 x 18 m, where ten robots save less than six, and where their map is there after more than 2 s. Takes about an hour.
"""
import hashlib
import json
import math
import shutil
import statistics

from benches import common, plots, report

APARTMENT = {"width_m": 18, "height_m": 13}
SMALL = {"corridor_width_m": 1.2, "room_width_m": 2.0}
SCENES = {   # name: apartment or public log, robots, edges, metres each robot drives
    **{f"13 x 18 m, {robots} robots": {"apartment": APARTMENT, "robots": robots, "edges": 3, "length_m": 30} for robots in (6, 8, 10)},
    "4 x 4 m, 4 robots": {"apartment": {"width_m": 4, "height_m": 4, **SMALL}, "robots": 4, "edges": 2, "length_m": 12},
    "5 x 5 m, 4 robots": {"apartment": {"width_m": 5, "height_m": 5, **SMALL}, "robots": 4, "edges": 2, "length_m": 12},
    "6 x 5.5 m, 3 robots": {"apartment": {"width_m": 6, "height_m": 5.5, **SMALL}, "robots": 3, "edges": 1, "length_m": 12},
    "fr079, 6 robots": {"log": "laser/fr079/fr079.rawlog", "overlap_s": 40, "robots": 6, "edges": 3},
    "intel, 6 robots": {"log": "laser/intel/intel.rawlog", "overlap_s": 40, "robots": 6, "edges": 3},
}
SERIES = [name for name in SCENES if name.startswith("13 x 18")]
PLACES = [SERIES, *([name] for name in SCENES if name not in SERIES)]   # scenes that share a model
METHODS = ("default", "recslam", "greedy", "random")
WIRES = [f"network.{wire}.profile=wifi" for wire in ("robot_edge", "robot_cloud", "edge_cloud")] + ["processors.robot_profile=raspberry-pi-3b-plus"]
WIFI_BYTES_PER_S = 12.75e6   # of the profile (libs/transport, profiles.h)
PAPERS_EDGES = ["processors.edge_profile=jetson-tx2"]   # RecSLAM's edges beside its cloud
LEARNING_SEEDS, SEED = (41, 43), 42
GOAL_GAIN, GOAL_TEN_S = 0.55, 2.0   # against the cloud alone, and the most robots gain no less than the fewest; until the map of ten is there
ROOMS = 8
BUILDING_SEED = 9


def add_arguments(parser):
    parser.add_argument("--scenes", default=";".join(SCENES), metavar="NAME;...", help="default: all of %(default)s")
    parser.add_argument("--seed", type=int, default=SEED, help="of the worlds that are predicted (default: %(default)s)")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md and README.md as they are")


def folder_of(name, seed):
    return common.OUT / "recslam" / f"{''.join(letter if letter.isalnum() else '-' for letter in name)}-{seed}"


def world_text(scene, seed, building_seed=BUILDING_SEED):
    lines = [f"seed: {seed}", "buildings:", f"  - {{kind: apartment, seed: {building_seed}, apartment: {json.dumps(scene['apartment'])}}}", f"edges: {scene['edges']}",
             "motion: {speed_min_m_per_s: 0.2, speed_max_m_per_s: 0.2, clearance_m: 0.2}", "robot_radius_m: 0.1", "robots:"]
    small = scene["apartment"]["width_m"] < 10
    for i in range(scene["robots"]):
        first = i % 2 if small else i * (ROOMS - 2) // scene["robots"]
        last = "" if small else f"last_room: {first + 2}, "
        lines.append(f"  - {{id: r{i}, first_room: {first}, {last}order: {('along', 'back', 'shuffled')[i % 3]}, length_m: {scene['length_m']}}}")
    return "\n".join(lines) + "\n"


def logs_of(name, seed):
    """The team's logs, made when they are first needed; its configuration, in which robots have routes where the truth is known."""
    scene, folder = SCENES[name], folder_of(name, seed)
    logs, config = folder / "logs", folder / "team.yaml"
    if config.exists():
        return config
    folder.mkdir(parents=True, exist_ok=True)
    if "log" in scene:
        source = common.need(common.DATA / scene["log"], "set MAPWEAVE_DATA to the folder that holds laser/")
        overlap_s = scene["overlap_s"] + 10 * (seed - SEED)   # another drive there is another cut
        common.mapweave("split", source, "--robots", scene["robots"], "--overlap", overlap_s, "--out", logs, "--force")
        robots = [f"  - {{id: r{i}, log: logs/robot{i}.rawlog}}" for i in range(scene["robots"])]
    else:
        (folder / "world.yaml").write_text(world_text(scene, seed))
        common.mapweave("simulate", folder / "world.yaml", "--out", logs, "--force")
        robots = [f"  - {{id: r{i}, log: logs/r{i}.rawlog, route: {route(logs / f'r{i}.truth.tum')}}}" for i in range(scene["robots"])]
    edges = ", ".join(f"{{id: edge{i}}}" for i in range(scene["edges"]))
    config.write_text("robots:\n" + "\n".join(robots) + f"\nedges: [{edges}]\ncoordinator: {{overlap_period_s: 20, route_range_m: 4}}\n")
    return config


def route(truth):
    points = [[float(value) for value in line.split()[1:3]] for line in truth.read_text().splitlines()]
    kept = points[:1]
    for point in points:
        if math.dist(point, kept[-1]) > 2.0:
            kept.append(point)
    return "[" + ", ".join(f"{{x_m: {x:.2f}, y_m: {y:.2f}}}" for x, y in kept) + "]"


def run_team(name, seed, kind, *settings):
    """Summary and folder of a run; made once by each program."""
    out = folder_of(name, seed) / kind
    stamp = folder_of(name, seed) / f"{kind}.program"
    program = hashlib.sha256(common.PROGRAM.read_bytes()).hexdigest()
    if not (out / "summary.json").exists() or not stamp.exists() or stamp.read_text() != program:
        flags = [flag for setting in (*WIRES, *settings) for flag in ("--set", setting)]
        common.mapweave("run", logs_of(name, seed), "--out", out, "--force", "--set", "output.png=false", "--set", "output.pcd=false", "--set", "output.report=false", *flags)
        stamp.write_text(program)
    return json.loads((out / "summary.json").read_text()), out


def timeline(out, *settings):
    flags = [flag for setting in settings for flag in ("--set", setting)]
    return json.loads(common.mapweave("timeline", out, *flags, "--json")[1])


def parts(line):
    """Of the critical edge: pack, robot to edge, SLAM, fusion, edge to cloud, global fusion."""
    last = max(line["edges"], key=lambda edge: edge["arrived_seconds"])
    robots = [robot for robot in line["robots"] if robot["edge"] == last["id"]]
    slowest = max(robots, key=lambda robot: max(robot["mapped_seconds"], robot["arrived_seconds"]))
    return [slowest["packed_seconds"], slowest["arrived_seconds"] - slowest["packed_seconds"], slowest["mapped_seconds"] - slowest["arrived_seconds"],
            last["fused_seconds"] - last["ready_seconds"], last["arrived_seconds"] - last["fused_seconds"], line["total_seconds"] - last["arrived_seconds"]]


def parts_alone(line):
    """SLAM on the slowest robot, to the cloud, fusion there."""
    last = max(line["robots"], key=lambda robot: robot["arrived_seconds"])
    return [last["mapped_seconds"], last["arrived_seconds"] - last["mapped_seconds"], line["total_seconds"] - last["arrived_seconds"]]


def merged_pairs(out):
    """Robots that the cloud has in one map, pair by pair."""
    return sorted([verdict["a"], verdict["b"]] for verdict in json.loads((out / "merges.json").read_text()) if verdict["tier"] == "cloud" and verdict["in_one_map"])


def keep_maps(name, out):
    """Pictures of the first robot's map, of each edge's and of the cloud's (fig. 12 to 14)."""
    kept = common.OUT / "recslam-maps"
    kept.mkdir(parents=True, exist_ok=True)
    title = "".join(letter if letter.isalnum() else "-" for letter in name)
    stores = [*sorted(out.glob("robots/*/map.mwdb"))[:1], *sorted(out.glob("edges/*/map.mwdb")), *sorted(out.glob("team*/map.mwdb"))]
    for store in stores:
        drawn = out.with_name("drawn")
        common.mapweave("export", store, "--png", "--out", drawn, "--force")
        for picture in drawn.rglob("map.color.png"):
            picture.replace(kept / f"{title}-{'-'.join(store.relative_to(out).parts[:-1])}.png")
        shutil.rmtree(drawn)


def is_one_map(row):
    return row["cloud_only_maps"] == 1 and all(one["teams"] == 1 for one in row["methods"].values())


def most_maps(row):
    return max(row["cloud_only_maps"], *(one["teams"] for one in row["methods"].values()))


def measure(name, seed, model):
    result = {"name": name, "robots": SCENES[name]["robots"], "methods": {}}
    for method in METHODS:
        summary, out = run_team(name, seed, method, f"coordinator.method={method}", f"coordinator.model={model}")
        coordinated = summary["coordinator"]
        result["methods"][method] = {"total_s": coordinated["came_seconds"], "expected_s": coordinated["expected_seconds"], "parts": parts(summary["timeline"]),
                                     "deciding_s": coordinated["cpu_seconds"], "cut": coordinated["decisions"][-1]["cut_weight"], "loads": [robot["load"] for robot in summary["timeline"]["robots"]],
                                     "teams": summary["team"]["components"]}
        if method == "default":
            result["wires"] = {profile: parts(timeline(out, *(f"network.{wire}.profile={profile}" for wire in ("robot_edge", "edge_cloud"))))
                               for profile in ("lan", "wifi", "5g", "4g")}
            result["merged_pairs"] = merged_pairs(out)
            keep_maps(name, out)
    summary, alone = run_team(name, seed, "cloud-only", "mode=cloud-only")
    result["cloud_only_maps"] = summary["team"]["components"]
    result["cloud_only_s"] = summary["timeline"]["total_seconds"]
    result["stages"] = {stage["name"]: stage["seconds"] for stage in summary["stages"] if stage["tier"] == "cloud"}
    result["scans"] = sum(robot["scans"] for robot in summary["robots"])
    result["cloud_only_loads"] = [robot["load"] for robot in summary["timeline"]["robots"]]
    if merged_pairs(alone) != result["merged_pairs"]:
        common.give_up(f"{name}: the cloud alone says otherwise than edges and cloud (RecSLAM VI-A)")
    result["alone_wires"] = {profile: parts_alone(timeline(alone, f"network.robot_cloud.profile={profile}")) for profile in ("lan", "wifi", "5g", "4g")}
    otherwise = {"robots": ["processors.robot"], "edges": ["processors.edge"], "cloud": ["processors.cloud"]}
    result["otherwise"] = {}
    ours = folder_of(name, seed) / "default"
    for what, keys in otherwise.items():
        for factor in (0.5, 2.0):
            settings = [f"{key}={factor}" for key in keys]
            result["otherwise"][f"{what} x {factor:g}"] = [timeline(ours, *settings)["total_seconds"], timeline(alone, *settings)["total_seconds"]]
    result["otherwise"]["the paper's edges (Jetson TX2)"] = [timeline(one, *PAPERS_EDGES)["total_seconds"] for one in (ours, alone)]
    for factor in (0.5, 2.0):
        settings = [f"network.{wire}.bytes_per_s={factor * WIFI_BYTES_PER_S}" for wire in ("robot_edge", "robot_cloud", "edge_cloud")]
        result["otherwise"][f"bandwidth x {factor:g}"] = [timeline(ours, *settings)["total_seconds"], timeline(alone, *settings)["total_seconds"]]
    return result


def learn(scenes):
    """A place's latency model from other drives there."""
    folders = [run_team(name, seed, method, f"coordinator.method={method}")[1]
               for name in scenes for seed, method in zip(LEARNING_SEEDS, ("default", "random"))]
    model = folder_of(scenes[0], "model").with_suffix(".json")
    _, printed = common.mapweave("profile", *folders, "--out", model, "--json")
    return model, json.loads(printed)


def figures(rows, models):
    series, drawn = [row for row in rows if row["name"] in SERIES and is_one_map(row)], []
    if len(series) > 1:
        drawn += [plots.figure("recslam-total", "map complete after (RecSLAM fig. 17, 19)", "robots", "s",
                               {**{method: [(row["robots"], row["methods"][method]["total_s"]) for row in series] for method in METHODS},
                                "cloud alone": [(row["robots"], row["cloud_only_s"]) for row in series]}),
                  plots.figure("recslam-load", "mean load of a robot (fig. 5, 18)", "robots", "% of its core",
                               {"offload": [(row["robots"], 100 * statistics.mean(row["methods"]["default"]["loads"])) for row in series],
                                "cloud alone": [(row["robots"], 100 * statistics.mean(row["cloud_only_loads"])) for row in series]}),
                  plots.figure("recslam-functions", "fusion in the cloud alone, by function, wall (fig. 7a)", "scans", "s",
                               {stage.split()[-1]: [(row["scans"], row["stages"][stage]) for row in series] for stage in series[0]["stages"]})]
    for term in next(iter(models.values()))["terms"]:
        if term["term"].startswith("fusion"):
            drawn.append(plots.figure(f"recslam-{term['term'].replace(' ', '-')}", f"{term['term']} (fig. 7, 11)", term["by"], "s",
                                      {what: [(point["at"], point[what]) for point in term["points"]] for what in ("measured", "fitted")}))
    return drawn


def percent(value):
    return f"{100 * value:+.1f} %"


def cells(row):
    """No times of a map of all that was not made."""
    load = f"{100 * statistics.mean(row['methods']['default']['loads']):.2f} / {100 * statistics.mean(row['cloud_only_loads']):.1f} %"
    if not is_one_map(row):
        return (row["name"], f"up to {most_maps(row)}", *("-" for _ in range(6)), load)
    default = row["methods"]["default"]
    return (row["name"], 1, f"{default['total_s']:.2f}", percent(default["total_s"] / row["cloud_only_s"] - 1),
            *(percent(default["total_s"] / row["methods"][other]["total_s"] - 1) for other in ("random", "greedy", "recslam")), f"{default['expected_s']:.2f}", load)


def results_text(all_rows, models):
    text = common.table(("team", "maps", "map complete after, s", "against cloud alone", "against random", "against greedy", "against recslam", "expected, s",
                         "robot's load, offload / alone"), [cells(row) for row in all_rows])
    rows = [row for row in all_rows if is_one_map(row)]
    if not rows:
        return text + "\n\nNo team ended in one map in every run, so that there are no times to show."
    merged = sum(len(row["merged_pairs"]) for row in rows)
    for what, some in (("with a model of other drives in the same place", [row for row in rows if "log" not in SCENES[row["name"]]]),
                       ("on public logs, with a model of other cuts of the same drive", [row for row in rows if "log" in SCENES[row["name"]]])):
        off = [abs(one["expected_s"] / one["total_s"] - 1) for row in some for one in row["methods"].values()]
        if off:
            text += f"\n\nExpected by the coordinator against what came, {len(off)} runs, each {what}: off by {100 * statistics.median(off):.1f} % (median), {100 * max(off):.0f} % at most."
    text += ("\n\nRandom and greedy groups are one draw each. "
             f"Edges and cloud and the cloud alone have the same pairs of robots in one map in every run (VI-A): {merged} pairs. "
             f"Overlaps and plans took the coordinator {1e3 * max(row['methods']['default']['deciding_s'] for row in rows):.0f} ms of processor time in a run at most.\n\n")
    shown = next((row for row in rows if row["robots"] == 3), rows[0])
    text += f"Where the time goes if robots map and the cloud merges ({shown['name']}; fig. 4, the paper: 3.83 s by WiFi to 5.36 s, of it 1.51 s on the robot), s:\n\n"
    text += common.table(("wires", "SLAM on the robot", "robot to cloud", "fusion in the cloud", "all"),
                         [(wire, *(f"{part:.3f}" for part in some), f"{sum(some):.2f}") for wire, some in shown["alone_wires"].items()])
    text += "\n\nThe same by edges:\n\n"
    text += common.table(("wires", "pack", "robot to edge", "SLAM", "fusion on the edge", "edge to cloud", "fusion in the cloud", "all"),
                         [(wire, *(f"{part:.3f}" for part in some), f"{sum(some):.2f}") for wire, some in shown["wires"].items()])
    series = [row for row in rows if row["name"] in SERIES]
    if series:
        text += "\n\nAgainst the cloud alone, had everything been half or twice as fast:\n\n"
        text += common.table(("what", *(row["name"] for row in series)),
                             [("as it is", *(percent(row["methods"]["default"]["total_s"] / row["cloud_only_s"] - 1) for row in series))] +
                             [(what, *(percent(row["otherwise"][what][0] / row["otherwise"][what][1] - 1) for row in series)) for what in series[0]["otherwise"]])
    place, profile = next(iter(models.items()))
    terms = "; ".join(f"{term['term']}: {term['samples']} samples, explains {100 * term['r_squared']:.0f} %, off by {100 * term['median_off']:.0f} % (median)"
                      for term in profile["terms"])
    text += (f"\n\nMeasured by `scripts/bench recslam` on {common.machine()}: processor time of this machine, robots taken for Raspberry Pi 3B+ (0.12 of it), edges for as fast as the cloud where nothing else is said, WiFi (12.75 MB/s, 2 ms) on all wires. What was "
             f"learnt, by scans, for {place}: {terms}.")
    return text


def missed_goals(rows):
    series = [row for row in rows if row["name"] in SERIES and is_one_map(row)]
    gains = [1 - row["methods"]["default"]["total_s"] / row["cloud_only_s"] for row in series]
    missed = [f"{row['name']}: {percent(-gain)}, goal {percent(-GOAL_GAIN)}" for row, gain in zip(series, gains) if gain < GOAL_GAIN]
    if len(series) == len(SERIES) and gains[-1] < gains[0]:
        missed.append(f"{series[-1]['name']}: {percent(-gains[-1])}, fewer robots {percent(-gains[0])}")
    late = [row["methods"]["default"]["total_s"] for row in series if row["robots"] == 10]
    return missed + [f"map of ten robots after {total_s:.2f} s, goal {GOAL_TEN_S} s" for total_s in late if total_s > GOAL_TEN_S]


def run(arguments):
    common.need(common.PROGRAM, "run scripts/build first")
    chosen = [name.strip() for name in arguments.scenes.split(";")]
    for name in chosen:
        if name not in SCENES:
            common.give_up(f"unknown scene '{name}'; known: {'; '.join(SCENES)}", 2)
    chosen = [name for name in chosen if "log" not in SCENES[name] or (common.DATA / SCENES[name]["log"]).exists()]
    rows, models, drawn = [], {}, []
    for place in PLACES:
        scenes = [name for name in place if name in chosen]
        if not scenes:
            continue
        model, models[scenes[0]] = learn(scenes)
        rows += [measure(name, arguments.seed, model) for name in scenes]
        drawn = figures(rows, models)
        common.write_json("recslam", {"machine": common.machine(), "commit": common.commit(), "models": models, "rows": rows, "figures": drawn})
    plots.draw(common.OUT, drawn)
    report.write()
    text = results_text(rows, models)
    print(text)
    if not arguments.dry_run:
        common.write_results("recslam", text)
    return max(common.unmet("not one map in every run", [f"{row['name']} ({most_maps(row)} maps)" for row in rows if not is_one_map(row)]),
               common.unmet("against the cloud alone", missed_goals(rows)))
