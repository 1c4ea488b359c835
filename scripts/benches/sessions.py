"""CVS's table I and figure 5 on simulated drives: sessions of one flat, by day and by night, with and without a camera map server that knows the earlier ones

Needs the program (scripts/build). A robot with a depth camera drives through one flat in five sessions. From session to session, three of ten pieces of furniture are gone or others, and it is day, or night with
lamps (a twelfth of the light). Without the server each session is mapped alone; with it, session k begins with the maps of the sessions before (--map) and shares by server.share=view. Then three clients drive at the same time, as
in CVS's figure 5. Writes the tables between <!-- bench:sessions --> and <!-- /bench --> of datasets/RESULTS.md, out/bench/sessions.json and plots (PNG) and report.html beside it. A session that does not join those
before, one that receives nothing of them, more lost frames or a larger mean error with the server than without, and more bytes than the goals are named below the tables and end with exit code 5. Takes ten minutes; --quick three (two short sessions).
"""
import json
import statistics

from benches import common, plots, report, team_visual

DAY, NIGHT = "{}", "{level: 0.08, lamps: 0.6, lamp_spacing_m: 3}"
SESSIONS = (("day", DAY), ("day, moved furniture", DAY), ("night, moved furniture", NIGHT), ("day, moved furniture", DAY), ("night, moved furniture", NIGHT))
QUICK = (("day", DAY), ("night, moved furniture", NIGHT))
ORDERS = ("along", "back", "shuffled", "back", "along")
GOAL_ERROR = 1.1           # of the mean error of sessions alone
GOAL_TOGETHER_M = 0.05     # of all sessions by one alignment
GOAL_UP, GOAL_DOWN = 150.0, 50.0   # kB/s; CVS: 500 and 100
CLIENTS = ("alpha", "beta", "gamma")
# CVS, table I (OpenLORIS-Scene, market): metres of ATE.
TABLE_1 = {"OpenVSLAM, each alone": (2.53, 3.70, 2.21), "CVS": (2.51, 3.34, 2.45)}
QUIET = ["--set", "output.report=false", "--set", "output.pcd=false"]


def add_arguments(parser):
    parser.add_argument("--quick", action="store_true", help="two short sessions, to try it out; leaves RESULTS.md as it is")
    parser.add_argument("--seed", type=int, default=7, help="of the flat (default: %(default)s)")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md as it is")


def world_text(seed, session, light, robots, layout="folders"):
    """A session of the flat. Its own seed: of the noise and of what is random about the drive; the flat keeps its own. Folders hold pictures alone, rawlogs wheels too."""
    return f"""seed: {100 * seed + session}
buildings:
  - {{kind: apartment, seed: {seed}, furniture: {{round: 0.3, session: {session}, changed: 0.3}}, apartment: {{width_m: 10, height_m: 8}}}}
look: {{posters_per_10_m: 4}}
light: {light}
cameras:
  - {{id: camera, kind: rgbd, width: 480, height: 360, fx: 394, fy: 394, frames_per_second: 15}}
motion: {{speed_min_m_per_s: 0.3, speed_max_m_per_s: 0.7, turn_rate_deg_per_s: 40}}
logs: {{layout: {layout}, pictures: jpeg, scans: false}}
edges: 1
robots:
""" + "".join(f"  - {{{robot}}}\n" for robot in robots)


def simulated(folder, text):
    if not (folder / "logs").exists() or not (folder / "world.yaml").exists() or (folder / "world.yaml").read_text() != text:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "world.yaml").write_text(text)
        common.mapweave("simulate", folder / "world.yaml", "--out", folder / "logs", "--force")
    return folder / "logs"


def camera_of(out):
    [robot] = json.loads((out / "summary.json").read_text())["robots"]
    return robot["cameras"][0]


def frames_placed(path):
    return sum(1 for line in path.read_text().splitlines() if line and line[0] != "#")


def mapped(frames, out, *flags):
    """A session's frames, lost ones, and its error where it was placed."""
    common.mapweave("slam", frames, "--robot", "alpha", "--out", out, "--force", *QUIET, "--set", "sensor=rgbd", *flags)
    camera, trajectory = camera_of(out), out / "trajectory.tum"
    return {"frames": camera["frames"], "lost": camera["lost"], "placed": frames_placed(trajectory), "error_m": team_visual.error_of(trajectory, frames / "groundtruth.txt"),
            "keyframes": camera["keyframes"], "maps": camera["sessions"], "heard": camera["heard_bytes"], "borrowed": camera["borrowed_landmarks"]}


def measured(home, sessions, seed, length_m):
    rows, before = [], None
    for number, (title, light) in enumerate(sessions):
        robot = f"id: alpha, length_m: {length_m}, order: {ORDERS[number]}, start_s: {86400 * number}"
        frames = simulated(home / f"session-{number + 1}", world_text(seed, number, light, [robot])) / "alpha_camera"
        alone = mapped(frames, home / f"alone-{number + 1}")
        out = home / f"shared-{number + 1}"
        shared = mapped(frames, out, "--set", "server.share=view", *(("--map", before) if before else ()))
        summary = json.loads((out / "summary.json").read_text())
        together = max((members for members in summary.get("team", {}).get("members", [])), key=len, default=[])
        rows.append({"title": title, "alone": alone, "shared": shared, "together": len(together), "joined": not before or len(together) >= number + 1})
        before = out
    return rows


def all_sessions_m(home, count):
    """Of the robot's places in the last map, of all sessions by one alignment."""
    last = home / f"shared-{count}/trajectories"
    estimates = [last / f"alpha-{number}.tum" for number in range(1, count)] + [last / "robot/alpha.tum"]
    if not all(path.exists() for path in estimates):
        return None
    truths = [home / f"session-{number}/logs/alpha.truth.tum" for number in range(1, count + 1)]
    return team_visual.error_of(team_visual.one_after_the_other(estimates, home / "all.tum"), team_visual.one_after_the_other(truths, home / "truth.tum"))


def team(home, seed, length_m):
    """Three clients that drive at the same time: bytes of each second, both ways (figures 5a, 5b). With wheels: a camera alone follows another robot that fills its picture."""
    robots = [f"id: {name}, length_m: {length_m}, order: {order}" for name, order in zip(CLIENTS, ("along", "back", "shuffled"))]
    logs, out = simulated(home / "team", world_text(seed, 0, DAY, robots, "rawlog")), home / "team/run"
    common.mapweave("run", logs / "run.yaml", "--out", out, "--force", *QUIET, "--set", "sensor=rgbd", "--set", "server.share=view")
    summary = json.loads((out / "summary.json").read_text())
    clients = {}
    for robot in summary["robots"]:
        camera = robot["cameras"][0]
        clients[robot["id"]] = {"traffic": camera.get("traffic", []), "seconds": robot["log_seconds"], "sent": camera["sent_bytes"], "heard": camera["heard_bytes"],
                                "error_m": team_visual.error_of(out / "robots" / robot["id"] / "trajectory.optical.tum", logs / f"{robot['id']}.camera.truth.tum")}
    return {"components": summary["team"]["components"], "clients": clients}


def over_time(traffic, which, seconds, width_s):
    """kB/s, the mean of so many seconds."""
    sums = [0.0] * (int(seconds / width_s) + 1)
    for row in traffic:
        sums[min(len(sums) - 1, int(row[0] / width_s))] += row[which] / 1e3 / width_s
    return [(width_s * (i + 0.5), value) for i, value in enumerate(sums)]


def figures(found, width_s=2):
    drawn = []
    for letter, which, key, title in (("a", 1, "sent", "from each client to the server"), ("b", 2, "heard", "from the server to each client")):
        series = {name: over_time(client["traffic"], which, client["seconds"], width_s) for name, client in found["clients"].items()}
        for name, client in found["clients"].items():
            mean = client[key] / 1e3 / client["seconds"]
            series[f"{name}, mean"] = [(0.0, mean), (client["seconds"], mean)]
        drawn.append(plots.figure(f"sessions-fig5{letter}", f"{title} (CVS fig. 5{letter})", "s", "kB/s", series))
    return drawn


def problems(rows, found, all_m):
    some = [] if all_m is not None and all_m <= GOAL_TOGETHER_M else [f"all sessions by one alignment: {all_m} m; the goal is {GOAL_TOGETHER_M}"]
    some += [f"session {number + 1} joined {row['together'] - 1} of {number} before" for number, row in enumerate(rows) if not row["joined"]]
    some += [f"session {number + 1} borrowed nothing of those before" for number, row in enumerate(rows) if number > 0 and row["shared"]["borrowed"] == 0]
    lost = {kind: sum(row[kind]["lost"] for row in rows) for kind in ("alone", "shared")}
    if lost["shared"] > lost["alone"]:
        some.append(f"{lost['shared']} frames were lost with the server, {lost['alone']} without")
    error = {kind: statistics.mean(row[kind]["error_m"] for row in rows) for kind in ("alone", "shared")}
    if error["shared"] > GOAL_ERROR * error["alone"]:
        some.append(f"mean error {error['shared']:.4f} m with the server, {error['alone']:.4f} m without")
    if found["components"] != 1:
        some.append(f"three clients made {found['components']} maps")
    for name, client in found["clients"].items():
        if not client["traffic"] or client["heard"] == 0:
            some.append(f"{name} received nothing of the server")
        some += [f"{name} {verb} {client[key] / 1e3 / client['seconds']:.0f} kB/s; the goal is {goal:.0f}"
                 for key, verb, goal in (("sent", "sent", GOAL_UP), ("heard", "received", GOAL_DOWN)) if client[key] / 1e3 / client["seconds"] > goal]
    return some


def results_text(rows, found, all_m):
    def cells(number, row):
        alone, shared = row["alone"], row["shared"]
        return (number + 1, row["title"], alone["frames"], alone["lost"], shared["lost"], f"{alone['placed']} in {alone['maps']}", f"{shared['placed']} in {shared['maps']}",
                f"{alone['error_m']:.4f}", f"{shared['error_m']:.4f}", f"{row['together']} of {number + 1}", shared["borrowed"])
    text = common.table(("session", "light, furniture", "frames", "lost, alone", "with the server", "placed in the main map, of so many, alone", "with the server", "ATE, m, alone", "with the server",
                         "sessions in one map", "landmarks borrowed, at most"), [cells(number, row) for number, row in enumerate(rows)])
    means = [statistics.mean(row[kind]["error_m"] for row in rows) for kind in ("alone", "shared")]
    text += f"\n\nMean ATE: {means[0]:.4f} m alone, {means[1]:.4f} m with the server; {'-' if all_m is None else f'{all_m:.4f} m'} for all sessions in the last map by one alignment. CVS, table I: "
    text += "; ".join(f"{name} {', '.join(f'{error:.2f}' for error in errors)} m" for name, errors in TABLE_1.items()) + ".\n\n"
    text += common.table(("client", "up, kB/s, mean", "highest second", "down, kB/s, mean", "highest second", "ATE, m"),
                         [(name, f"{client['sent'] / 1e3 / client['seconds']:.0f}", f"{max((row[1] for row in client['traffic']), default=0) / 1e3:.0f}", f"{client['heard'] / 1e3 / client['seconds']:.1f}",
                           f"{max((row[2] for row in client['traffic']), default=0) / 1e3:.0f}", f"{client['error_m']:.4f}") for name, client in found["clients"].items()])
    return text + (f"\n\nMeasured by `scripts/bench sessions` on {common.machine()}: one simulated flat of 10 x 8 m, 15 pictures/s of 480 x 360 with depth. Lost: frames that were not placed once the first one was. ATE: of the frames in a session's "
                   "main map, each session by its own alignment. Second table: three clients with wheels at the same time. CVS (fig. 5, 30 pictures/s, other data): 500 kB/s up, 100 down.")


def run(arguments):
    common.need(common.PROGRAM, "run scripts/build first")
    sessions, length_m = (QUICK, 12) if arguments.quick else (SESSIONS, 40)
    home = common.OUT / "sessions" / ("quick" if arguments.quick else "whole")
    rows = measured(home, sessions, arguments.seed, length_m)
    found = team(home, arguments.seed, length_m)
    all_m, drawn = all_sessions_m(home, len(sessions)), figures(found)
    plots.draw(common.OUT, drawn)
    some = problems(rows, found, all_m)
    text = results_text(rows, found, all_m) + (f"\n\nMissed: {'; '.join(some)}." if some else "")
    common.write_json("sessions", {"machine": common.machine(), "commit": common.commit(), "rows": rows, "team": found, "all_m": all_m, "figures": drawn})
    report.write()
    print(text)
    if not arguments.dry_run and not arguments.quick:
        common.write_results("sessions", text)
    if some:
        common.give_up("; ".join(some), 5)
    return 0
