"""CORB-SLAM's experiments on a simulated drive: 900 keyframes cut for 2 and 3 clients that drive at the same time (figures 4 to 6, tables 1 and 2)

Needs the program and team_benchmark (scripts/build; scripts/build release team_benchmark). KITTI is not at hand: one robot with a depth camera drives around a corridor that closes on itself,
and a little on. Its frames are cut into 2 and 3 clients that share --overlap seconds, and that all begin at the same time, as in the paper; they share through one camera map server. Writes the tables between
<!-- bench:corb --> and <!-- /bench --> of datasets/RESULTS.md, out/bench/corb.json, and pictures beside it (corb-fig4-*.png, corb-fig5.png, corb-fig6.png). A team that is not one map of all clients, a client that
received nothing from the server, a joint map whose error is larger than the largest of the clients' own maps, and a drive of fewer keyframes than it should have end with exit code 5. Takes ten minutes; --quick two (a short drive).
"""
import json
import math
import shutil
import subprocess

from benches import common, plots, report, team_visual

CLIENTS = (2, 3)
NAMES = ("alpha", "beta", "gamma")
DRIVES = {   # ring, metres, seconds that neighbours share, least keyframes of one client alone, frames of a camera that hands over features
    "whole": {"ring": "{width_m: 42, height_m: 32, corridor_width_m: 2.4, doors: 28, clutter: 34}", "length_m": 158, "overlap_s": 12, "keyframes": 800, "cut": 150},
    "quick": {"ring": "{width_m: 13, height_m: 10, corridor_width_m: 2.4, doors: 8, clutter: 6}", "length_m": 42, "overlap_s": 8, "keyframes": 150, "cut": 40},
}
ROOM = ["--set", "visual.memory.keyframes=5000"]
QUIET = ["--set", "output.report=false", "--set", "output.pcd=false"]
# Table 2, sequence 05 (456 keyframes in the map), and table 1: counts, seconds.
TABLE_2 = {"keyframes": 456, "merging_s": 2.835, "bundle_s": 4.535}
PAPERS = {"Seq. 00 (2 clients)": {"full keyframes": (937, 98.15), "full landmarks": (499681, 14.02), "light keyframes": (1083, 2.570), "light landmarks": (139418, 6.045)},
          "Seq. 05 (3 clients)": {"full keyframes": (818, 89.97), "full landmarks": (429938, 12.10), "light keyframes": (1375, 2.889), "light landmarks": (156466, 7.969)}}
KINDS = ("full keyframes", "full landmarks", "light keyframes", "light landmarks")


def add_arguments(parser):
    parser.add_argument("--quick", action="store_true", help="a short drive, to try it out; leaves RESULTS.md as it is")
    parser.add_argument("--share", default="view", metavar="WHAT", help="server.share of the clients (default: %(default)s)")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md as it is")


def world_text(drive):
    return f"""seed: 3
buildings:
  - {{kind: ring, seed: 3, furniture: {{round: 0.3}}, ring: {drive['ring']}}}
look: {{posters_per_10_m: 4}}
cameras:
  - {{id: camera, kind: rgbd, width: 480, height: 360, fx: 394, fy: 394, frames_per_second: 15}}
motion: {{speed_min_m_per_s: 0.6, speed_max_m_per_s: 0.9, turn_rate_deg_per_s: 30}}
logs: {{layout: folders, pictures: jpeg, scans: false}}
robots:
  - {{id: drive, laps: 2, length_m: {drive['length_m']}}}
"""


def simulated(home, drive):
    folder, text = home / "drive/drive_camera", world_text(drive)
    if not folder.exists() or not (home / "world.yaml").exists() or (home / "world.yaml").read_text() != text:
        home.mkdir(parents=True, exist_ok=True)
        (home / "world.yaml").write_text(text)
        common.mapweave("simulate", home / "world.yaml", "--out", home / "drive", "--force")
    return folder


def rows_of(path):
    return [line.split() for line in path.read_text().splitlines() if line and line[0] != "#"]


def cut(drive, folder, clients, overlap_s):
    """Folders of clients that all begin when the drive began: [0, t/n + d], [t/n - d, 2t/n + d], ... of it. Returns the configuration."""
    shutil.rmtree(folder, ignore_errors=True)
    pairs, truth = rows_of(drive / "associations.txt"), rows_of(drive / "groundtruth.txt")
    begin, end = float(pairs[0][0]), float(pairs[-1][0])
    for i in range(clients):
        first, last = (begin + (end - begin) * share / clients for share in (i, i + 1))
        first, last = max(begin, first - overlap_s / 2), min(end, last + overlap_s / 2)
        earlier = next(float(row[0]) for row in pairs if float(row[0]) >= first) - begin
        part = folder / NAMES[i]
        part.mkdir(parents=True)
        for name in ("rgb", "depth", "camera.yaml"):
            (part / name).symlink_to((drive / name).resolve())

        def moved(rows, stamps):
            return [[f"{float(word) - earlier:.6f}" if k in stamps else word for k, word in enumerate(row)] for row in rows if first <= float(row[0]) <= last]
        kept = moved(pairs, (0, 2))
        for name, rows in (("associations.txt", kept), ("rgb.txt", [row[:2] for row in kept]), ("depth.txt", [row[2:] for row in kept]), ("groundtruth.txt", moved(truth, (0,)))):
            (part / name).write_text("".join(" ".join(row) + "\n" for row in rows))
    config = folder / "team.yaml"
    config.write_text("robots:\n" + "".join(f"  - {{id: {name}, log: {name}}}\n" for name in NAMES[:clients]) + "edges: [{id: server}]\n")
    return config


def stage_s(summary, words):
    """Of the camera map server, whose judgements the cloud takes over."""
    return sum(stage["seconds"] for stage in summary["stages"] if stage["tier"] == "server" and any(word in stage["name"] for word in words))


def counts_of(store):
    """Keyframes and landmarks of a map."""
    [found] = json.loads(common.mapweave("inspect", store, "--json")[1])["maps"]
    return found["keyframes"], found["landmarks"]


def measured(home, drive, clients, overlap_s, share):
    config = cut(drive, home / f"cut-{clients}", clients, overlap_s)
    out = home / f"run-{clients}"
    common.mapweave("run", config, "--out", out, "--force", *QUIET, *ROOM, "--set", "sensor=rgbd", "--set", f"server.share={share}")
    summary = json.loads((out / "summary.json").read_text())
    names = NAMES[:clients]
    cameras = {robot["id"]: robot["cameras"][0] for robot in summary["robots"]}
    truths = [home / f"cut-{clients}" / name / "groundtruth.txt" for name in names]
    row = {"clients": clients, "components": summary["team"]["components"], "members": summary["team"]["members"], "lost": sum(camera["lost"] for camera in cameras.values()),
           "frames": sum(camera["frames"] for camera in cameras.values()), "received": [cameras[name]["heard_bytes"] for name in names], "sent": [cameras[name]["sent_bytes"] for name in names],
           "borrowed": [cameras[name]["borrowed_landmarks"] for name in names],
           "keyframes": [cameras[name]["keyframes"] for name in names], "landmarks": [cameras[name]["landmarks"] for name in names],
           "alone_m": [team_visual.error_of(out / "robots" / name / "trajectory.tum", truth) for name, truth in zip(names, truths)],
           "first_share_s": [first_share(cameras[name]) for name in names], "wall_s": summary["wall_seconds"], "stages": summary["stages"]}
    if not is_joined(row):
        return row
    [team] = sorted(out.glob("team*"))[:1]
    row["fused_keyframes"], row["fused_landmarks"] = counts_of(team / "map.mwdb")
    row["matching_s"], row["optimising_s"] = stage_s(summary, ("match",)), stage_s(summary, ("optimi",))
    estimates = [team / "trajectories" / f"{name}.tum" for name in names]
    row["team_m"] = team_visual.error_of(team_visual.one_after_the_other(estimates, home / "team.tum"), team_visual.one_after_the_other(truths, home / "truth.tum"))
    return row


def first_share(camera):
    """Second of data in which the server first sent more than an empty answer: from then on the client goes on with others' landmarks."""
    return next((second for second, _, received in camera.get("traffic", []) if received > 1000), None)


def is_joined(row):
    return row["components"] == 1 and len(row["members"][0]) >= row["clients"]


def published(clients, cut_m):
    """Table 1, of a drive whose camera hands over features (team_benchmark): what was published, once in full and then what changed."""
    program = common.need(common.PROGRAM.with_name("team_benchmark"), "run scripts/build release team_benchmark first")
    done = subprocess.run([program, f"cut-{clients}@{cut_m}"], stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout)


# Figures 4 to 6

def points(path, until_s=math.inf):
    rows = [[float(word) for word in row] for row in rows_of(path)]
    return [(row[1], row[2]) for row in rows if row[0] - rows[0][0] <= until_s]


def flat(moved, fixed):
    """Transform of the plane that lays one list of points on another of the same length (least squares)."""
    n = len(moved)
    centre = [(sum(p[k] for p in some) / n) for some in (moved, fixed) for k in (0, 1)]
    sine = sum((a[0] - centre[0]) * (b[1] - centre[3]) - (a[1] - centre[1]) * (b[0] - centre[2]) for a, b in zip(moved, fixed))
    cosine = sum((a[0] - centre[0]) * (b[0] - centre[2]) + (a[1] - centre[1]) * (b[1] - centre[3]) for a, b in zip(moved, fixed))
    c, s = math.cos(math.atan2(sine, cosine)), math.sin(math.atan2(sine, cosine))
    return lambda p: (centre[2] + c * (p[0] - centre[0]) - s * (p[1] - centre[1]), centre[3] + s * (p[0] - centre[0]) + c * (p[1] - centre[1]))


def stamped(path):
    return {f"{float(row[0]):.3f}": (float(row[1]), float(row[2])) for row in rows_of(path)}


def laid(estimates, truths):
    """Trajectories of the plane, all by one transform on the truth."""
    moved, fixed = [], []
    for estimate, truth in zip(estimates, truths):
        there = stamped(truth)
        for stamp, point in stamped(estimate).items():
            if stamp in there:
                moved.append(point)
                fixed.append(there[stamp])
    onto = flat(moved, fixed)
    return [[onto(point) for point in points(path)] for path in estimates]


def draw(home, row):
    """Fig. 4 (two clients: apart at the beginning, when they first share, at the end), fig. 5 (where both were, from near), fig. 6 (three clients)."""
    clients = row["clients"]
    names, folder = NAMES[:clients], home / f"cut-{clients}"
    truths, out = [folder / name / "groundtruth.txt" for name in names], home / f"run-{clients}"
    [team] = sorted(out.glob("team*"))[:1]
    whole = laid([team / "trajectories" / f"{name}.tum" for name in names], truths)
    drive = points(home / "drive/drive_camera/groundtruth.txt")
    if clients == 3:
        plots.paths(common.OUT / "corb-fig6.png", "three clients, one map (fig. 6)", {"truth": drive, **dict(zip(names, whole))})
        return
    shared = [second for second in row["first_share_s"] if second is not None]
    moments = [("a", 10.0, "after 10 s: two maps"), ("c", math.inf, "at the end: one map")]
    if shared:
        moments.append(("b", float(min(shared)), f"after {min(shared)} s: the server shares"))
    for letter, until_s, words in moments:
        alone = {}
        for name, truth, estimate in zip(names, truths, whole):
            count = len(points(truth, until_s)) * len(estimate) // len(points(truth))
            alone[name] = estimate[:max(2, count)]
        plots.paths(common.OUT / f"corb-fig4-{letter}.png", f"{words} (fig. 4 {letter})", {"truth": drive, **alone})
    # From near: the last metres of beta, where alpha began.
    x, y = whole[0][0]
    near = {name: [p for p in path if math.dist(p, (x, y)) < 6.0] for name, path in (("truth", drive), *zip(names, whole))}
    plots.paths(common.OUT / "corb-fig5.png", "where beta comes to the beginning of alpha (fig. 5 b)", {name: path for name, path in near.items() if path})


def problems(row, drive):
    name = f"{row['clients']} clients"
    if not is_joined(row):
        return [f"{name}: {row['components']} maps, one was expected"]
    found = [f"{name}: {who} received nothing of others" for who, borrowed in zip(NAMES, row["borrowed"]) if borrowed == 0]
    if row["team_m"] > max(row["alone_m"]):
        found.append(f"{name}: the joint map's error is {row['team_m']:.4f} m, those of its clients' own maps are at most {max(row['alone_m']):.4f} m")
    if sum(row["keyframes"]) < drive["keyframes"]:
        found.append(f"{name}: {sum(row['keyframes'])} keyframes, at least {drive['keyframes']} were expected")
    return found


def results_text(rows, single, tables):
    def cell(row, what, form):
        return form.format(row[what]) if what in row else "-"
    text = common.table(("clients", "frames (lost)", "keyframes, each", "in the joint map", "landmarks, each", "after fusion", "shared from", "ATE, m, each", "joint map", "goal: largest of each, m", "matching + optimising, s"),
                        [("one, the whole drive", f"{single['frames']} ({single['lost']})", single["keyframes"], "", single["landmarks"], "", "", f"{single['error_m']:.4f}", "", "", ""),
                         *((row["clients"], f"{row['frames']} ({row['lost']})", " + ".join(map(str, row["keyframes"])), cell(row, "fused_keyframes", "{}"), " + ".join(map(str, row["landmarks"])),
                            cell(row, "fused_landmarks", "{}"), ", ".join("-" if second is None else f"{second} s" for second in row["first_share_s"]), ", ".join(f"{error:.4f}" for error in row["alone_m"]),
                            cell(row, "team_m", "{:.4f}"), f"{max(row['alone_m']):.4f}", f"{row['matching_s']:.2f} + {row['optimising_s']:.2f}" if is_joined(row) else "-") for row in rows)])
    text += "\n\nWhat clients published (table 1; seconds: encoding and decoding, of a processor; the paper's: transfer):\n\n"
    ours = [(f"{table['robots']} clients, features", [(table["published"][kind]["count"], table["published"][kind]["seconds"]) for kind in KINDS]) for table in tables]
    text += common.table(("drive", *(f"{kind}, number, s" for kind in KINDS)),
                         [(name, *(f"{count}, {seconds:.3f}" for count, seconds in cells)) for name, cells in ours + [(f"CORB-SLAM, {name}", [paper[kind] for kind in KINDS]) for name, paper in PAPERS.items()]])
    return text + (f"\n\nMeasured by `scripts/bench corb` on {common.machine()}: one depth camera, cut into clients that begin at the same time. Each: before fusion. Shared from: second of data in which the server first "
                   f"sent a client landmarks of another. CORB-SLAM, table 2: {TABLE_2['merging_s']} + {TABLE_2['bundle_s']} s for {TABLE_2['keyframes']} keyframes.")


def run(arguments):
    common.need(common.PROGRAM, "run scripts/build first")
    kind = "quick" if arguments.quick else "whole"
    drive, home = DRIVES[kind], common.OUT / "corb" / kind
    frames = simulated(home, drive)
    common.mapweave("slam", frames, "--out", home / "single", "--force", *QUIET, *ROOM)
    camera = json.loads((home / "single/summary.json").read_text())["robots"][0]["cameras"][0]
    single = {**{what: camera[what] for what in ("frames", "lost", "keyframes", "landmarks")}, "error_m": team_visual.error_of(home / "single/trajectory.tum", frames / "groundtruth.txt")}
    rows = [measured(home, frames, clients, drive["overlap_s"], arguments.share) for clients in CLIENTS]
    for row in rows:
        if is_joined(row):
            draw(home, row)
    tables = [published(clients, drive["cut"]) for clients in CLIENTS]
    text = results_text(rows, single, tables)
    common.write_json("corb", {"machine": common.machine(), "commit": common.commit(), "single": single, "rows": rows, "published": tables})
    report.write()
    print(text)
    if found := [problem for row in rows for problem in problems(row, drive)]:
        common.give_up("; ".join(found), 5)
    if not arguments.dry_run and not arguments.quick:
        common.write_results("corb", text)
    return 0
