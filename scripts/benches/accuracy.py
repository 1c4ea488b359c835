"""relation error, time and memory on the public laser logs, for one robot and for teams cut out of one log

Needs the program (scripts/build) and the logs below MAPWEAVE_DATA (default ../shared/data): laser/LOG/LOG.rawlog, LOG.relations.
Writes the table between <!-- bench:accuracy --> and <!-- /bench --> of datasets/RESULTS.md, and out/bench/accuracy.json; what the
program wrote stays in out/bench/accuracy/. A team that did not become one map has no figures (the error would be that of one of its maps), and the
exit code is 5. A partial run (--logs, --engines) keeps the other rows as they were measured before.
"""
import json
import statistics

from benches import common

# Cuts in the log's own seconds, no overlap in time. `sensor`: where the relations speak of the laser, not of the robot.
LOGS = {
    "intel": {"engines": ("graph", "rbpf", "icp"), "cuts": ((976054203.0,), (976053754.4, 976054651.5))},
    "fr079": {"engines": ("graph", "rbpf", "icp"), "cuts": ((1742.2,), (1565.3, 1919.2)), "sensor": "0.04,0,0"},
    "mit-killian": {"engines": ("graph",), "cuts": ((),)},
    "fr-clinic": {"engines": ("graph",), "cuts": ((),)},
}
HEADERS = ("log", "verb", "robots", "engine", "relation error, m", "relation error, deg", "relations used", "wall, s", "x real time", "peak, MB",
           "maps joined")


def add_arguments(parser):
    parser.add_argument("--logs", default=",".join(LOGS), help="default: all of %(default)s")
    parser.add_argument("--engines", default="graph,rbpf,icp", help="of single robots; teams are mapped with graph (default: %(default)s)")
    parser.add_argument("--repeat", type=int, default=1, metavar="N", help="the median of N wall times")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md and README.md as they are")


def names(text, known, what):
    chosen = [name for name in text.split(",") if name]
    for name in chosen:
        if name not in known:
            common.give_up(f"unknown {what} '{name}'; known: {', '.join(known)}", 2)
    return chosen


def split(log, cuts):
    folder = common.OUT / f"accuracy/{log}-{len(cuts) + 1}-logs"
    source = common.DATA / f"laser/{log}/{log}.rawlog"
    if not cuts:
        return [source]
    flags = [flag for cut in cuts for flag in ("--at", repr(cut))]
    common.mapweave("split", source, "--robots", len(cuts) + 1, *flags, "--out", folder, "--force")
    return [folder / f"robot{i}.rawlog" for i in range(len(cuts) + 1)]


def measure(command, out, trajectory, log, repeat):
    """Runs the command `repeat` times; one row's numbers. The results are the same each time, the times are not."""
    walls = []
    for _ in range(repeat):
        code, _ = common.mapweave(*command, "--out", out, "--force")
        summary = json.loads((out / "summary.json").read_text())
        walls.append(summary["wall_seconds"])
    sensor = ("--sensor", LOGS[log]["sensor"]) if "sensor" in LOGS[log] else ()
    _, text = common.mapweave("evaluate", "relations", "--trajectory", trajectory, "--relations", common.DATA / f"laser/{log}/{log}.relations", *sensor, "--json")
    merges = json.loads((out / "merges.json").read_text()) if (out / "merges.json").exists() else []
    wall = statistics.median(walls)
    return {"log": log, "exit_code": code, "relations": json.loads(text), "wall_seconds": wall, "wall_seconds_all": walls,
            "real_time_factor": sum(robot["log_seconds"] for robot in summary["robots"]) / wall, "peak_rss_bytes": summary["peak_rss_bytes"],
            "team": summary["team"], "merges": [merge for merge in merges if merge["tier"] == "cloud"]}


def single(log, engine, repeat):
    out = common.OUT / f"accuracy/{log}-{engine}"
    source = common.DATA / f"laser/{log}/{log}.rawlog"
    return {**measure(("slam", source, "--engine", engine), out, out / "trajectory.tum", log, repeat), "verb": "slam", "robots": 1, "engine": engine}


def team(log, cuts, repeat):
    logs = split(log, cuts)
    folder = common.OUT / "accuracy"
    config = folder / f"{log}-{len(logs)}.yaml"
    robots = "".join(f"  - {{id: robot{i}, log: {json.dumps(str(path))}, edge: {('north', 'south')[i % 2]}}}\n" for i, path in enumerate(logs))
    config.write_text(f"robots:\n{robots}laser: {{engine: graph}}\n")
    out = folder / f"{log}-{len(logs)}"
    return {**measure(("run", config), out, out, log, repeat), "verb": "run", "robots": len(logs), "engine": "graph"}


def is_whole(row):
    return row["team"]["components"] == 1 and row["relations"]["used"] > 0


def cells(row):
    error = row["relations"]
    joined = "-"
    if row["robots"] > 1:
        accepted = [merge for merge in row["merges"] if merge["accepted"]]
        joined = f"{len(accepted)} of {len(row['merges'])} pairs, {row['team']['components']} map{'s' if row['team']['components'] > 1 else ''}"
    if not is_whole(row):
        return (row["log"], row["verb"], row["robots"], row["engine"], *("-" for _ in range(6)), joined)
    return (row["log"], row["verb"], row["robots"], row["engine"], f"{error['translation_mean_m']:.4f} ± {error['translation_std_m']:.4f}",
            f"{error['rotation_mean_deg']:.3f} ± {error['rotation_std_deg']:.3f}", f"{error['used']} of {error['count']}", f"{row['wall_seconds']:.1f}",
            f"{row['real_time_factor']:.0f}", f"{row['peak_rss_bytes'] / 1e6:.0f}", joined)


def place(row):
    return list(LOGS).index(row["log"]), row["verb"] == "run", row["robots"], ("graph", "rbpf", "icp").index(row["engine"])


def run(arguments):
    logs = names(arguments.logs, LOGS, "log")
    engines = names(arguments.engines, ("graph", "rbpf", "icp"), "engine")
    common.need(common.PROGRAM, "run scripts/build first")
    for log in logs:
        for ending in ("rawlog", "relations"):
            common.need(common.DATA / f"laser/{log}/{log}.{ending}", "set MAPWEAVE_DATA to the folder that holds laser/ (datasets/manifest.yaml lists the logs' origin)")
    (common.OUT / "accuracy").mkdir(parents=True, exist_ok=True)

    stored = common.OUT / "accuracy.json"
    rows = {tuple(place(row)): row for row in json.loads(stored.read_text())["rows"]} if stored.exists() else {}
    for log in logs:
        measured = [single(log, engine, arguments.repeat) for engine in LOGS[log]["engines"] if engine in engines]
        measured += [team(log, cuts, arguments.repeat) for cuts in LOGS[log]["cuts"]] if "graph" in engines else []
        for row in measured:
            rows[tuple(place(row))] = row
        common.write_json("accuracy", {"machine": common.machine(), "commit": common.commit(), "rows": [rows[key] for key in sorted(rows)]})
    text = common.table(HEADERS, [cells(rows[key]) for key in sorted(rows)])
    text += f"\n\nMeasured by `scripts/bench accuracy` on {common.machine()}. Mean ± standard deviation over all relations (Kuemmerle et al. 2009)."
    print(text)
    if not arguments.dry_run:
        common.write_results("accuracy", text)
    return common.unmet("not one map", [f"{row['log']} with {row['robots']} robots" for row in rows.values() if not is_whole(row)])
