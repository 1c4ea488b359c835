"""grids of another maker (Halmstad E5 and HIH): how many pairs are placed, rightly and wrongly, and what is joined that must not be

Needs grid_pair_benchmark (scripts/build release grid_pair_benchmark) and laser/mapmerge_halmstad of the public logs. Pairs count whose marked
correspondences fit a similarity within 25 pixels. A placement is right where it puts the middle of the marks that both
grids have within that residual (at least 10 pixels) of where the marks put it, and turns by 5 degrees less or more at most. Negatives: every grid with the mirror image
of every grid of its site, grids of one site with those of the other, layouts. Writes out/bench/halmstad.json. Takes ten minutes.
"""
import csv
import json
import math
import subprocess
import tempfile
import pathlib

from benches import common

PROGRAM = common.PROGRAM.parent / "grid_pair_benchmark"
GRIDS = common.DATA / "laser/mapmerge_halmstad"
WORST_RMS_PX = 25.0
LEAST_TOLERANCE_PX = 10.0
SHARED_PX = 50.0
TOLERANCE_DEG = 5.0


def add_arguments(parser):
    parser.add_argument("--resolution", type=float, default=0.05, metavar="M", help="metres per pixel, which the data set does not say (default: %(default)s)")
    parser.add_argument("--positives", action="store_true", help="leave the pairs that must not join out")


def alignments():
    """Usable marked alignments, one of both directions; layouts are plans, not maps."""
    rows = [row for site in ("E5", "HIH") for row in csv.DictReader((GRIDS / site / "pairwise_alignment.csv").open())]
    return [row for row in rows if row["source"] < row["target"] and "layout" not in row["target"] and float(row["rms_residual_px"]) <= WORST_RMS_PX]


def strangers():
    e5, hih = ([f"{site}_{number:02d}" for number in range(1, visits + 1)] for site, visits in (("E5", 14), ("HIH", 4)))
    mirrored = [(a, b, 1) for site in (e5, hih) for i, a in enumerate(site) for b in site[i:]]
    mirrored += [(layout, grid, 1) for layout, site in (("E5_layout", e5), ("HIH_layout", hih)) for grid in [*site, layout]]
    return mirrored + [(a, b, 0) for a in [*e5, "E5_layout"] for b in [*hih, "HIH_layout"]]


def aligned(pairs, resolution):
    """What the program says of pairs (a, b, whether b is flipped)."""
    with tempfile.TemporaryDirectory() as folder:
        def yaml(name):
            path = pathlib.Path(folder) / f"{name}.yaml"
            image = GRIDS / name.split("_")[0] / f"{name}.png"
            path.write_text(f"image: {image}\nresolution: {resolution}\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n")
            return path
        lines = "".join(f"{yaml(a)} {yaml(b)} {flipped}\n" for a, b, flipped in pairs)
        run = subprocess.run([PROGRAM], input=lines, stdout=subprocess.PIPE, text=True, check=False)
    if run.returncode != 0:
        common.give_up("grid_pair_benchmark failed", run.returncode)
    return [json.loads(line) for line in run.stdout.splitlines()]


def moved(scale, yaw, x, y, point):
    return (scale * (math.cos(yaw) * point[0] - math.sin(yaw) * point[1]) + x, scale * (math.sin(yaw) * point[0] + math.cos(yaw) * point[1]) + y)


def marks(name):
    return [tuple(float(value) for value in line.split(",")) for line in (GRIDS / name.split("_")[0] / f"keypoints/{name}.csv").read_text().split()]


def shared_middle(row, true):
    """The middle of the source's marks that the target has, too: each the other's nearest, within 50 pixels."""
    source, target = marks(row["source"]), marks(row["target"])
    placed = [moved(*true, mark) for mark in source]
    def nearest(point, points):
        return min(range(len(points)), key=lambda i: math.dist(point, points[i]))
    both = [i for i, point in enumerate(placed) for j in [nearest(point, target)] if math.dist(point, target[j]) < SHARED_PX and nearest(target[j], placed) == i]
    return [sum(source[i][axis] for i in both) / len(both) for axis in (0, 1)]


def off(row, found, resolution):
    """Pixels at the middle of the shared marks, degrees, and the tolerance in pixels."""
    true = (float(row["scale"]), math.radians(float(row["rotation_deg"])), float(row["tx_px"]), float(row["ty_px"]))
    middle = shared_middle(row, true)
    x, y, phi = found["pose"]
    here = moved(found["scale"], phi, x / resolution, y / resolution, middle)
    return math.dist(moved(*true, middle), here), abs(math.degrees(math.remainder(phi - true[1], 2 * math.pi))), max(LEAST_TOLERANCE_PX, float(row["rms_residual_px"]))


def judged(row, answer, resolution):
    if not answer["hypotheses"]:
        return {"right": False, "joined": False, "reason": answer["reason"]}
    pixels, degrees, tolerance = off(row, answer["hypotheses"][0], resolution)
    return {"right": pixels <= tolerance and degrees <= TOLERANCE_DEG, "joined": answer["joined"], "reason": answer["reason"], "off_px": pixels, "off_deg": degrees,
            "probability": answer["probability"]}


def run(arguments):
    common.need(PROGRAM, "run scripts/build release grid_pair_benchmark first")
    common.need(GRIDS, "set MAPWEAVE_DATA to the folder that has laser/mapmerge_halmstad")
    marked = alignments()
    answers = aligned([(row["target"], row["source"], 0) for row in marked], arguments.resolution)
    rows, result = [], {"resolution": arguments.resolution, "pairs": []}
    for site in ("E5", "HIH"):
        some = [{"a": row["target"], "b": row["source"], **judged(row, answer, arguments.resolution)} for row, answer in zip(marked, answers) if row["source"].startswith(site)]
        result["pairs"] += some
        placed, wrong = (sum(one["joined"] and one["right"] == right for one in some) for right in (True, False))
        rows.append((site, len(some), f"{placed} ({100 * placed / len(some):.0f} %)", wrong, len(some) - placed - wrong, sum(one["right"] for one in some)))
    text = common.table(("site", "pairs", "placed", "wrongly", "apart", "best hypothesis right"), rows)
    if not arguments.positives:
        foreign = aligned(strangers(), arguments.resolution)
        result["strangers"] = [{key: answer[key] for key in ("a", "b", "flipped", "joined", "probability", "reason")} for answer in foreign]
        text += f"\n\nOf {len(foreign)} pairs that share nothing or a mirror image, {sum(answer['joined'] for answer in foreign)} joined."
        answers += foreign
    seconds = sorted(answer["seconds"] for answer in answers)
    text += f"\n\nMeasured by `scripts/bench halmstad` on {common.machine()}: {seconds[len(seconds) // 2]:.2f} s of processor time a pair (median)."
    common.write_json("halmstad", {"machine": common.machine(), "commit": common.commit(), **result})
    print(text)
    return 0
