"""halmstad: grids of other makers (E5, HIH), pair by pair against hand-marked correspondences; and pairs that share nothing.

Pairs whose marks agree with each other within 25 pixels, without the floor plans. Right: the marks of the first grid come within 50 pixels (a metre), on
average, of where the marks' alignment has them, and the heading within 5 degrees. Strangers: every grid with the mirror image of every grid of its
site, grids of one site with those of the other, floor plans with what is not theirs.
"""
import csv
import math

from benches.team_bench import inputs, judging
from benches.team_bench.mirror_images import read_grey_png, write_grid
from benches.team_bench.program import Failed

WORST_PIXELS, RIGHT_PIXELS, RIGHT_DEG, GOAL = 25.0, 50.0, 5.0, 0.6
SITES = {"E5": 14, "HIH": 4}   # visits


def marked_pairs(site):
    with open(inputs.LASER / f"mapmerge_halmstad/{site}/pairwise_alignment.csv") as lines:
        for row in csv.DictReader(lines):
            if row["source"] < row["target"] and "layout" not in row["source"] + row["target"] and float(row["rms_residual_px"]) <= WORST_PIXELS:
                yield row


def marks(site, name):
    rows = [line.split(",") for line in (inputs.LASER / f"mapmerge_halmstad/{site}/keypoints/{name}.csv").read_text().split()]
    return [(float(x), float(y)) for x, y in rows]


def strangers():
    """Pairs (a, b, whether b is mirrored) that must stay apart."""
    names = {site: [f"{site}_{number:02d}" for number in range(1, visits + 1)] for site, visits in SITES.items()}
    for site, visits in names.items():
        yield from ((a, b, True) for i, a in enumerate(visits) for b in visits[i:])
        yield from ((f"{site}_layout", b, True) for b in [*visits, f"{site}_layout"])
    yield from ((a, b, False) for a in [*names["E5"], "E5_layout"] for b in [*names["HIH"], "HIH_layout"])


def off_by(site, row, pose, resolution_m):
    """Metres (mean over marks) and degrees between a transform and the marks' one."""
    scale, yaw = float(row["scale"]), math.radians(float(row["rotation_deg"]))
    offs = []
    for x, y in marks(site, row["source"]):
        true = (scale * (math.cos(yaw) * x - math.sin(yaw) * y) + float(row["tx_px"]), scale * (math.sin(yaw) * x + math.cos(yaw) * y) + float(row["ty_px"]))
        x, y = resolution_m * x, resolution_m * y
        placed = pose[0] + math.cos(pose[2]) * x - math.sin(pose[2]) * y, pose[1] + math.sin(pose[2]) * x + math.cos(pose[2]) * y
        offs.append(math.dist(placed, [resolution_m * value for value in true]))
    turn = pose[2] - yaw
    return judging.mean(offs), abs(math.degrees(math.atan2(math.sin(turn), math.cos(turn))))


def yaml_of(bench, name):
    folder = bench.scratch("halmstad")
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.yaml"
    path.write_text(f"image: {inputs.LASER}/mapmerge_halmstad/{name.split('_')[0]}/{name}.png\nresolution: {bench.arguments.halmstad_resolution}\norigin: [0, 0, 0]\n")
    return path


def measure_strangers(bench, item):
    a, b, mirrored = item
    maps = [yaml_of(bench, a), yaml_of(bench, b)]
    if mirrored:
        rows = read_grey_png(inputs.LASER / f"mapmerge_halmstad/{b.split('_')[0]}/{b}.png")
        maps[1] = write_grid(bench.scratch("halmstad"), f"{b}-mirror", rows[::-1], bench.arguments.halmstad_resolution)
    done, summary, merges = bench.merge(maps, bench.scratch(f"halmstad-{a}-{b}"))
    joined = summary["team"]["components"] < 2
    if joined:
        bench.picture(maps, f"halmstad-{a}-{maps[1].stem}")
    return {"a": a, "b": b, "mirrored": mirrored, "result": "joined" if joined else "apart", "reason": merges[0]["reason"], "probability": merges[0]["probability"],
            "cpu_s": done.cpu_s}


def run_strangers(bench):
    items, rows, failed = list(strangers())[:bench.arguments.halmstad_pairs or None], {}, 0
    for (a, b, mirrored), row in bench.side_by_side(lambda item: measure_strangers(bench, item), items):
        if isinstance(row, Failed):
            failed += 1
            print(f"halmstad: {a} {b}: {row}", flush=True)
            continue
        rows[f"{a} {b} {'mirrored' if mirrored else 'plain'}"] = row
        if row["result"] == "joined":
            print(f"halmstad: {a} {b}{' mirrored' if mirrored else ''}: JOINED ({row['probability']:.3f})", flush=True)
    kept = list(bench.keep("halmstad_strangers", rows).values())
    bench.table("halmstad", "Grids of other makers that share nothing", ("what", "pairs", "joined"),
                [(label, len(some), sum(row["result"] == "joined" for row in some)) for mirrored, label in ((True, "grid and mirror image"), (False, "grids of two sites"))
                 if (some := [row for row in kept if row["mirrored"] == mirrored])])
    joined = sum(row["result"] == "joined" for row in rows.values())
    bench.gate("halmstad", "strangers joined", f"{joined} of {len(rows)}", "0", joined == 0 and len(rows) > 0)
    bench.gate("halmstad", "strangers that failed", failed, "0", failed == 0)


def measure(bench, item):
    site, row = item
    resolution_m = bench.arguments.halmstad_resolution
    maps = [yaml_of(bench, row[end]) for end in ("source", "target")]
    done, _, merges = bench.merge(maps, bench.scratch(f"halmstad-{row['source']}-{row['target']}"))
    verdict = merges[0]
    place = verdict["b_from_a"]
    metres, degrees = off_by(site, row, (place["x"], place["y"], place["yaw"]), resolution_m) if place else (math.inf, math.inf)
    right = metres <= RIGHT_PIXELS * resolution_m and degrees <= RIGHT_DEG
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
    if not bench.arguments.halmstad_positives:
        run_strangers(bench)
