"""Fusion in rounds while robots drive: how soon a first joint map is there, how old previews are, and what rounds cost

Needs the program (scripts/build). Simulates ten robots in an apartment of 13 x 18 m (scene of `scripts/bench recslam`), cuts public logs where MAPWEAVE_DATA has them, and runs
each team without rounds and with one every --period seconds. Two robots meet when both have seen METRES of the same walls, by the truth. Writes the table between <!-- bench:rounds -->
and <!-- /bench --> of datasets/RESULTS.md, and out/bench/rounds.json. A final map that rounds changed, a first joint map later than 5 s after the first two robots of an edge met,
and a preview of an edge older than 10 s end with exit code 5. Takes some minutes; --quick one (one drive in the apartment).
"""
import json
import math
import re

from benches import common, recslam, tiers

SCENE = "13 x 18 m, 10 robots"
METRES = 5.0              # of wall that both have seen
GOAL_S, GOAL_AGE_S = 5.0, 10.0
RANGE_M, RAYS, STEP_M, CELL_M = 20.0, 46, 0.1, 0.1
QUIET = ["--set", "output.report=false", "--set", "output.pcd=false"]


def add_arguments(parser):
    parser.add_argument("--seeds", type=int, default=3, metavar="N", help="drives in the apartment (default: %(default)s)")
    parser.add_argument("--first-seed", type=int, default=42, metavar="N", help="(default: %(default)s)")
    parser.add_argument("--period", type=float, default=5.0, metavar="SECONDS", help="of data between two rounds (default: %(default)s)")
    parser.add_argument("--quick", action="store_true", help="one drive in the apartment, to try it out; leaves RESULTS.md as it is")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md as it is")


def simulated(seed):
    folder = common.OUT / "rounds" / f"apartment-{seed}"
    if not (folder / "logs/run.yaml").exists():
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "world.yaml").write_text(recslam.world_text(recslam.SCENES[SCENE], seed))
        common.mapweave("simulate", folder / "world.yaml", "--out", folder / "logs", "--force")
    return folder, folder / "logs/run.yaml"


def poses_of(path):
    """Seconds since the start, x, y, yaw: one for each second."""
    rows = [[float(value) for value in line.split()] for line in path.read_text().splitlines()]
    return [(row[0] - rows[0][0], row[1], row[2], 2.0 * math.atan2(row[6], row[7])) for row in rows[::5]]


class Walls:
    """Of the final map, in the frame of the first robot's start."""
    def __init__(self, team):
        raw = (team / "map.pgm").read_bytes()
        header = re.match(rb"P5\s+(?:#[^\n]*\n)*\s*(\d+)\s+(\d+)\s+(\d+)\s", raw)
        self.width, self.height = int(header[1]), int(header[2])
        self.pixels = raw[header.end():]
        text = (team / "map.yaml").read_text()
        self.resolution = float(re.search(r"resolution: ([\d.e-]+)", text)[1])
        self.left, self.bottom = (float(value) for value in re.search(r"origin: \[([^\]]*)\]", text)[1].split(",")[:2])

    def is_wall(self, x, y):
        column, row = int((x - self.left) / self.resolution), int((y - self.bottom) / self.resolution)
        return 0 <= column < self.width and 0 <= row < self.height and self.pixels[(self.height - 1 - row) * self.width + column] < 100

    def seen_from(self, x, y, yaw):
        for ray in range(RAYS):
            angle = yaw - math.pi / 2 + math.pi * ray / (RAYS - 1)
            for step in range(1, int(RANGE_M / STEP_M)):
                there = (x + math.cos(angle) * step * STEP_M, y + math.sin(angle) * step * STEP_M)
                if self.is_wall(*there):
                    yield math.floor(there[0] / CELL_M), math.floor(there[1] / CELL_M)
                    break


def meetings(logs, team):
    """(seconds, one, other): when both have seen so many metres of the same walls; the first pair first."""
    walls, drives = Walls(team), {path.name.split(".")[0]: poses_of(path) for path in sorted(logs.glob("*.truth.tum"))}
    _, x0, y0, yaw0 = next(iter(drives.values()))[0]
    first = {}
    for robot, poses in drives.items():
        seen = first.setdefault(robot, {})
        for seconds, x, y, yaw in poses:
            east, north = x - x0, y - y0
            for cell in walls.seen_from(math.cos(yaw0) * east + math.sin(yaw0) * north, math.cos(yaw0) * north - math.sin(yaw0) * east, yaw - yaw0):
                seen.setdefault(cell, seconds)
    found = []
    for one in first:
        for other in first:
            times = sorted(max(first[one][cell], first[other][cell]) for cell in first[one].keys() & first[other].keys()) if one < other else []
            if len(times) >= METRES / CELL_M:
                found.append((times[int(METRES / CELL_M) - 1], one, other))
    return sorted(found)


def cpu_of(summary):
    line = summary["timeline"]
    return (sum(robot["packing_cpu_seconds"] + robot["mapping_cpu_seconds"] for robot in line["robots"]) + line["cloud"]["fusing_cpu_seconds"]
            + sum(edge["fusing_cpu_seconds"] + edge["judging_cpu_seconds"] for edge in line["edges"]))


def outputs_of(out):
    """Checksums of all that is no preview."""
    outputs = json.loads((out / "manifest.json").read_text())["outputs"]
    return {path: checksum for path, checksum in outputs.items() if path != "config.yaml" and not path.startswith("rounds/")}


def measured(name, folder, config, period_s, logs=None):
    for kind, seconds in (("without", 0.0), ("with", period_s)):
        common.mapweave("run", config, "--out", folder / kind, "--force", *QUIET, "--set", f"cloud.rounds.period_s={seconds}", "--set", "network.edge_cloud.profile=wifi",
                        "--set", "network.robot_edge.profile=wifi")
    summary = json.loads((folder / "with/summary.json").read_text())
    rounds = summary["timeline"]["rounds"]
    edges = [tier for tier in rounds["tiers"] if tier["tier"] != "cloud"]
    edge_of = {robot["id"]: robot["edge"] for robot in summary["robots"]}
    team = folder / "with/team" if (folder / "with/team").exists() else folder / "with/team-1"
    met = [seconds for seconds, one, other in (meetings(logs, team) if logs else []) if edge_of[one] == edge_of[other]]
    joint = rounds["first_joint"] or {}
    return {"name": name, "same": outputs_of(folder / "without") == outputs_of(folder / "with"), "rounds": len(rounds["rounds"]), "met_s": met[0] if met else None,
            "joint_s": joint.get("ready_seconds"), "oldest_s": max(tier["oldest_seconds"] for tier in edges), "left_out": sum(tier["left_out"] for tier in rounds["tiers"]),
            "bytes": summary["rounds"]["bytes_to_cloud"] / sum(robot["sensed_bytes"] for robot in summary["timeline"]["robots"]),
            "cost": summary["rounds"]["cpu_seconds"] / cpu_of(summary), "load": summary["rounds"]["cpu_seconds"] / summary["rounds"]["recorded_seconds"]}


def problems(row):
    found = []
    if not row["same"]:
        found.append("rounds changed the final map")
    if row["rounds"] == 0:
        found.append("no rounds came about")
    if row["met_s"] is not None and (row["joint_s"] is None or row["joint_s"] > row["met_s"] + GOAL_S):
        found.append(f"first joint map after {row['joint_s']} s, two robots of an edge met after {row['met_s']:.1f} s")
    if row["oldest_s"] > GOAL_AGE_S:
        found.append(f"a preview of an edge was {row['oldest_s']:.1f} s old")
    return [f"{row['name']}: {problem}" for problem in found]


def table_of(rows, period_s):
    text = common.table(("team", "rounds", "two robots of an edge met after", "first joint map there after", "oldest preview of an edge", "edges to cloud, of what was sensed", "processor time, of all else", "of one processor while they drive", "rounds of tiers left out, as they were busy"),
                        [(row["name"], row["rounds"], "-" if row["met_s"] is None else f"{row['met_s']:.0f} s", "-" if row["joint_s"] is None else f"{row['joint_s']:.1f} s", f"{row['oldest_s']:.1f} s",
                          f"{row['bytes']:.2f}", f"{100 * row['cost']:.0f} %", f"{100 * row['load']:.0f} %", row["left_out"]) for row in rows])
    return text + (f"\n\nMeasured by `scripts/bench rounds` on {common.machine()}, a round every {period_s:g} s of data; WiFi. Two robots met when both had seen {METRES:g} m of the same walls, by the truth. "
             "The final maps are those without rounds, byte for byte.")


def run(arguments):
    common.need(common.PROGRAM, "run scripts/build first")
    rows = []
    for seed in range(arguments.first_seed, arguments.first_seed + (1 if arguments.quick else arguments.seeds)):
        folder, config = simulated(seed)
        rows.append(measured(f"{SCENE}, drive {seed}", folder, config, arguments.period, folder / "logs"))
    for name in () if arguments.quick else tiers.PUBLIC:
        folder = common.OUT / "rounds" / name
        if found := tiers.cut(folder, name):
            rows.append(measured(f"{name}, 4 robots", folder, found[0], arguments.period))
    text = table_of(rows, arguments.period)
    common.write_json("rounds", {"machine": common.machine(), "commit": common.commit(), "rows": rows})
    print(text)
    found = [problem for row in rows for problem in problems(row)]
    if found:
        common.give_up("; ".join(found), 5)
    if not arguments.dry_run and not arguments.quick:
        common.write_results("rounds", text)
    return 0
