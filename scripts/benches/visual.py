"""accuracy, speed and memory of camera SLAM on public sequences and in simulated buildings

Needs the program (scripts/build) and the sequences below MAPWEAVE_DATA (default ../shared/data): visual/SEQUENCE. Simulated ones are made
by `mapweave simulate` when they are first needed (some minutes each) and kept in out/bench/visual/worlds. Every run has one processor.
A run that placed less than nine tenths of its frames has no error to show, and the exit code is 5: what was lost is not in it.
Writes the table between <!-- bench:visual --> and <!-- /bench --> of datasets/RESULTS.md, and out/bench/visual.json. A partial run (--sequences)
keeps the other rows as they were measured before.
"""
import json
import math
import os
import statistics

from benches import common

REAL = {
    "tum_fr1_rpy": {"sensor": "rgbd", "goal_m": 0.0216},
    "hololens_office_part1": {"sensor": "rgbd", "goal_m": 0.046},
    "kitti06_first51": {"sensor": "stereo", "goal_m": 0.07},
    "euroc_v101_static": {"sensor": "stereo", "goal_m": 0.005, "stands": True},
}
# Goals by sensor; a world's robots are each one row.
WORLDS = {
    "apartment": {"world": "camera_apartment.yaml", "robots": ("alpha", "beta", "gamma"), "goal_m": {"rgbd": 0.05, "stereo": 0.08, "mono": 0.12}},
    "loop": {"world": "camera_loop.yaml", "robots": ("alpha",), "goal_m": {"rgbd": 0.10}},
}
LEAST_PLACED = 0.9   # of the frames, for an error to be one of the whole
HEADERS = ("sequence", "sensor", "frames", "lost (longest, s)", "ATE RMSE, m (least to most of seeds)", "goal, m", "loops", "tracking, ms (p99)", "keyframe, ms",
           "frames/s", "peak, MB", "loop corrected after, s")


def sequences():
    known = dict(REAL)
    for name, world in WORLDS.items():
        for sensor, goal in world["goal_m"].items():
            for robot in world["robots"]:
                known[f"{name}-{sensor}-{robot}"] = {"sensor": sensor, "goal_m": goal, "world": name, "robot": robot}
    return known


def add_arguments(parser):
    parser.add_argument("--sequences", default=",".join(sequences()), metavar="NAME,...", help="default: all of %(default)s")
    parser.add_argument("--seeds", type=int, default=5, metavar="N", help="the median error of N seeds (default: %(default)s)")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md and README.md as they are")


def kitti_truth(folder, out):
    """poses.txt (3 x 4, row by row) and times.txt as a TUM trajectory."""
    lines = []
    for time, row in zip((folder / "times.txt").read_text().split(), (folder / "poses.txt").read_text().splitlines()):
        values = [float(value) for value in row.split()]
        lines.append(f"{float(time):.6f} {values[3]} {values[7]} {values[11]} 0 0 0 1\n")  # errors of places only
    out.write_text("".join(lines))
    return out


def simulated(name, sensor):
    sensor = "rgbd" if sensor == "mono" else sensor  # whose pictures they are, without their depth
    folder = common.OUT / f"visual/worlds/{name}-{sensor}"
    if not (folder / "manifest.json").exists() and not (folder / "run.yaml").exists():
        common.mapweave("simulate", common.ROOT / "configs/worlds" / WORLDS[name]["world"], "--set", f"cameras.0.kind={sensor}",
                        "--out", folder, "--force")
    return folder


def inputs_of(name, sequence):
    """The log, and the truth of what its trajectory is of: the robot, or the camera where nothing says how it stands on one."""
    if "world" in sequence:
        folder = simulated(sequence["world"], sequence["sensor"])
        return folder / f"{sequence['robot']}.rawlog", folder / f"{sequence['robot']}.truth.tum"
    folder = common.DATA / "visual" / name
    if (folder / "poses.txt").exists():
        return folder, kitti_truth(folder, common.OUT / f"visual/{name}.truth.tum")
    return folder, folder / "groundtruth.txt"


def farthest_from_start(trajectory):
    poses = [[float(value) for value in line.split()[1:4]] for line in trajectory.read_text().splitlines()]
    return max(math.dist(poses[0], pose) for pose in poses)


def closing_delay_s(truth, loops):
    """From when the robot is back where it was half a minute ago or longer (1 m, 20 degrees) until its map is straight; None without a loop."""
    poses = [[float(value) for value in line.split()] for line in truth.read_text().splitlines() if line and line[0] != "#"][::4]

    def is_back(now, then):
        turn = abs(sum(a * b for a, b in zip(now[4:8], then[4:8])))
        return now[0] - then[0] > 30 and math.dist(now[1:4], then[1:4]) < 1.0 and turn > math.cos(math.radians(10))

    back = next((now[0] - poses[0][0] for now in poses if any(is_back(now, then) for then in poses[::4])), None)
    return loops[0][1] - back if loops and back is not None else None


def frames_of(trajectory):
    return sum(1 for line in trajectory.read_text().splitlines() if line and line[0] != "#")


def error_of(trajectory, truth, sequence):
    if sequence.get("stands"):
        return farthest_from_start(trajectory)
    align = "sim3" if sequence["sensor"] == "mono" else "se3"
    _, text = common.mapweave("evaluate", "trajectory", "--estimate", trajectory, "--reference", truth, "--align", align, "--json")
    return json.loads(text)["ate_translation_rmse_m"]


def measure(name, sequence, seeds):
    log, truth = inputs_of(name, sequence)
    errors, placed = [], []
    for seed in range(1, seeds + 1):
        out = common.OUT / f"visual/{name}"
        common.mapweave("slam", log, "--sensor", sequence["sensor"], "--seed", seed, "--threads", 1, "--out", out, "--force")
        errors.append(error_of(out / "trajectory.tum", truth, sequence))
        camera = json.loads((out / "summary.json").read_text())["robots"][0]["cameras"][0]
        placed.append(frames_of(out / "trajectory.tum") / max(1, camera["frames"]))
    summary = json.loads((out / "summary.json").read_text())
    robot = summary["robots"][0]
    delay_s = closing_delay_s(truth, robot["cameras"][0]["loop_seconds"]) if sequence.get("world") == "loop" else None
    return {"name": name, "sequence": sequence, "errors_m": errors, "placed": placed, "camera": robot["cameras"][0], "closing_delay_s": delay_s,
            "frames_per_second": robot["cameras"][0]["frames"] / robot["cpu_seconds"], "peak_rss_bytes": summary["peak_rss_bytes"]}


def lost(camera):
    return f"{camera['lost']} ({camera['longest_loss_seconds']:.1f})" if camera["lost"] and "longest_loss_seconds" in camera else camera["lost"]


def is_tracked(row):
    return min(row["placed"]) >= LEAST_PLACED


def cells(row):
    camera, errors = row["camera"], row["errors_m"]
    if not is_tracked(row):
        return (row["name"], row["sequence"]["sensor"], camera["frames"], lost(camera), "-", row["sequence"]["goal_m"], camera["loops"], *("-" for _ in range(5)))
    return (row["name"], row["sequence"]["sensor"], camera["frames"], lost(camera),
            f"{statistics.median(errors):.4f} ({min(errors):.4f} to {max(errors):.4f} of {len(errors)})", row["sequence"]["goal_m"], camera["loops"],
            f"{camera['tracking_mean_ms']:.1f} ({camera['tracking_p99_ms']:.1f})", f"{camera['keyframe_mean_ms']:.1f}",
            f"{row['frames_per_second']:.0f}", f"{row['peak_rss_bytes'] / 1e6:.0f}", "" if row.get("closing_delay_s") is None else f"{row['closing_delay_s']:.1f}")


def run(arguments):
    known = sequences()
    chosen = [name for name in arguments.sequences.split(",") if name]
    for name in chosen:
        if name not in known:
            common.give_up(f"unknown sequence '{name}'; known: {', '.join(known)}", 2)
    common.need(common.PROGRAM, "run scripts/build first")
    for name in chosen:
        if "world" not in known[name]:
            common.need(common.DATA / "visual" / name, "set MAPWEAVE_DATA to the folder that holds visual/")
    (common.OUT / "visual/worlds").mkdir(parents=True, exist_ok=True)
    for name in chosen:
        if "world" in known[name]:
            simulated(known[name]["world"], known[name]["sensor"])
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})

    rows, measured = common.results_rows("visual", HEADERS), []
    for name in chosen:
        measured.append(measure(name, known[name], arguments.seeds))
        rows[name] = cells(measured[-1])
        common.write_json("visual", {"machine": common.machine(), "commit": common.commit(), "rows": measured})
    text = common.table(HEADERS, [rows[key] for key in known if key in rows])
    text += (f"\n\nMeasured by `scripts/bench visual` on {common.machine()}; processor time, decoding of pictures included in frames/s. Median "
             f"of the seeds' errors; loop corrected after: seconds from the robot's return to a known place until its map was corrected; mono is aligned with scale; `euroc_v101_static` stands still: the farthest from its start.")
    print(text)
    if not arguments.dry_run:
        common.write_results("visual", text)
    return common.unmet("too few frames were placed", [row["name"] for row in measured if not is_tracked(row)])
