"""cost: the paper's ten robots, logs as four robots against mapping them alone, and many robots: time and memory against their number."""
import json
import math

from benches import recslam
from benches.team_bench import inputs
from benches.team_bench.program import QUIET, Failed

TEN = "13 x 18 m, 10 robots"
GOAL_TEN_S, GOAL_FOUR, GOAL_SLOPE = 2.0, 1.5, 1.3
FLOOR_ROBOTS = 40   # that the floor has room for


def ten_robots(bench):
    summary, out = recslam.run_team(TEN, recslam.SEED, "default-alone")
    row = {"total_s": summary["timeline"]["total_seconds"], "maps": summary["team"]["components"], "folder": str(out)}
    bench.gate("cost", f"{TEN}: maps", row["maps"], "1", row["maps"] == 1)
    came = f"{row['total_s']:.2f} s" if row["maps"] == 1 else f"- (there are {row['maps']} maps)"
    bench.gate("cost", f"{TEN}: map complete after", came, f"{GOAL_TEN_S} s", row["maps"] == 1 and row["total_s"] <= GOAL_TEN_S)
    return row


def four_robots(bench, log):
    """Processor time of `run` against that of `slam` on each."""
    cut = inputs.Cut(log, 4)
    folder = bench.scratch(f"cost-{log}")
    logs = cut.write_parts(bench.program, folder / "logs")
    config = folder / "team.yaml"
    lines = [f"  - {{id: {robot}, log: {json.dumps(str(path))}, edge: e{i % 2}}}\n" for i, (robot, path) in enumerate(zip(cut.robot_names(), logs))]
    config.write_text("robots:\n" + "".join(lines))
    alone = [bench.program("slam", path, "--out", folder / "alone", "--force", "--threads", 1, *QUIET).cpu_s for path in logs]
    whole = bench.program("run", config, "--out", folder / "run", "--force", "--threads", 1, *QUIET)
    summary = json.loads((folder / "run/summary.json").read_text())
    row = {"log": log, "alone_cpu_s": sum(alone), "run_cpu_s": whole.cpu_s, "ratio": whole.cpu_s / sum(alone), "maps": summary["team"]["components"],
           "peak_bytes": whole.peak_bytes, "stages": summary["stages"]}
    bench.gate("cost", f"{log} as four robots, run against mapping alone", f"{row['ratio']:.2f} ({row['run_cpu_s']:.1f} s, {row['alone_cpu_s']:.1f} s; {row['maps']} maps)", GOAL_FOUR, row["ratio"] <= GOAL_FOUR)
    return row


def cut_maps(bench, count):
    """The first so many parts of all logs: the first of each log, then the second of each, ... Parts are as long whatever their number."""
    logs, each = bench.arguments.logs, math.ceil(max(bench.arguments.curve) / len(bench.arguments.logs))
    found = []
    for i in range(each):
        for log in logs:
            found.append(bench.store.maps(inputs.Cut(log, each, name=f"{log}."))[0][i])
    return found[:count]


def site_maps(bench, count):
    """The first so many robots of one simulated floor: each has rooms in common with its neighbours, however many there are."""
    most, rooms = max(bench.arguments.curve), 30
    names = [f"r{i:02}" for i in range(most)]

    def write(folder):
        folder.mkdir(parents=True, exist_ok=True)
        robots = [{"id": name, "first_room": i * (rooms - 6) // FLOOR_ROBOTS, "last_room": i * (rooms - 6) // FLOOR_ROBOTS + 5, "length_m": 60,
                   "order": ("along", "back", "shuffled")[i % 3]} for i, name in enumerate(names)]
        world = {"seed": 21, "buildings": [{"kind": "apartment", "seed": 5, "apartment": {"width_m": 45, "height_m": 32}}], "robot_radius_m": 0, "robots": robots}
        (folder / "world.yaml").write_text(json.dumps(world))
        bench.program("simulate", folder / "world.yaml", "--out", folder / "world", "--force")
        return [folder / f"world/{name}.rawlog" for name in names]
    return bench.store.made(f"floor/{most}", names, write)[0][:count]


def curve(bench, what, maps_of, sizes):
    points = []
    for count in sizes:
        done, summary, merges = bench.merge(maps_of(bench, count), bench.scratch(f"cost-{what}-{count}"))
        points.append({"robots": count, "maps": summary["team"]["components"], "joined_pairs": sum(verdict["accepted"] for verdict in merges), "cpu_s": done.cpu_s,
                       "wall_s": done.wall_s, "peak_bytes": done.peak_bytes})
        print(f"cost: {what}, {count} robots: {done.cpu_s:.1f} s, {done.peak_bytes / 1e6:.0f} MB, {points[-1]['maps']} maps", flush=True)
    if len(points) > 1:
        a, b = points[0], points[-1]
        slope = math.log(b["cpu_s"] / a["cpu_s"]) / math.log(b["robots"] / a["robots"])
        bench.gate("cost", f"{what}: time grows with the robots to the power of", f"{slope:.2f}", GOAL_SLOPE, slope <= GOAL_SLOPE)
    return points


def floor(bench):
    points = curve(bench, "one simulated floor", site_maps, bench.arguments.curve)
    # Robots that were not joined would cost nothing.
    bench.gate("cost", f"one simulated floor, {points[-1]['robots']} robots: maps", points[-1]["maps"], "1", points[-1]["maps"] == 1)
    return points


def run(bench):
    rows, wanted = {}, bench.arguments.cost
    steps = {"ten": lambda: {TEN: ten_robots(bench)},
             "four": lambda: {f"{log} as 4": four_robots(bench, log) for log in bench.arguments.logs if log in inputs.BENCHMARK_LOGS},
             "cuts": lambda: {"cuts of all logs": {"points": curve(bench, "cuts of all logs", cut_maps, bench.arguments.curve)}},
             "floor": lambda: {"simulated floor": {"points": floor(bench)}}}
    for name, step in steps.items():
        if name not in wanted:
            continue
        try:
            rows.update(step())
        except Failed as failed:
            bench.gate("cost", name, failed, "a result", False)
        bench.keep("cost", rows)
    kept = bench.keep("cost", rows)
    four = [row for row in kept.values() if "ratio" in row]
    if four:
        bench.table("cost", "One log as four robots, processor time of `run` against `slam` of each", ("log", "maps", "mapping alone, s", "run, s", "run against mapping"),
                    [(row["log"], row["maps"], f"{row['alone_cpu_s']:.1f}", f"{row['run_cpu_s']:.1f}", f"{row['ratio']:.2f}") for row in four])
    points = [(name, point) for name, row in kept.items() for point in row.get("points", [])]
    if points:
        bench.table("cost", "Many robots: merging their maps", ("team", "robots", "maps", "pairs joined", "s of a processor", "peak, MB"),
                    [(name, point["robots"], point["maps"], point["joined_pairs"], f"{point['cpu_s']:.1f}", f"{point['peak_bytes'] / 1e6:.0f}") for name, point in points])
