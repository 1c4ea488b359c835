"""What edges send: bytes against overlap and against robots (RecSLAM fig. 7b, 7c), with the error that it costs, whole maps beside thinned ones

Needs the program (scripts/build). Simulates apartments in which each robot drives some rooms and shares a part of them with the next one, and cuts public logs
where MAPWEAVE_DATA has them; runs each team twice, with cloud.thin_maps off and on. Writes the table between <!-- bench:tiers --> and <!-- /bench --> of
datasets/RESULTS.md, out/bench/tiers.json, and plots (PNG) and report.html beside it. A team that is one map with whole maps and not with thinned ones,
more bytes than the goals, and an error that grows by more than a twentieth end with exit code 5. Takes ten minutes.
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


def problems(name, rows, half):
    found = []
    if any(row["thinned"]["maps"] > row["whole"]["maps"] for row in rows):
        found.append(f"{name}: thinned maps stay apart that merge as a whole")
    goal = GOALS.get(name, GOAL_HALF if half else None)
    if goal and mean(rows, "thinned", "up") > goal:
        found.append(f"{name}: {mean(rows, 'thinned', 'up'):.2f} of what robots sensed; the goal is {goal}")
    if mean(rows, "thinned", "error_m") > GOAL_ERROR * mean(rows, "whole", "error_m"):
        found.append(f"{name}: the error is {mean(rows, 'thinned', 'error_m') / mean(rows, 'whole', 'error_m'):.3f} times that of whole maps; the goal is {GOAL_ERROR}")
    return found


def run(arguments):
    home, teams = common.OUT / "tiers", []
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    for robots in TEAMS:
        for overlap in OVERLAPS:
            rows = []
            for seed in seeds:
                folder = home / f"chain-{robots}-{overlap}-{seed}"
                rows.append(measured(*simulated(folder, chain_world(robots, overlap, seed)), folder))
            teams.append({"name": f"{robots} robots, {overlap} % shared", "robots": robots, "overlap": overlap, "rows": rows})
    rows = []
    for seed in seeds:
        folder = home / f"apartment-{seed}"
        rows.append(measured(*simulated(folder, apartment_world(seed)), folder))
    teams.append({"name": "13 x 18 m, 10 robots", "robots": 10, "rows": rows})
    for name, (_, _, sensor) in PUBLIC.items():
        folder = home / name
        if found := cut(folder, name):
            teams.append({"name": f"{name}, 4 robots", "robots": 4, "rows": [measured(*found, folder, sensor)]})
    drawn = [plots.figure("tiers-bytes", "edge to cloud, of what robots sensed (fig. 7b)", "% of rooms shared", "share",
                          {f"{robots} robots, {kind}": [(team["overlap"], mean(team["rows"], kind, "up")) for team in teams if team.get("overlap") and team["robots"] == robots]
                           for robots in (2, 10) for kind in ("whole", "thinned")})]
    common.OUT.mkdir(parents=True, exist_ok=True)
    plots.draw(common.OUT, drawn)
    text = common.table(("team", "edge to cloud, whole", "thinned", "to edges, whole", "thinned", "walls left out", "error, whole", "thinned", "cloud, whole", "thinned", "until the map is there, whole", "thinned"),
                        [(team["name"], *(f"{mean(team['rows'], kind, what):.2f}" for what in ("up", "to_edges") for kind in ("whole", "thinned")),
                          f"{100 * mean(team['rows'], 'thinned', 'walls_left_out'):.1f} %", *(f"{1000 * mean(team['rows'], kind, 'error_m'):.1f} mm" for kind in ("whole", "thinned")),
                          *(f"{mean(team['rows'], kind, what):.2f} s" for what in ("cloud_s", "total_s") for kind in ("whole", "thinned"))) for team in teams])
    text += (f"\n\nMeasured by `scripts/bench tiers` on {common.machine()}; bytes are shares of what the robots sensed; simulated teams: mean of {arguments.seeds} buildings, error: ATE against the truth; "
             "public logs: mean error of relations.")
    common.write_json("tiers", {"machine": common.machine(), "commit": common.commit(), "teams": teams, "figures": drawn})
    report.write()
    print(text)
    found = [problem for team in teams for problem in problems(team["name"], team["rows"], team.get("overlap") == 50)]
    if found:
        common.give_up("; ".join(found), 5)
    if not arguments.dry_run:
        common.write_results("tiers", text)
    return 0
