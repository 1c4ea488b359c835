"""what single parts of it cost: pictures, places, bundles and graphs, an hour of driving; place recognition on public pictures

Needs the benchmark programs (scripts/build release all) and, for place recognition, visual/ below MAPWEAVE_DATA (default ../shared/data).
Processor time, so that a busy machine disturbs little. Writes the table between <!-- bench:parts --> and <!-- /bench --> of datasets/RESULTS.md, and
out/bench/parts.json. Takes some twenty minutes, most of them the hours of driving. A partial run (--parts) keeps the other rows as they were measured before.
"""
import pathlib
import re
import subprocess

from benches import common

HEADERS = ("part", "measured", "goal", "by")


def output_of(program, *arguments):
    path = common.need(common.PROGRAM.parent / program, f"run scripts/build release {program} first")
    run = subprocess.run([path, *map(str, arguments)], capture_output=True, text=True)
    if run.returncode != 0:
        common.give_up(f"{program} failed: {run.stderr.strip()}")
    return run.stdout


def found(pattern, text):
    match = re.search(pattern, text)
    if not match:
        common.give_up(f"no '{pattern}' in what was printed:\n{text}")
    return match.groups()


def seconds_of_solved(program):
    """Processor time of a solution, which must be one: the error at least halved."""
    text = output_of(program)
    seconds, before, after = found(r"([\d.]+) s of processor time, \d+ iterations, error ([\d.]+) -> ([\d.]+) m", text)
    if not float(after) <= 0.5 * float(before):
        common.give_up(f"{program}: the error did not become less; there is no time of a solution:\n{text}", 5)
    return seconds


def pictures():
    milliseconds, = found(r"colour RGB-D: .* on 2 thread\(s\) \(([\d.]+) ms of processor time", output_of("renderer_benchmark"))
    return f"{milliseconds} ms a picture", "100 ms (20 frames/s on 2 cores)"


def features():
    rate, = found(r"([\d.]+) frames/s of processor time", output_of("feature_sensor_benchmark"))
    return f"{rate} frames/s", "1000 frames/s"


def places():
    median, most = found(r"10000 keyframes: median ([\d.]+) ms, 99 % within ([\d.]+) ms", output_of("place_index_benchmark"))
    return f"{median} ms, 99 % within {most} ms", "3 ms"


def recognition():
    folders = [path.parent for path in sorted((common.DATA / "visual").glob("*/associations.txt"))]
    if not folders:
        common.give_up(f"there are no RGB-D folders below {common.DATA}/visual; set MAPWEAVE_DATA")
    text = output_of("place_recognition_benchmark", *folders)
    rows = re.findall(r"(\S+): \d+ pictures; (\d+) judgements believed, precision ([\d.]+); \d+ could be known again, recall ([\d.]+)", text)
    if not rows or any(count == "0" for _, count, _, _ in rows):
        common.give_up(f"place_recognition_benchmark: a sequence without a judgement that was believed; there is no precision:\n{text}", 5)
    return "; ".join(f"{pathlib.Path(name).name}: precision {float(precision):.3f} of {count} judgements, recall {float(recall):.2f}"
                     for name, count, precision, recall in rows), "precision 1, recall 0.5"


def landmarks():
    text = output_of("landmark_index_benchmark")
    rows = re.findall(r"^\s+(\d+)\s+1\.0\s+\d+\s+([\d.]+)\s+([\d.]+)", text, re.MULTILINE)
    return "; ".join(f"{side} m: {float(mean):.2f} ms" for side, mean, _ in rows), "0.2 ms (CVS: 1.7)"


def bundle():
    return seconds_of_solved("bundle_benchmark") + " s", "1.5 s (CORB-SLAM: 4.5)"


def merge():
    text = output_of("visual_fuse_benchmark")
    keyframes, teams = found(r"^2 maps, (\d+) keyframes, \d+ landmarks -> (\d+) teams", text)
    if teams != "1":
        common.give_up("visual_fuse_benchmark: its maps were not joined; there is no time of a merge", 5)
    matching, = found(r"pairwise matching\s+([\d.]+) s", text)
    optimising, = found(r"transform optimisation\s+([\d.]+) s", text)
    seconds, = found(r"in all\s+[\d.]+ s, ([\d.]+) s of a processor", text)
    return (f"{float(seconds):.2f} s, {keyframes} of them (wall times: matching {float(matching):.2f}, optimising {float(optimising):.2f} s)",
            "0.5 s (CORB-SLAM: 2.84)")


def pose_graph():
    return seconds_of_solved("pose_graph_benchmark") + " s", "0.1 s (CVS: 1.12)"


def endurance():
    text = output_of("endurance_benchmark")
    rows = [line.split() for line in text.splitlines() if re.match(r"^\s+\d+\s", line)]
    early, late = rows[len(rows) // 6], rows[-1]
    error, = found(r"error ([\d.]+) m", text)
    return (f"minute {early[0]}: {early[1]} ms a frame, {early[4]} MB, {early[5]} keyframes; minute {late[0]}: {late[1]} ms, {late[4]} MB, "
            f"{late[5]} keyframes; error {error} m"), "flat"


def endurance_team():
    rows = [line.split() for line in output_of("endurance_benchmark", "team").splitlines() if re.match(r"^\s+\d+\s", line)]
    clients = [row for row in rows if row[1] != "server"]
    servers = [row for row in rows if row[1] == "server"]

    def held(minute):
        return " and ".join(row[3] for row in sorted(clients, key=lambda row: row[1]) if row[0] == minute)

    early, late = servers[len(servers) // 6], servers[-1]
    return (f"minute {early[0]}: the clients hold {held(early[0])} MB, the server {early[2]} MB of {early[4]} keyframes; minute {late[0]}: "
            f"{held(late[0])} MB, the server {late[2]} MB of {late[4]}"), "flat"


PARTS = {
    "pictures": ("simulated colour and depth, 640 x 480", pictures, "renderer_benchmark"),
    "features": ("simulated features instead of pictures", features, "feature_sensor_benchmark"),
    "places": ("a place looked for among 10,000 keyframes", places, "place_index_benchmark"),
    "recognition": ("places known again in public pictures, each as a single keyframe", recognition, "place_recognition_benchmark"),
    "landmarks": ("landmarks in a camera's view, of 60,000 in halls of 25, 50 and 100 m", landmarks, "landmark_index_benchmark"),
    "bundle": ("bundle of 456 keyframes, 60,000 landmarks, 300,000 sightings", bundle, "bundle_benchmark"),
    "merge": ("merge of 456 keyframes, two robots' maps of an apartment", merge, "visual_fuse_benchmark"),
    "pose_graph": ("pose graph of 1000 keyframes", pose_graph, "pose_graph_benchmark"),
    "endurance": ("an hour of driving by features", endurance, "endurance_benchmark"),
    "endurance_team": ("the same by two clients with which a camera map server shares landmarks", endurance_team, "endurance_benchmark"),
}


def add_arguments(parser):
    parser.add_argument("--parts", default=",".join(PARTS), metavar="NAME,...", help="default: all of %(default)s")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md and README.md as they are")


def run(arguments):
    chosen = [name for name in arguments.parts.split(",") if name]
    for name in chosen:
        if name not in PARTS:
            common.give_up(f"unknown part '{name}'; known: {', '.join(PARTS)}", 2)
    rows = {}
    for name in chosen:
        what, measure, program = PARTS[name]
        rows[what] = (what, *measure(), f"`{program}`")
        common.write_json("parts", {"machine": common.machine(), "commit": common.commit(), "rows": rows})
    kept = common.results_rows("parts", HEADERS)
    text = common.table(HEADERS, [rows.get(what) or kept[what] for what, _, _ in PARTS.values() if what in rows or what in kept])
    text += f"\n\nMeasured by `scripts/bench parts` on {common.machine()}: processor time of one core."
    print(text)
    if not arguments.dry_run:
        common.write_results("parts", text)
    return 0
