"""team maps of camera robots: accuracy against a single run, and times

Needs the program (scripts/build) and the sequences below MAPWEAVE_DATA (default ../shared/data): visual/SEQUENCE. Cuts each into two robots
that share some seconds, on an edge each; the cloud joins them. Robots with two cameras drive in simulated buildings (made when they are first
needed, some minutes each, and kept in out/bench/team-visual/worlds). Teams of more robots hand over features instead of pictures
(team_benchmark). Writes the tables between <!-- bench:team-visual -->, <!-- bench:rigs --> or <!-- bench:teams --> and <!-- /bench --> of
datasets/RESULTS.md, and out/bench/team-visual.json. Teams that did not become one map have no error of the team, and the exit code is 5. A partial run (--sequences) keeps the other rows as they were measured before.
"""
import json
import math
import statistics
import subprocess

from benches import common

SEQUENCES = {"tum_fr1_rpy": {"overlap_s": 2.3}, "hololens_office_part1": {"overlap_s": 5}}
# One robot in camera_apartment.yaml.
RIGS = {
    "two depth cameras": {"cameras": "[{id: ahead}, {id: back, yaw_deg: 180, x_m: -0.15}]", "length_m": 60, "sensor": "cameras"},
    "two single cameras": {"cameras": "[{id: ahead}, {id: back, yaw_deg: 180, x_m: -0.15}]", "length_m": 60, "sensor": "mono"},
    "a depth and a single one": {"cameras": "[{id: ahead}, {id: side, kind: mono, yaw_deg: 90, x_m: 0}]", "length_m": 30, "sensor": "cameras"},
}
# Pictures of as many a second as the published systems send.
PICTURES = {"pictures-30": {"title": "apartment, 3 robots, 30 pictures/s", "pictures_per_s": 30, "length_m": 30}}
# Of team_benchmark.
TEAMS = ("apartment-3", "apartment-8", "single-camera", "another-day", "repeated-rooms-100")
TEAM_HEADERS = ("cameras", "robots", "maps", "joined into", "wrongly", "each alone, ATE m", "team, ATE m", "goal, m", "up, kB/s",
                "down, kB/s")
RIG_HEADERS = ("cameras of a robot", "frames placed, each alone", "ATE, m, each alone", "frames placed, both", "ATE, m, both", "goal, m", "extrinsic constraints", "their error, m")
NAMES = (*SEQUENCES, *RIGS, *PICTURES, *TEAMS)
HEADERS = ("sequence", "robots", "joined", "single run, ATE m", "team, ATE m (least to most)", "goal, m", "witnesses", "merge, s (match + optimise)")


def add_arguments(parser):
    parser.add_argument("--sequences", default=",".join(NAMES), metavar="NAME,...", help="default: all of %(default)s")
    parser.add_argument("--seeds", type=int, default=3, metavar="N", help="the median error of N seeds (default: %(default)s)")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md and README.md as they are")


def rows_of(path):
    return [[float(value) for value in line.split()] for line in path.read_text().splitlines() if line and line[0] != "#"]


def team_file(folder, out):
    """All robots' frames as one trajectory for one alignment: where two robots have the same stamp, the later one's is moved by 10 us."""
    taken, rows = set(), []
    for path in sorted(folder.glob("trajectories/*.tum")):
        for row in rows_of(path):
            while round(row[0] * 1e6) in taken:
                row[0] += 1e-5
            taken.add(round(row[0] * 1e6))
            rows.append(row)
    out.write_text("".join(f"{row[0]:.6f} " + " ".join(f"{value:.6f}" for value in row[1:]) + "\n" for row in sorted(rows)))
    return out


def error_of(trajectory, truth):
    _, text = common.mapweave("evaluate", "trajectory", "--estimate", trajectory, "--reference", truth, "--align", "se3", "--json")
    return json.loads(text)["ate_translation_rmse_m"]


def measure(name, seeds):
    source, out = common.DATA / "visual" / name, common.OUT / "team-visual" / name
    truth = source / "groundtruth.txt"
    out.mkdir(parents=True, exist_ok=True)
    common.mapweave("split", source, "--robots", 2, "--overlap", SEQUENCES[name]["overlap_s"], "--out", out / "logs", "--force")
    single, team, witnesses, seconds, joined = [], [], [], [], True
    for seed in range(1, seeds + 1):
        common.mapweave("slam", source, "--seed", seed, "--out", out / "single", "--force")
        single.append(error_of(out / "single/trajectory.tum", truth))
        # An edge each, which judge nothing for the cloud: else it would remember what was judged, and no time for matching be seen.
        common.mapweave("run", out / "logs/run.yaml", "--set", "edges=[{id: north}, {id: south}]", "--set", "cloud.edges_judge=false",
                        "--seed", seed, "--out", out / "run", "--force")
        verdicts = [v for v in json.loads((out / "run/merges.json").read_text()) if v["tier"] == "cloud"]
        summary = json.loads((out / "run/summary.json").read_text())
        joined = joined and bool(verdicts) and all(v["accepted"] for v in verdicts) and summary["team"]["components"] == 1
        witnesses.append(sum(len(v["witnesses"]) for v in verdicts))
        team.append(error_of(team_file(sorted((out / "run").glob("team*"))[0], out / "team.tum"), truth))
        stages = summary["stages"]
        seconds.append([sum(s["seconds"] for s in stages if s["tier"] == "cloud" and s["name"] == stage)
                        for stage in ("pairwise matching", "transform optimisation")])
    return {"name": name, "robots": 2, "joined": joined, "single_m": single, "team_m": team, "witnesses": statistics.median(witnesses),
            "match_s": statistics.median(s[0] for s in seconds), "optimise_s": statistics.median(s[1] for s in seconds)}


def measure_rig(name):
    rig = RIGS[name]
    world = common.OUT / "team-visual/worlds" / f"{rig['cameras'].count('kind')}-single-{rig['length_m']}-m"
    if not (world / "run.yaml").exists():
        robot = f"robots=[{{id: alpha, first_room: 0, last_room: 4, length_m: {rig['length_m']}}}]"
        common.mapweave("simulate", common.ROOT / "configs/worlds/camera_apartment.yaml", "--set", f"cameras={rig['cameras']}", "--set", robot,
                        "--set", "edges=1", "--out", world, "--force")

    def mapped(out, *settings):
        out = common.OUT / "team-visual" / out
        common.mapweave("slam", world / "alpha.rawlog", "--sensor", rig["sensor"], *settings, "--out", out, "--force")
        frames = len(rows_of(out / "trajectory.tum"))
        return json.loads((out / "summary.json").read_text())["robots"][0], frames, error_of(out / "trajectory.tum", world / "alpha.truth.tum")

    robot, frames, error_m = mapped("rig")
    alone = [mapped("alone", "--set", f"visual.label={camera['label']}") for camera in robot["cameras"]]
    return {"name": name, "alone_frames": [one[1] for one in alone], "alone_m": [one[2] for one in alone], "frames": frames, "both_m": error_m,
            "rig": robot.get("rig", {})}


def rig_cells(row):
    rig = row["rig"]
    if not rig:   # the larger one's map alone
        return (row["name"], ", ".join(map(str, row["alone_frames"])), ", ".join(f"{error:.4f}" for error in row["alone_m"]), "-", "-",
                f"{1.1 * min(row['alone_m']):.4f}", 0, "not merged")
    error = f"{rig['apart_before_m']:.4f} -> {rig['apart_after_m']:.4f}"
    constraints = rig.get("extrinsic_constraints", rig.get("ties", 0))   # earlier programs: ties
    return (row["name"], ", ".join(map(str, row["alone_frames"])), ", ".join(f"{error:.4f}" for error in row["alone_m"]), row["frames"],
            f"{row['both_m']:.4f}", f"{1.1 * min(row['alone_m']):.4f}", constraints, error)


def one_after_the_other(paths, out):
    """Trajectories of robots that drove at the same time, as one for one alignment."""
    later_s = 1e5
    out.write_text("".join(f"{row[0] + later_s * i:.6f} " + " ".join(f"{value:.6f}" for value in row[1:]) + "\n"
                           for i, path in enumerate(paths) for row in rows_of(path)))
    return out


def measure_pictures(name):
    scene, out = PICTURES[name], common.OUT / "team-visual" / "pictures"
    world = common.OUT / "team-visual/worlds" / f"{scene['pictures_per_s']}-pictures-{scene['length_m']}-m"
    routes = {"alpha": "first_room: 0, last_room: 4", "beta": "first_room: 2, last_room: 6", "gamma": "first_room: 4, order: back"}
    if not (world / "run.yaml").exists():
        robots = ", ".join(f"{{id: {robot}, {rooms}, length_m: {scene['length_m']}}}" for robot, rooms in routes.items())
        common.mapweave("simulate", common.ROOT / "configs/worlds/camera_apartment.yaml", "--set", f"cameras.0.frames_per_second={scene['pictures_per_s']}",
                        "--set", f"robots=[{robots}]", "--set", "edges=1", "--out", world, "--force")
    common.mapweave("run", world / "run.yaml", "--set", "sensor=rgbd", "--set", "server.share=view", "--out", out, "--force")
    summary = json.loads((out / "summary.json").read_text())
    truths = {robot: world / f"{robot}.truth.tum" for robot in routes}
    alone = [error_of(out / "robots" / robot / "trajectory.tum", truths[robot]) for robot in routes]
    seconds = {line["id"]: line["log_seconds"] for line in summary["timeline"]["robots"]}
    sent, received = ([sum(camera[what] for camera in robot["cameras"]) / seconds[robot["id"]] / 1e3 for robot in summary["robots"]]
                   for what in ("sent_bytes", "heard_bytes"))
    team = [out / "team/trajectories" / f"{robot}.tum" for robot in routes]
    joined = [robot for robot, path in zip(routes, team) if path.exists()]
    team_m = error_of(one_after_the_other([path for path in team if path.exists()], out / "team.tum"),
                      one_after_the_other([truths[robot] for robot in joined], out / "truth.tum"))
    return {"name": name, "title": scene["title"], "robots": len(routes), "maps": sum(len(team) for team in summary["team"]["members"]), "components": summary["team"]["components"],
            "falsely_joined": int(team_m > 0.5), "alone_m": math.sqrt(statistics.mean(error * error for error in alone)), "team_m": team_m,
            "up_kb_per_s": statistics.mean(sent), "down_kb_per_s": statistics.mean(received)}


def measure_team(name):
    program = common.need(common.PROGRAM.with_name("team_benchmark"), "run scripts/build release team_benchmark first")
    done = subprocess.run([program, name], stdout=subprocess.PIPE, text=True, check=True)
    return {**json.loads(done.stdout), "name": name, "title": json.loads(done.stdout)["name"]}


def is_joined(row):
    """Whether the team of the row has one map."""
    if "seeds" in row:
        return row["falsely_joined"] == 0
    if "components" in row:
        return row["components"] == 1 and row["falsely_joined"] == 0
    return row["joined"] if "joined" in row else bool(row["rig"])


def team_cells(row):
    if "seeds" in row:  # where to join is wrong; a corridor that both drove is right
        return row["title"], row["robots"], 2 * row["seeds"], 2 * row["seeds"] - row["rightly_joined"] - row["falsely_joined"], row["falsely_joined"], "", "", "", "", ""
    goal_m = 1.1 * row["alone_m"]
    wire = (f"{row['up_kb_per_s']:.0f}", f"{row['down_kb_per_s']:.1f}") if "up_kb_per_s" in row else ("", "")
    team = f"{row['team_m']:.4f}" if is_joined(row) else "-"
    return (row["title"], row["robots"], row["maps"], row["components"], row["falsely_joined"], f"{row['alone_m']:.4f}", team, f"{goal_m:.4f}", *wire)


# CORB-SLAM, table 1, KITTI 00: how many, and milliseconds each (transfer; ours: encoding and decoding, of a processor).
CORB_SLAM = {"full keyframes": (937, 104.7), "full landmarks": (499681, 0.028), "light keyframes": (1083, 2.37), "light landmarks": (139418, 0.043)}


def published_text(row):
    """What went over the wire for keyframes and landmarks, in full and after (CORB-SLAM, table 1)."""
    published = row["published"]
    each = {what: (some["count"], some["bytes"] / max(1, some["count"]), 1e3 * some["seconds"] / max(1, some["count"])) for what, some in published.items()}
    text = f"\n\nWhat was published in {row['title']} (times: encoding and decoding, of a processor; CORB-SLAM's: transfer, KITTI 00):\n\n"
    text += common.table(("what", "number", "bytes each", "ms each", "CORB-SLAM: number", "ms each"),
                         [(what, count, f"{size:.0f}", f"{ms:.4f}", CORB_SLAM[what][0], CORB_SLAM[what][1]) for what, (count, size, ms) in each.items()])
    full, light = each["full keyframes"], each["light keyframes"]
    return text + (f"\n\nA light keyframe is 1/{full[1] / light[1]:.0f} of a full one in bytes, and takes 1/{full[2] / light[2]:.0f} of its time (CORB-SLAM: 1/45 of its time). The robots closed "
                   f"{row['loops_alone']} loops of their own.")


def cells(row):
    if not row["joined"]:
        single = statistics.median(row["single_m"])
        return row["name"], row["robots"], "no", f"{single:.4f}", "-", f"{1.1 * single:.4f}", math.floor(row["witnesses"]), "-"
    single = statistics.median(row["single_m"])
    return (row["name"], row["robots"], "yes" if row["joined"] else "no", f"{single:.4f}",
            f"{statistics.median(row['team_m']):.4f} ({min(row['team_m']):.4f} to {max(row['team_m']):.4f})", f"{1.1 * single:.4f}",
            math.floor(row["witnesses"]), f"{row['match_s']:.2f} + {row['optimise_s']:.2f}")


def run(arguments):
    chosen = [name.strip() for name in arguments.sequences.split(",") if name.strip()]
    for name in chosen:
        if name not in NAMES:
            common.give_up(f"unknown sequence '{name}'; known: {', '.join(NAMES)}", 2)
    common.need(common.PROGRAM, "run scripts/build first")
    for name in chosen:
        if name in SEQUENCES:
            common.need(common.DATA / "visual" / name, "set MAPWEAVE_DATA to the folder that holds visual/")
    measured = []
    for name in chosen:
        measured.append(measure(name, arguments.seeds) if name in SEQUENCES else measure_rig(name) if name in RIGS else
                        measure_pictures(name) if name in PICTURES else measure_team(name))
        common.write_json("team-visual", {"machine": common.machine(), "commit": common.commit(), "rows": measured})

    def write_table(tag, headers, names, cells_of, note):
        fresh = [row for row in measured if row["name"] in names]
        if not fresh:
            return
        rows = {**common.results_rows(tag, headers), **{cells_of(row)[0]: cells_of(row) for row in fresh}}
        text = common.table(headers, rows.values()) + f"\n\nMeasured by `scripts/bench team-visual` on {common.machine()}" + note
        print(text)
        if not arguments.dry_run:
            common.write_results(tag, text)

    write_table("team-visual", HEADERS, SEQUENCES, cells, ": each sequence cut into two robots that share some seconds, on an edge each. One alignment for the whole team; goal: "
         f"1.1 times the single run's error. Median of {arguments.seeds} seeds; wall times.")
    write_table("rigs", RIG_HEADERS, RIGS, rig_cells, ", in simulated apartments. Each alone: the largest of its maps; both: one map of both, and the robot's trajectory from both. Goal: "
         "1.1 times the better one's error. Error of the extrinsic constraints: root mean square before and after the graph is solved.")
    write_table("teams", TEAM_HEADERS, (*PICTURES, *TEAMS), team_cells, ": simulated robots with their camera map server; where nothing else is said, cameras hand over features, 12 "
         "frames/s. Wrongly: off by more than 0.5 m. "
         "Alone: root mean square of robots laid on the truth one by one, in apartments where nobody sends them anything; goal: 1.1 times that. Goals of bytes: 150 kB/s up, 50 down. Published, with other data: 500 up, 100 down "
         "(CVS, 30 frames/s), 370 up, 520 down (CCM-SLAM, as CVS quotes it)." +
         ("".join(published_text(row) for row in measured if row["name"] == "apartment-3") or common.results_text("teams", r"\n\nWhat was published in (.|\n)*of their own\.")))
    return common.unmet("not one map, or joined falsely", [row["name"] for row in measured if not is_joined(row)])
