"""What edges send: bytes against overlap and against robots (RecSLAM fig. 7b, 7c), with the error that it costs, whole maps beside thinned ones

Needs the program (scripts/build). Simulates apartments in which each robot drives some rooms and shares a part of them with the next one, and cuts public logs
where MAPWEAVE_DATA has them; runs each team twice, with cloud.thin_maps off and on. Writes the table between <!-- bench:tiers --> and <!-- /bench --> of
datasets/RESULTS.md, out/bench/tiers.json, and plots (PNG) and report.html beside it. A simulated team that is not one map, a team that is one map with whole maps and not with thinned ones,
more bytes than the goals, and an error that grows by more than a twentieth end with exit code 5. Takes ten minutes; --quick two (2 and 4 robots, one building).
"""
import json
import shutil

from benches import common, plots, report

ROOMS_OF_A_ROBOT = 6
OVERLAPS = (33, 50, 67)
TEAMS = (2, 4, 6, 10)
GOALS = {"13 x 18 m, 10 robots": 0.3}   # of what robots sensed; with half of the rooms shared:
GOAL_HALF, GOAL_ERROR = 0.5, 1.05
PUBLIC = {"fr079": ("laser/fr079", 40, "0.04,0,0"), "intel": ("laser/intel", 60, None), "mit-killian": ("laser/mit-killian", 120, None)}


def add_arguments(parser):
    parser.add_argument("--seeds", type=int, default=3, metavar="N", help="buildings of each kind (default: %(default)s)")
    parser.add_argument("--first-seed", type=int, default=42, metavar="N", help="(default: %(default)s)")
    parser.add_argument("--quick", action="store_true", help="2 and 4 robots that share half of their rooms, in one building, to try it out; leaves RESULTS.md as it is")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md as it is")


def chain_world(robots, overlap, seed):
    """Robots of six rooms each; each shares this percentage of them with the next one."""
    step = round(ROOMS_OF_A_ROBOT * (100 - overlap) / 100)
    rooms = ROOMS_OF_A_ROBOT + step * (robots - 1)
    lines = [f"seed: {seed}", "buildings:", f"  - {{kind: apartment, seed: {seed}, apartment: {{width_m: {4.5 * ((rooms + 1) // 2):g}, height_m: 13}}}}",
             f"edges: {max(1, robots // 3)}", "motion: {speed_min_m_per_s: 0.2, speed_max_m_per_s: 0.2, clearance_m: 0.2}", "robot_radius_m: 0.1", "robots:"]
    lines += [f"  - {{id: r{i}, first_room: {step * i}, last_room: {step * i + ROOMS_OF_A_ROBOT - 1}, length_m: 60}}" for i in range(robots)]
    return "\n".join(lines) + "\n"


def apartment_world(seed):
    from benches import recslam
    return recslam.world_text(recslam.SCENES["13 x 18 m, 10 robots"], seed, seed)


def simulated(folder, text):
    """Configuration and a folder of the truth."""
    if not (folder / "logs/run.yaml").exists():
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "world.yaml").write_text(text)
        common.mapweave("simulate", folder / "world.yaml", "--out", folder / "logs", "--force")
        (folder / "truth").mkdir(exist_ok=True)
        for path in (folder / "logs").glob("*.truth.tum"):
            shutil.copy(path, folder / "truth" / path.name.replace(".truth", ""))
    return folder / "logs/run.yaml", folder / "truth"


def cut(folder, name):
    data, overlap_s, _ = PUBLIC[name]
    log = next((common.DATA / data).glob("*[!f].rawlog"), None)
    if log is None:
        return None
    config = folder / "team.yaml"
    if not config.exists():
        common.mapweave("split", log, "--robots", 4, "--overlap", overlap_s, "--out", folder / "logs", "--force")
        config.write_text("robots:\n" + "\n".join(f"  - {{id: robot{i}, log: logs/robot{i}.rawlog}}" for i in range(4)) + "\nedges: [{id: north}, {id: south}]\n")
    return config, next(log.parent.glob("*.relations"))


def error_of(out, reference, sensor):
    if reference.is_dir():
        return json.loads(common.mapweave("evaluate", "trajectory", out, reference, "--json")[1])["ate_translation_rmse_m"]
    sensor = ["--sensor", sensor] if sensor else []
    return json.loads(common.mapweave("evaluate", "relations", out, reference, *sensor, "--json")[1])["translation_mean_m"]


def measured(config, reference, folder, sensor=None):
    row = {}
    for kind, thin in (("whole", "false"), ("thinned", "true")):
        out = folder / kind
        common.mapweave("run", config, "--out", out, "--force", "--set", f"cloud.thin_maps={thin}", "--set", "output.report=false", "--set", "output.pcd=false")
        summary = json.loads((out / "summary.json").read_text())
        line = summary["timeline"]
        sensed = sum(robot["sensed_bytes"] for robot in line["robots"])
        row[kind] = {"maps": summary["team"]["components"], "up": sum(edge["bytes"] for edge in line["edges"]) / sensed,
                     "to_edges": sum(edge["lent_bytes"] for edge in line["edges"]) / sensed, "cloud_s": line["cloud"]["fusing_cpu_seconds"],
                     "total_s": line["total_seconds"], "walls_left_out": max(edge["walls_left_out"] for edge in line["edges"]),
                     "degree": max((degree for *_, degree in line["overlaps"]), default=0.0), "error_m": error_of(out, reference, sensor)}
    return row


def mean(rows, kind, what):
    return sum(row[kind][what] for row in rows) / len(rows)


def problems(name, rows, half, is_simulated):
    found = []
    if is_simulated and any(row["thinned"]["maps"] > 1 for row in rows):
        found.append(f"{name}: {max(row['thinned']['maps'] for row in rows)} maps, one was expected (whole: {max(row['whole']['maps'] for row in rows)})")
    if any(row["thinned"]["maps"] > row["whole"]["maps"] for row in rows):
        found.append(f"{name}: thinned maps stay apart that merge as a whole")
    goal = GOALS.get(name, GOAL_HALF if half else None)
    if goal and mean(rows, "thinned", "up") > goal:
        found.append(f"{name}: {mean(rows, 'thinned', 'up'):.2f} of what robots sensed; the goal is {goal}")
    if mean(rows, "thinned", "error_m") > GOAL_ERROR * mean(rows, "whole", "error_m"):
        found.append(f"{name}: the error is {mean(rows, 'thinned', 'error_m') / mean(rows, 'whole', 'error_m'):.3f} times that of whole maps; the goal is {GOAL_ERROR}")
    return found


def figures(teams):
    """Bytes, and the error beside them, against overlap and against robots, before (whole) and after (thinned)."""
    robots, overlaps = (sorted({team[what] for team in teams}) for what in ("robots", "overlap"))
    kinds, drawn = ("whole", "thinned"), []
    for name, what, factor, title, unit in (("bytes", "up", 1.0, "edge to cloud, of what robots sensed", "share"), ("error", "error_m", 1000.0, "error of the map of all", "mm")):
        def series(x, of, values, words):
            return {words.format(value, kind): [(team[x], factor * mean(team["rows"], kind, what)) for team in teams if team[of] == value] for value in values for kind in kinds}
        drawn.append(plots.figure(f"tiers-{name}", title + " (fig. 7b)" * (name == "bytes"), "% of rooms shared", unit, series("overlap", "robots", sorted({robots[0], robots[-1]}), "{} robots, {}")))
        drawn.append(plots.figure(f"tiers-{name}-robots", title + " (fig. 7c)" * (name == "bytes"), "robots", unit, series("robots", "overlap", overlaps, "{} %, {}")))
    return drawn


def run(arguments):
    home, teams = common.OUT / "tiers", []
    count = 1 if arguments.quick else arguments.seeds
    seeds = range(arguments.first_seed, arguments.first_seed + count)
    for robots in (2, 4) if arguments.quick else TEAMS:
        for overlap in (50,) if arguments.quick else OVERLAPS:
            rows = []
            for seed in seeds:
                folder = home / f"chain-{robots}-{overlap}-{seed}"
                rows.append(measured(*simulated(folder, chain_world(robots, overlap, seed)), folder))
            teams.append({"name": f"{robots} robots, {overlap} % shared", "robots": robots, "overlap": overlap, "rows": rows})
    if not arguments.quick:
        rows = []
        for seed in seeds:
            folder = home / f"apartment-{seed}"
            rows.append(measured(*simulated(folder, apartment_world(seed)), folder))
        teams.append({"name": "13 x 18 m, 10 robots", "robots": 10, "rows": rows})
        for name, (_, _, sensor) in PUBLIC.items():
            folder = home / name
            if found := cut(folder, name):
                teams.append({"name": f"{name}, 4 robots", "robots": 4, "rows": [measured(*found, folder, sensor)]})
    drawn = figures([team for team in teams if "overlap" in team])
    common.OUT.mkdir(parents=True, exist_ok=True)
    plots.draw(common.OUT, drawn)
    text = common.table(("team", "edge to cloud, whole", "thinned", "to edges, whole", "thinned", "walls left out", "error, whole", "thinned", "cloud, whole", "thinned", "until the map is there, whole", "thinned"),
                        [(team["name"], *(f"{mean(team['rows'], kind, what):.2f}" for what in ("up", "to_edges") for kind in ("whole", "thinned")),
                          f"{100 * mean(team['rows'], 'thinned', 'walls_left_out'):.1f} %", *(f"{1000 * mean(team['rows'], kind, 'error_m'):.1f} mm" for kind in ("whole", "thinned")),
                          *(f"{mean(team['rows'], kind, what):.2f} s" for what in ("cloud_s", "total_s") for kind in ("whole", "thinned"))) for team in teams])
    text += (f"\n\nMeasured by `scripts/bench tiers` on {common.machine()}; bytes are shares of what the robots sensed; simulated teams: mean of {count} buildings, error: ATE against the truth; "
             "public logs: mean error of relations.")
    found = [problem for team in teams for problem in problems(team["name"], team["rows"], team.get("overlap") == 50, team["name"].split(",")[0] not in PUBLIC)]
    if found:
        text += " Missed: " + "; ".join(found) + "."
    common.write_json("tiers", {"machine": common.machine(), "commit": common.commit(), "teams": teams, "figures": drawn})
    report.write()
    print(text)
    if not arguments.dry_run and not arguments.quick:
        common.write_results("tiers", text)
    return common.unmet("missed", found)
