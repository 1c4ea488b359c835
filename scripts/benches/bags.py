"""Bags of the public logs, written by the libraries of others: the same map from each container, how far from the log, how fast, in how much memory

Needs the program (scripts/build), the public logs (MAPWEAVE_DATA) and PyPI's rosbags and mcap (scripts/evaluation/ros_packages.py installs them below build/). Bags by ROS 1's own rosbag are left out
where Debian's python3-rosbag is missing. Writes the tables between <!-- bench:bags --> and <!-- /bench --> of datasets/RESULTS.md, and out/bench/bags.json. Observations or a map that differ between containers,
fewer than 100,000 scans/s (bz2 left out), and memory that grows by more than a tenth from a bag of a tenth of --gigabytes to the whole one end with exit code 5. Takes half an hour; --gigabytes 0 a quarter less.
"""
import gzip
import json
import math
import os
import pickle
import shutil
import statistics
import struct
import subprocess
import sys

from benches import common, ros

sys.path.insert(0, str(common.ROOT / "scripts/evaluation"))
import ros_packages   # noqa: E402

WRITER = common.ROOT / "scripts/evaluation/write_bag.py"
ROS_PYTHON = "/usr/bin/python3"   # which Debian's python3-rosbag is for
LOGS = ("intel", "fr079")
# Of write_bag.py, what the table calls it, who writes it, whether its speed is held against the limit.
KINDS = (("ros1", "ROS 1", "rosbags", True), ("ros1-bz2", "ROS 1, bz2", "rosbags", False), ("ros1-lz4", "ROS 1, lz4", "rosbags", True),
         ("rosbag", "ROS 1", "rosbag", True), ("rosbag-bz2", "ROS 1, bz2", "rosbag", False), ("rosbag-lz4", "ROS 1, lz4", "rosbag", True),
         ("mcap", "MCAP", "rosbags", True), ("mcap-zstd", "MCAP, zstd", "rosbags", True), ("mcap-lz4", "MCAP, lz4", "mcap", True),
         ("db3", "rosbag2 (db3)", "rosbags", True), ("db3-file", "rosbag2 (db3), file by zstd", "rosbags", True), ("db3-message", "rosbag2 (db3), messages by zstd", "rosbags", True))
LARGE = ("ros1", "mcap", "db3")
LIMIT_PER_S, LEAST_SCANS, MOST_GROWTH = 100_000, 50_000, 1.1
# Runs a program as a child of a small process: of a large one it would inherit the peak of memory.
LAUNCHER = """
import json, resource, subprocess, sys
code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps({"code": code, "seconds": used.ru_utime + used.ru_stime, "peak_mb": used.ru_maxrss / 1000}))
"""


def add_arguments(parser):
    parser.add_argument("--logs", default="", metavar="LOG,...", help=f"in place of {','.join(LOGS)}; leaves RESULTS.md as it is")
    parser.add_argument("--gigabytes", type=float, default=10.0, metavar="G", help="size of the bags whose memory is measured; 0: none, and RESULTS.md stays as it is (default: %(default)s)")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md as it is")


# --- what is written and read -----------------------------------------------------------------------------------------

def messages_of(source, laser):
    """What a robot with that laser records: its odometry and scan of each line of the log, and where the laser stands."""
    step = math.pi / (laser["rays"] - laser["rays"] % 2)
    place = struct.pack("<I", 1) + ros.header(0, "base_link") + ros.text("laser") + struct.pack("<7d", laser["x_m"], laser["y_m"], 0, 0, 0, 0, 1)
    messages = []
    for line in gzip.open(source, "rt"):
        words = line.split()
        if not words or words[0] != "FLASER":
            continue
        count = int(words[1])
        x, y, heading, stamp = map(float, words[5 + count:9 + count])
        microseconds = round(stamp * 1e6)
        pose = struct.pack("<7d", x, y, 0, 0, 0, math.sin(heading / 2), math.cos(heading / 2))
        fan = struct.pack("<7f", -math.pi / 2, -math.pi / 2 + step * (count - 1), step, 0, 0, 0, laser["max_range_m"])
        ranges = struct.pack(f"<I{count}fI", count, *map(float, words[2:2 + count]), 0)
        messages += [("/odom", "nav_msgs/Odometry", microseconds * 1000, ros.header(stamp, "odom") + ros.text("base_link") + pose + bytes(8 * 78)),
                     ("/scan", "sensor_msgs/LaserScan", microseconds * 1000, ros.header(stamp, "laser") + fan + ranges)]
    return [("/tf_static", "tf2_msgs/TFMessage", messages[0][2], place)] + messages


def write(source, wanted):
    """Bags of the messages in the file `source`: of each its kind, how often, its path."""
    for python, by_rosbag in ((ros_packages.installed(), False), (ROS_PYTHON, True)):
        chosen = [(kind, copies, path) for kind, copies, path in wanted if kind.startswith("rosbag") == by_rosbag]
        for *_, path in chosen:
            remove(path)
        if chosen and subprocess.run([python, "-B", WRITER, source, *(f"{kind}:{copies}:{path}" for kind, copies, path in chosen)], check=False).returncode != 0:
            common.give_up(f"{WRITER.name} could not write bags of {source}")


def path_of(folder, kind, name):
    return folder / (f"{kind}-{name}" + ("" if kind.startswith("db3") else ".mcap" if kind.startswith("mcap") else ".bag"))


def remove(path):
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)


def bytes_of(path):
    return sum(file.stat().st_size for file in path.iterdir()) if path.is_dir() else path.stat().st_size


def quiet(*arguments):
    return common.mapweave("--log-level", "warning", *arguments)[1]


def observations(path):
    """Of a rawlog that the program wrote: (100 ns, x, y, heading) of odometry; (100 ns, x, y, first angle, last angle, ranges, their validity) of scans."""
    data, at, odometry, scans = gzip.decompress(path.read_bytes()), 0, [], []
    while at < len(data):
        at += 1 + (data[at] & 0x7f) + 1   # length and name of the class, its version
        if data[at - 5:at - 1] == b"etry":
            x, y, heading = struct.unpack_from("<3d", data, at + 22)
            at = after_label(data, at + 22 + 24 + 1)
            odometry.append((struct.unpack_from("<Q", data, at)[0], x, y, heading))
            at += 8 + 2
        else:
            aperture, turns_left, _ = struct.unpack_from("<fBf", data, at)
            pose = struct.unpack_from("<12d", data, at + 31)
            at += 31 + 96 + 1
            count = struct.unpack_from("<I", data, at)[0]
            ranges, valid = struct.unpack_from(f"<{count}f", data, at + 4), data[at + 4 + 4 * count:at + 4 + 5 * count]
            at += 4 + 5 * count + 4
            yaw, half = math.atan2(pose[6], pose[3]), (0.5 if turns_left else -0.5) * aperture
            scans.append((struct.unpack_from("<Q", data, at)[0], pose[0], pose[1], yaw - half, yaw + half, ranges, valid))
            at = after_label(data, at + 12) + 8 + 1
        if data[at] != 0x88:
            common.give_up(f"{path}: an observation does not end at byte {at}")
        at += 1
    return odometry, scans


def after_label(data, at):
    return at + 4 + struct.unpack_from("<I", data, at)[0]


# --- what is compared -------------------------------------------------------------------------------------------------

def trajectory(folder):
    return [list(map(float, line.split())) for line in (folder / "trajectory.tum").read_text().splitlines() if not line.startswith("#")]


def cells(folder):
    size, _, pixels = (folder / "map.pgm").read_bytes().split(b"\n", 3)[1:]
    return size, pixels


def maps_apart(one, other):
    """The farthest poses of two results, in metres, and cells that differ; None where they are not of the same scans, or the size."""
    poses, others = trajectory(one), trajectory(other)
    (size, pixels), (other_size, other_pixels) = cells(one), cells(other)
    return {"poses_m": max(math.dist(a[1:3], b[1:3]) for a, b in zip(poses, others)) if [a[0] for a in poses] == [b[0] for b in others] else None,
            "cells": sum(a != b for a, b in zip(pixels, other_pixels)) if size == other_size else None, "of_cells": len(pixels)}


def turned(a, b):
    return abs(math.remainder(a - b, math.tau))


def apart(log, bag):
    """How far the observations of a log and of its bag differ at most."""
    (odometry, scans), (other_odometry, other_scans) = log, bag
    if (len(odometry), len(scans)) != (len(other_odometry), len(other_scans)):
        common.give_up(f"{len(scans)} scans and {len(odometry)} poses of a log became {len(other_scans)} and {len(other_odometry)} in its bag", 5)
    odometries, pairs = list(zip(odometry, other_odometry)), list(zip(scans, other_scans))
    return {"scans": len(scans), "rays": len(scans[0][5]),
            "stamps_s": max(abs(a[0] - b[0]) for a, b in odometries + pairs) * 1e-7,
            "ranges_m": max((abs(r - s) for a, b in pairs for r, s, u, v in zip(a[5], b[5], a[6], b[6]) if u and v), default=0.0),
            "rays_valid_in_one": sum(u != v for a, b in pairs for u, v in zip(a[6], b[6])),
            "angles_rad": max(turned(a[i], b[i]) for a, b in pairs for i in (3, 4)),
            "laser_m": max(math.dist(a[1:3], b[1:3]) for a, b in pairs),
            "odometry_m": max(math.dist(a[1:3], b[1:3]) for a, b in odometries),
            "odometry_rad": max(turned(a[3], b[3]) for a, b in odometries)}


def same_map(one, other):
    return all((one / name).read_bytes() == (other / name).read_bytes() for name in ("map.pgm", "trajectory.tum"))


# --- what is measured -------------------------------------------------------------------------------------------------

def used(*arguments):
    """Processor time and peak memory of the program."""
    done = subprocess.run([sys.executable, "-c", LAUNCHER, common.PROGRAM, "--log-level", "error", *map(str, arguments)], stdout=subprocess.PIPE, text=True, check=True)
    use = json.loads(done.stdout)
    if use["code"] != 0:
        common.give_up(f"mapweave {' '.join(map(str, arguments))} ended with exit code {use['code']}")
    return use


def seconds_to_read(bag):
    """`inspect` counts a bag's messages, and then reads it as a mapping does; of a topic that is not there it counts alone."""
    both, counting = [], []
    for _ in range(3):
        both.append(used("inspect", bag)["seconds"])
        counting.append(used("inspect", bag, "--set", "reading.topics=[/none]")["seconds"])
    return statistics.median(both) - statistics.median(counting)


def measured(name, kinds):
    """Of a log: how far its bag is from it, and a row for each container."""
    source, folder = common.DATA / f"laser/{name}/{name}.clf.gz", common.OUT / "bags" / name
    remove(folder)
    folder.mkdir(parents=True)
    shown = json.loads(quiet("inspect", source, "--json"))
    laser, = (sensor["lasers"][0] for sensor in shown["sensors"] if "lasers" in sensor)
    (folder / "messages").write_bytes(pickle.dumps(messages_of(source, laser)))
    quiet("convert", source, folder / "log.rawlog")
    quiet("slam", source, "--robot", name, "--out", folder / "log")
    scans = sum(sensor["count"] for sensor in shown["sensors"] if "lasers" in sensor)
    copies = {kind: math.ceil((LEAST_SCANS if is_limited else LEAST_SCANS / 4) / scans) for kind, _, _, is_limited in kinds}
    write(folder / "messages", [one for kind in copies for one in ((kind, 1, path_of(folder, kind, "once")), (kind, copies[kind], path_of(folder, kind, "often")))])
    difference, rows = {}, []
    for kind in copies:
        bag, often = path_of(folder, kind, "once"), path_of(folder, kind, "often")
        rawlog, out = folder / f"{kind}.rawlog", folder / f"map-{kind}"
        quiet("convert", bag, rawlog)
        if not rows:
            first = rawlog
            quiet("slam", rawlog, "--robot", name, "--out", folder / "rawlog")
            difference = {"name": name} | apart(observations(folder / "log.rawlog"), observations(rawlog)) | maps_apart(folder / "log", folder / "rawlog")
            print(json.dumps(difference), file=sys.stderr)
        quiet("slam", bag, "--robot", name, "--out", out)
        rows.append({"name": name, "kind": kind, "bytes": bytes_of(bag), "same_observations": rawlog.read_bytes() == first.read_bytes(), "same_map": same_map(out, folder / "rawlog"),
                     "scans_per_s": copies[kind] * scans / seconds_to_read(often)})
        remove(often)
        print(json.dumps(rows[-1]), file=sys.stderr)
    return difference, rows


def memory(kind, folder, bytes_once, gigabytes):
    """Peaks of `inspect` and of `convert` for a bag of so many gigabytes and one of a tenth."""
    row, bag, rawlog = {"kind": kind}, path_of(folder, kind, "large"), folder / "large.rawlog"
    for what, size in (("tenth", gigabytes / 10), ("whole", gigabytes)):
        try:
            write(folder / "messages", [(kind, max(1, math.ceil(size * 1e9 / bytes_once)), bag)])
            row[what] = {"bytes": bytes_of(bag), **used("inspect", bag), "convert_peak_mb": used("convert", bag, rawlog)["peak_mb"]}
        finally:
            remove(bag)
            rawlog.unlink(missing_ok=True)
    print(json.dumps(row), file=sys.stderr)
    return row


def has_room(gigabytes):
    free = shutil.disk_usage(common.OUT).free
    if free < 2.4e9 * gigabytes:
        print(f"scripts/bench: memory is not measured: a bag of {gigabytes:g} GB needs {2.4 * gigabytes:g} GB below {common.OUT}, {free / 1e9:.0f} GB are free", file=sys.stderr)
    return free >= 2.4e9 * gigabytes


# --- what is said -----------------------------------------------------------------------------------------------------

def is_slow(row):
    return row["scans_per_s"] < LIMIT_PER_S and any(kind == row["kind"] and is_limited for kind, _, _, is_limited in KINDS)


def problems(rows, large):
    found = []
    for row in rows:
        what = f"{row['name']}, {row['kind']}"
        if not row["same_observations"]:
            found.append(f"{what}: the observations are not those of the plain bag")
        if not row["same_map"]:
            found.append(f"{what}: the map is not the rawlog's")
        if is_slow(row):
            found.append(f"{what}: {row['scans_per_s']:.0f} scans/s")
    for row in large:
        for verb, peak in (("inspect", "peak_mb"), ("convert", "convert_peak_mb")):
            if row["whole"][peak] > MOST_GROWTH * row["tenth"][peak]:
                found.append(f"{row['kind']}, {verb}: {row['whole'][peak]:.0f} MB for {row['whole']['bytes'] / 1e9:.1f} GB, {row['tenth'][peak]:.0f} MB for a tenth")
    return found


def yes(value):
    return "yes" if value else "no"


def number(value, unit):
    return "other scans" if value is None else f"{value:.2g} {unit}" if value else "0"


def tables_of(differences, rows, large):
    names = {kind: (container, by) for kind, container, by, _ in KINDS}
    logs = [difference["name"] for difference in differences]
    by_kind = {kind: {row["name"]: row for row in rows if row["kind"] == kind} for kind in dict.fromkeys(row["kind"] for row in rows)}
    parts = [common.table(("container", "written by", "bytes of the plain bag's observations", "bytes of the rawlog's map and trajectory", *(f"{name}, MB" for name in logs), *(f"{name}, scans/s" for name in logs)),
                          [(*names[kind], yes(all(row["same_observations"] for row in of.values())), yes(all(row["same_map"] for row in of.values())),
                            *(f"{of[name]['bytes'] / 1e6:.1f}" for name in logs), *(f"{round(of[name]['scans_per_s'], -3):,.0f}" for name in logs)) for kind, of in by_kind.items()]),
             common.table(("log", "scans", "rays", "stamps", "ranges", "rays valid in one alone", "angles of the first and last ray", "laser's place", "odometry", "its heading", "poses of the map", "cells of the map"),
                          [(one["name"], one["scans"], one["rays"], number(one["stamps_s"], "s"), number(one["ranges_m"], "m"), one["rays_valid_in_one"], number(one["angles_rad"], "rad"), number(one["laser_m"], "m"),
                            number(one["odometry_m"], "m"), number(one["odometry_rad"], "rad"), number(one["poses_m"], "m"),
                            "other size" if one["cells"] is None else f"{one['cells']} of {one['of_cells']}") for one in differences])]
    if large:
        parts.append(common.table(("container", "written by", "bag", "peak of `inspect`", "of `convert`", "bag", "peak of `inspect`", "of `convert`"),
                                  [(*names[row["kind"]], *(text for what in ("tenth", "whole") for text in (f"{row[what]['bytes'] / 1e9:.2f} GB", f"{row[what]['peak_mb']:.0f} MB", f"{row[what]['convert_peak_mb']:.0f} MB"))) for row in large]))
    return parts


def text_of(found):
    """What stands in RESULTS.md."""
    names = {kind: f"{container}, by {by}" for kind, container, by, _ in KINDS}
    tables = tables_of(found["logs"], found["rows"], found["large"])
    notes = [f"Measured by `scripts/bench bags` on {found['machine']}, at a load of {found['load']:.0f}. Once in a bag: the scans and the odometry of a log, and where its laser stands. Scans/s: processor time of reading as a mapping does, "
             f"odometry with it, for {LEAST_SCANS:,} scans or more (of bz2 a quarter), by repetition: that of `inspect` less that of counting messages, medians of 3. Of bz2 nearly all is libbz2's own, which gives 50,000 scans/s of 180 rays a thread: "
             f"it is not held against the limit of {LIMIT_PER_S:,}." + "".join(f" Below the limit: {row['name']}, {names[row['kind']]}." for row in found["rows"] if is_slow(row)),
             "By how much a log's CARMEN lines and its bags differ at most. Ranges have 32 bits in both. Angles have 32 bits in bags alone, and headings are quaternions there; that is enough to move poses and cells of the map.",
             *(["The widest log, repeated."] if found["large"] else [])]
    return "\n\n".join(part for pair in zip(tables, notes) for part in pair)


def kinds_here():
    if subprocess.run([ROS_PYTHON, "-c", "import rosbag"], capture_output=True, check=False).returncode == 0:
        return KINDS
    print("scripts/bench: Debian's python3-rosbag is missing; its bags are left out", file=sys.stderr)
    return tuple(kind for kind in KINDS if kind[2] != "rosbag")


def run(arguments):
    common.need(common.PROGRAM, "run scripts/build first")
    try:
        ros_packages.installed()
    except ros_packages.Missing as problem:
        common.give_up(f"{problem}; run scripts/evaluation/ros_packages.py")
    logs = arguments.logs.split(",") if arguments.logs else LOGS
    for name in logs:
        common.need(common.DATA / f"laser/{name}/{name}.clf.gz", "set MAPWEAVE_DATA")
    kinds = kinds_here()
    differences, rows = map(list, zip(*(measured(name, kinds) for name in logs)))
    rows, large = sum(rows, []), []
    if arguments.gigabytes > 0 and has_room(arguments.gigabytes):
        widest = max(differences, key=lambda difference: difference["rays"])["name"]
        large = [memory(row["kind"], common.OUT / "bags" / widest, row["bytes"], arguments.gigabytes) for row in rows if row["name"] == widest and row["kind"] in LARGE]
    found = {"machine": common.machine(), "commit": common.commit(), "load": os.getloadavg()[2], "logs": differences, "rows": rows, "large": large}
    common.write_json("bags", found)
    print(text_of(found))
    if unmet := problems(rows, large):
        common.give_up("; ".join(unmet), 5)
    if not arguments.dry_run and not arguments.logs and arguments.gigabytes > 0:
        common.write_results("bags", text_of(found))
    return 0
