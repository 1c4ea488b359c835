"""Nodes of ROS at sensor speed: is the map that of the recording, how soon is a scan in a robot's map, is a scan dropped

Needs the nodes (scripts/build, with ROS) and the public logs (MAPWEAVE_DATA). Cuts a log into robots that drive at once, publishes what they sense over a ROS master of its own on
loopback, and maps it by `mapweave_ros team`; then maps the recordings by `mapweave run`. Writes the table between <!-- bench:ros --> and <!-- /bench --> of datasets/RESULTS.md,
and out/bench/ros.json. A map that is not the recording's byte for byte, a scan that was published and is not in it, maps that stay apart, and a p95 over the limit end with exit code 5. Takes some
minutes: as long as the robots drive, and as long as mapping takes.
"""
import gzip
import json
import math
import os
import pathlib
import pickle
import resource
import signal
import socket
import struct
import subprocess
import sys
import time

from benches import common

NODES = common.PROGRAM.parent / "mapweave_ros"
DRIVE = pathlib.Path(__file__).resolve().parents[1] / "evaluation" / "ros_drive.py"
PYTHON = "/usr/bin/python3"
LIMIT_S = 1.0
LEAST_TIMED = 0.25  # of all scans; the others were sensed where a robot stood still
# Log, robots, seconds between previews, whether the latency is held against the limit.
ROWS = (("intel", 3, 0.5, True), ("fr079", 2, 0.5, True), ("fr079", 20, 2.0, False))


def add_arguments(parser):
    parser.add_argument("--seconds", type=float, default=180.0, metavar="S", help="that robots drive in each row (default: %(default)s)")
    parser.add_argument("--speed", type=float, default=1.0, metavar="X", help="how many times faster than sensed (default: %(default)s)")
    parser.add_argument("--rows", default="", metavar="LOG:ROBOTS,...", help="only these, as in intel:3; leaves RESULTS.md as it is")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md as it is")


def log_of(name):
    """Of a CARMEN log, in order: scans, (seconds, ranges), and odometry, (seconds, pose), of lines of its own and of its scans."""
    scans, odometry = [], []
    for line in gzip.open(common.DATA / "laser" / name / f"{name}.clf.gz", "rt"):
        words = line.split()
        if words and words[0] == "FLASER":
            count = int(words[1])
            rest = [float(word) for word in words[2 + count:9 + count]]
            scans.append((rest[6], [float(word) for word in words[2:2 + count]]))
            odometry.append((rest[6], rest[3:6]))
        elif words and words[0] == "ODOM":
            odometry.append((float(words[7]), [float(word) for word in words[1:4]]))
    return sorted(scans), sorted(odometry)


def text(value):
    return struct.pack("<I", len(value)) + value.encode()


def header(seconds, frame):
    """Stamped to the microsecond: finer ones are not found again in paths, whose stamps are of 100 ns."""
    microseconds = round(seconds * 1e6)
    return struct.pack("<III", 0, microseconds // 1_000_000, microseconds % 1_000_000 * 1000) + text(frame)


def odometry_message(stamp, space, pose):
    x, y, heading = pose
    turned = struct.pack("<7d", x, y, 0, 0, 0, math.sin(heading / 2), math.cos(heading / 2))
    return (f"/{space}/odom", "nav_msgs/Odometry", stamp, header(stamp, f"{space}/odom") + text(f"{space}/base_link") + turned + bytes(8 * 78))


def scan_message(stamp, space, ranges):
    count = len(ranges)
    fan = struct.pack("<7f", -math.pi / 2, math.pi / 2, math.pi / (count if count == 180 else count - 1), 0, 0, 0, 50)
    values = struct.pack(f"<I{count}fI", count, *(r if r < 50 else math.inf for r in ranges), 0)
    return (f"/{space}/scan", "sensor_msgs/LaserScan", stamp, header(stamp, f"{space}/laser") + fan + values)


def messages_of(name, robots, seconds):
    """What robots publish that drive parts of a log at once, each sharing a third with the next where the log is long enough: (topic, type, seconds, bytes), by time."""
    scans, odometry = log_of(name)
    begin, end = scans[0][0], scans[-1][0]
    step = min(2 / 3 * seconds, max(0.0, end - begin - seconds) / max(1, robots - 1))
    messages = []
    for robot in range(robots):
        space, first = f"tb{robot}", begin + robot * step
        mount = struct.pack("<I", 1) + header(1.6e9, f"{space}/base_link") + text(f"{space}/laser") + struct.pack("<7d", 0, 0, 0, 0, 0, 0, 1)
        messages.append(("/tf_static", "tf2_msgs/TFMessage", 1.6e9, mount))
        for made, sensed in ((odometry_message, odometry), (scan_message, scans)):
            messages += [made(1.6e9 + at - first, space, values) for at, values in sensed if first <= at < first + seconds]
    return sorted(messages, key=lambda message: message[2])


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


class RosMaster:
    def __init__(self, folder):
        port = free_port()
        self.environment = {key: value for key, value in os.environ.items() if not key.startswith("MAPWEAVE_")}
        self.environment |= {"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1", "ROS_HOME": str(folder / "ros_home")}
        self.process = subprocess.Popen(["rosmaster", "--core", "-p", str(port)], env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def __enter__(self):
        time.sleep(1.0)
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()


def measured(name, robots, period_s, arguments):
    folder = common.OUT / "ros" / f"{name}-{robots}"
    folder.mkdir(parents=True, exist_ok=True)
    subprocess.run(["rm", "-rf", *(str(folder / one) for one in ("maps", "maps.logs", "maps.store", "batch"))], check=True)
    messages = messages_of(name, robots, arguments.seconds)
    (folder / "messages").write_bytes(pickle.dumps(messages))
    published = {f"tb{robot}": sum(topic == f"/tb{robot}/scan" for topic, *_ in messages) for robot in range(robots)}
    with RosMaster(folder) as master, (folder / "node.log").open("w") as log:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        node = subprocess.Popen([NODES, "team", *published, "--out", "maps", "--port", "-1", "--json", "--set", f"live.preview_period_s={period_s}"], cwd=folder, env=master.environment, stdout=subprocess.PIPE, stderr=log, text=True)
        drive = subprocess.run([PYTHON, "-B", DRIVE, folder / "messages", str(arguments.speed)], env=master.environment, stdout=subprocess.PIPE, text=True, check=False)
        node.send_signal(signal.SIGINT)
        output = node.communicate()[0]
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if drive.returncode or node.returncode not in (0, 4):
        common.give_up(f"{name} as {robots} robots: the drive ended with {drive.returncode}, the node with {node.returncode}; see {folder / 'node.log'}")
    seen, summary = json.loads(drive.stdout), json.loads(output)
    common.mapweave("run", folder / "maps.logs/run.yaml", "--out", folder / "batch")
    results = [path.relative_to(folder / "batch") for path in (folder / "batch").rglob("map.mwdb") if "edges" not in path.parts]
    scans = {robot["id"]: robot["scans"] for robot in summary["robots"]}
    return {"name": f"{name} as {robots} robots", "scans": sum(published.values()), "missing": sum(published.values()) - sum(scans.values()),
            "same": all((folder / "maps" / path).exists() and (folder / "maps" / path).read_bytes() == (folder / "batch" / path).read_bytes() for path in results),
            "maps": summary["team"]["components"],
            "timed": seen["scans"], "median_s": seen["median_s"], "p95_s": seen["p95_s"], "longest_s": seen["longest_s"], "period_s": period_s,
            "seconds": arguments.seconds / arguments.speed,
            "cores": (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / (arguments.seconds / arguments.speed)}


def problems(row, is_limited):
    found = []
    if not row["same"]:
        found.append("the map is not the recording's")
    if row["missing"]:
        found.append(f"{row['missing']} of {row['scans']} scans are missing")
    if row["maps"] != 1:
        found.append(f"{row['maps']} maps in place of one")
    if row["timed"] < LEAST_TIMED * row["scans"]:
        found.append(f"{row['timed']} of {row['scans']} scans were timed, too few to say how late they are")
    if is_limited and (row["p95_s"] is None or row["p95_s"] > LIMIT_S):
        found.append(f"p95 of {row['p95_s']} s from a scan to the map")
    return [f"{row['name']}: {problem}" for problem in found]


def run(arguments):
    common.need(NODES, "run scripts/build where ROS is installed")
    common.need(common.DATA / "laser/intel/intel.clf.gz", "set MAPWEAVE_DATA")
    wanted = [row for row in ROWS if not arguments.rows or f"{row[0]}:{row[1]}" in arguments.rows.split(",")]
    rows, found = [], []
    for name, robots, period_s, is_limited in wanted:
        rows.append(measured(name, robots, period_s, arguments))
        found += problems(rows[-1], is_limited)
        print(json.dumps(rows[-1]), file=sys.stderr)
    cells = [(row["name"], row["scans"], row["missing"], "yes" if row["same"] else "no", row["timed"], f"{row['period_s']:g} s", f"{row['median_s']:.2f} s", f"{row['p95_s']:.2f} s", f"{row['longest_s']:.2f} s",
              f"{row['cores']:.2f}") for row in rows]
    result = common.table(("robots", "scans published", "missing in the map", "bytes of the recording's map", "scans timed", "previews every", "scan to the robot's map, median", "p95", "longest", "processors, with the player"), cells)
    result += (f"\n\nMeasured by `scripts/bench ros` on {common.machine()}, at {arguments.speed:g} times sensor speed for {arguments.seconds:g} s, all programs on one machine: from publishing a scan to receiving "
               "the robot's grid that has it. Timed are scans that are in its path; the others were sensed where it stood still. With previews every 0.5 s the p95 is held against a limit of 1 s.")
    common.write_json("ros", {"machine": common.machine(), "commit": common.commit(), "rows": rows})
    print(result)
    if found:
        common.give_up("; ".join(found), 5)
    if not arguments.dry_run and not arguments.rows:
        common.write_results("ros", result)
    return 0
