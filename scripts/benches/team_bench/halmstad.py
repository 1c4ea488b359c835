"""halmstad: grids of other makers (E5, HIH), pair by pair against hand-marked correspondences.

Pairs whose marks agree with each other within 25 pixels, without the floor plans. Right: the marks of the first grid come within a metre, on
average, of where the marks' alignment has them, and the heading within 5 degrees.
"""
import csv
import math

from benches.team_bench import inputs, judging
from benches.team_bench.mirror_images import GRID_RESOLUTION_M
from benches.team_bench.program import Failed

WORST_PIXELS, RIGHT_M, RIGHT_DEG, GOAL = 25.0, 1.0, 5.0, 0.6
SITES = ("E5", "HIH")


def marked_pairs(site):
    with open(inputs.LASER / f"mapmerge_halmstad/{site}/pairwise_alignment.csv") as lines:
        for row in csv.DictReader(lines):
            if row["source"] < row["target"] and "layout" not in row["source"] + row["target"] and float(row["rms_residual_px"]) <= WORST_PIXELS:
                yield row


def marks(site, name):
    rows = [line.split(",") for line in (inputs.LASER / f"mapmerge_halmstad/{site}/keypoints/{name}.csv").read_text().split()]
    return [(float(x), float(y)) for x, y in rows]


def off_by(site, row, pose):
    """Metres (mean over marks) and degrees between a transform and the marks' one."""
    scale, yaw = float(row["scale"]), math.radians(float(row["rotation_deg"]))
    offs = []
    for x, y in marks(site, row["source"]):
        true = (scale * (math.cos(yaw) * x - math.sin(yaw) * y) + float(row["tx_px"]), scale * (math.sin(yaw) * x + math.cos(yaw) * y) + float(row["ty_px"]))
        x, y = GRID_RESOLUTION_M * x, GRID_RESOLUTION_M * y
        placed = pose[0] + math.cos(pose[2]) * x - math.sin(pose[2]) * y, pose[1] + math.sin(pose[2]) * x + math.cos(pose[2]) * y
        offs.append(math.dist(placed, [GRID_RESOLUTION_M * value for value in true]))
    turn = pose[2] - yaw
    return judging.mean(offs), abs(math.degrees(math.atan2(math.sin(turn), math.cos(turn))))


def measure(bench, item):
    site, row = item
    folder = bench.scratch("halmstad")
    folder.mkdir(parents=True, exist_ok=True)
    maps = []
    for name in (row["source"], row["target"]):
        maps.append(folder / f"{name}.yaml")
        maps[-1].write_text(f"image: {inputs.LASER}/mapmerge_halmstad/{site}/{name}.png\nresolution: {GRID_RESOLUTION_M}\norigin: [0, 0, 0]\n")
    done, _, merges = bench.merge(maps, bench.scratch(f"halmstad-{row['source']}-{row['target']}"))
    verdict = merges[0]
    place = verdict["b_from_a"]
    metres, degrees = off_by(site, row, (place["x"], place["y"], place["yaw"]))
    right = metres <= RIGHT_M and degrees <= RIGHT_DEG
    result = ("right" if right else "wrong") if verdict["accepted"] else "apart"
    if result != "right":
        bench.picture(maps, f"halmstad-{row['source']}-{row['target']}")
    return {"site": site, "a": row["source"], "b": row["target"], "result": result, "best_is_right": right, "off_m": metres, "off_deg": degrees, "reason": verdict["reason"],
            "cpu_s": done.cpu_s}


def run(bench):
    items = [(site, row) for site in SITES for row in marked_pairs(site)][:bench.arguments.halmstad_pairs or None]
    rows, failed = {}, 0
    for (site, pair), row in bench.side_by_side(lambda item: measure(bench, item), items):
        if isinstance(row, Failed):
            failed += 1
            print(f"halmstad: {pair['source']} {pair['target']}: {row}", flush=True)
            continue
        rows[f"{row['a']} {row['b']}"] = row
        print(f"halmstad: {row['a']} {row['b']}: {row['result']} ({row['reason']}); best hypothesis off by {row['off_m']:.2f} m {row['off_deg']:.1f} deg", flush=True)
    kept = list(bench.keep("halmstad", rows).values())

    def line(site):
        some = [row for row in kept if row["site"] == site]
        return (site, len(some), *(sum(row["result"] == result for row in some) for result in ("right", "wrong", "apart")), sum(row["best_is_right"] for row in some))
    bench.table("halmstad", "Grids of other makers (Halmstad), pair by pair", ("site", "pairs", "right", "wrong", "apart", "best hypothesis right"),
                [line(site) for site in SITES if any(row["site"] == site for row in kept)])
    right, wrong = (sum(row["result"] == result for row in rows.values()) for result in ("right", "wrong"))
    bench.gate("halmstad", "pairs placed", f"{right} of {len(items)}", f"{100 * GOAL:g} %", bool(items) and right >= GOAL * len(items))
    bench.gate("halmstad", "pairs placed wrongly", wrong, "0", wrong == 0)
    bench.gate("halmstad", "runs that failed", failed, "0", failed == 0)
