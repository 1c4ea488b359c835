"""strangers: maps that share nothing, many in one merge; no pair of strangers is joined.

A batch holds seeded stretches of every log and of its mirror image, and simulated offices, hotels (rooms that are alike, rooms that are mirrored),
halls with pillars, rings, corridors and warehouses with aisles, each of a seed of its own. Strangers are maps of different buildings, a log and its mirror image, and
stretches of one building that saw less than 1 % of each other's cells. Two robots of one simulated building, or of such stretches, that are
joined where the truth has them are no strangers that were joined; they are counted apart. Other pairs of one building do not count at all.
A pair counts when the program gives a verdict on it.
"""
import itertools
import json
import random
import time

from benches.team_bench import judging, placing, windows
from benches.team_bench.program import Failed

STRETCH_M = (10.0, 30.0)
SHARED = 0.01            # of the cells that the smaller one saw: below, two stretches share nothing
RIGHT_M, RIGHT_DEG = 1.0, 5.0
LOG_MAPS = 2             # stretches of each log and of each mirror image in a batch
BATCH = 120              # maps


def office(draw):
    return {"kind": "apartment", "apartment": {"width_m": draw.randint(20, 45), "height_m": draw.randint(14, 32), "furniture": draw.randint(0, 5)}}, 2


def hotel(draw):
    kind = draw.choice(("repeated_rooms", "mirrored_rooms"))
    return {"kind": kind, kind: {"rooms": draw.randint(6, 12), "room_width_m": draw.choice((3.5, 4.0, 4.5)), "furniture": draw.randint(1, 4), "clutter": draw.choice((0, 0, 6))}}, 2


def hall(draw):
    return {"kind": "hall", "hall": {"width_m": draw.randint(20, 50), "height_m": draw.randint(15, 30), "pillars": draw.randint(8, 60), "clutter": draw.randint(0, 20)}}, 1


def ring(draw):
    return {"kind": "ring", "ring": {"width_m": draw.randint(16, 50), "height_m": draw.randint(12, 30), "doors": draw.randint(4, 30), "clutter": draw.randint(2, 20)}}, 1


def corridor(draw):
    return {"kind": "corridor", "corridor": {"length_m": draw.randint(20, 80), "doors": draw.randint(4, 30), "clutter": draw.randint(2, 30)}}, 1


def warehouse(draw):
    """Of any size: empty ones of equal racks are the same building to a laser, whatever they are called."""
    size = {"aisles": 2 * draw.randint(3, 5), "length_m": round(draw.uniform(12.0, 30.0), 1), "aisle_m": round(draw.uniform(2.2, 3.2), 2), "pallets": draw.choice((0, 0, 20))}
    return {"kind": "warehouse", "warehouse": size}, 2


SITES = (office, hotel, hall, ring, corridor, warehouse)


class Stretch:
    """One map of a batch: `place` is what maps must share to be no strangers, `frame` in which the truth of its place is."""

    def __init__(self, path, place, truth, own, seen=None):
        self.path, self.name, self.place, self.fit, self.seen = path, path.stem, place, placing.fit(own, truth), seen


def site_maps(bench, seed):
    draw = random.Random(f"site {seed}")
    building, robots = SITES[seed % len(SITES)](draw)
    names = [f"s{seed}{'ab'[i]}" for i in range(robots)]
    plan = building.get(building["kind"], {})
    rooms = 2 * plan["aisles"] if "aisles" in plan else plan.get("rooms", 8)
    routes = [{}] if robots == 1 else [{"last_room": rooms // 2 - 1}, {"first_room": rooms // 2}]
    world = {"seed": seed, "buildings": [building], "robots": [{"id": name, "length_m": draw.randint(15, 30), **route} for name, route in zip(names, routes)]}
    kept = bench.store.folder / f"sites/{seed}"

    def write(folder):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "world.yaml").write_text(json.dumps(world))
        bench.program("simulate", folder / "world.yaml", "--out", folder / "world", "--force")
        for name in names:
            (kept / f"{name}.truth.tum").write_bytes((folder / f"world/{name}.truth.tum").read_bytes())
        return [folder / f"world/{name}.rawlog" for name in names]

    paths, _ = bench.store.made(f"sites/{seed}", names, write)
    return [Stretch(path, f"site {seed}", judging.Trajectory.read(kept / f"{path.stem}.truth.tum"), judging.Trajectory.read(path.with_suffix(".tum"))) for path in paths]


def log_maps(bench, log, batch, mirrored):
    draw, seen, found = random.Random(f"stretch {log} {batch} {mirrored}"), windows.seen(bench, log), []
    for i in range(LOG_MAPS):
        first, end = seen.draw(draw, *STRETCH_M)
        window = windows.Window(log, round(first, 3), round(end, 3), f"{log}-{batch}{'m' if mirrored else 'p'}{i}", mirrored)
        path, own = window.map(bench)
        truth = seen.truth if not mirrored else judging.Trajectory(seen.truth.stamps, [(x, -y, -yaw) for x, y, yaw in seen.truth.poses])
        found.append(Stretch(path, f"{log}{' mirrored' if mirrored else ''}", truth, own, seen.of(first, end)))
    return found


def share_nothing(a, b):
    """True, False, or None where only the truth can say (two robots of one simulated building)."""
    if a.place != b.place:
        return True
    return None if a.seen is None else windows.overlap(a.seen, b.seen) < SHARED


def is_right(verdict, a, b):
    first, second = (a, b) if verdict["a"] == a.name else (b, a)
    if first.fit is None or second.fit is None:
        return False
    place = verdict["b_from_a"]
    metres, degrees = placing.of_verdict((place["x"], place["y"], place["yaw"]), first.fit, second.fit)
    return metres <= RIGHT_M and degrees <= RIGHT_DEG


def judged(maps, merges):
    """Counts, and the strangers that were joined."""
    verdicts = {frozenset((verdict["a"], verdict["b"])): verdict for verdict in merges}
    count = {"beliefs": [], "strangers": 0, "of_one_building": 0, "joined": 0, "joined_rightly": 0, "without_verdict": 0}
    wrong = []
    for a, b in itertools.combinations(maps, 2):
        shares = share_nothing(a, b)
        if shares is False:
            continue
        verdict = verdicts.get(frozenset((a.name, b.name)))
        if verdict is None:
            count["without_verdict"] += 1
            continue
        if found := placing.belief(verdict, {a.name: a.fit, b.name: b.fit} if a.place == b.place else {}, RIGHT_M, RIGHT_DEG):
            count["beliefs"].append(found)
        right = verdict["accepted"] and a.place == b.place and is_right(verdict, a, b)
        if right:
            count["joined_rightly"] += 1
            continue
        count["strangers"] += 1
        count["of_one_building"] += a.place == b.place
        if verdict["accepted"]:
            count["joined"] += 1
            wrong.append((a, b, verdict))
    return count, wrong


def collect(bench, batch, most):
    """Maps of a batch: of logs and their mirror images first, then simulated sites."""
    maps = []
    for log, mirrored in itertools.product(bench.arguments.logs, (False, True)):
        try:
            maps += log_maps(bench, log, batch, mirrored)
        except Failed as failed:
            print(f"strangers: {log}: {failed}", flush=True)
    maps = maps[:most]
    seed = 1000 * (batch + 1)
    while len(maps) < most:
        maps += site_maps(bench, seed)
        seed += 1
    return maps


def measure(bench, batch, most):
    maps = collect(bench, batch, most)
    out = bench.scratch(f"strangers-{batch}")
    started = time.monotonic()
    done, summary, merges = bench.merge([one.path for one in maps], out, threads=bench.arguments.jobs)
    count, wrong = judged(maps, merges)
    for a, b, verdict in wrong[:20]:
        print(f"strangers: JOINED {a.name} + {b.name} ({a.place}; {b.place}), probability {verdict['probability']:.4f}, {len(verdict['witnesses'])} places", flush=True)
        bench.picture([a.path, b.path], f"strangers-{a.name}-{b.name}")
    pairs = len(maps) * (len(maps) - 1) // 2
    return {"batch": batch, "maps": len(maps), "pairs": pairs, **count, "joined_pairs": [[a.name, b.name] for a, b, _ in wrong], "components": summary["team"]["components"],
            "cpu_s": done.cpu_s, "wall_s": time.monotonic() - started, "peak_bytes": done.peak_bytes, "cpu_ms_per_pair": 1e3 * done.cpu_s / pairs}


def run(bench):
    wanted, batch, rows = bench.arguments.pairs, 0, {}
    while sum(row["strangers"] for row in rows.values()) < wanted and batch < 200:
        left = wanted - sum(row["strangers"] for row in rows.values())
        most = min(BATCH, max(4, int((2.2 * left) ** 0.5) + 2))
        row = measure(bench, batch, most)
        rows[f"{batch} {'+'.join(bench.arguments.logs)} {most}"] = row
        print(f"strangers: batch {batch}: {row['maps']} maps, {row['strangers']} pairs of strangers ({row['of_one_building']} of one building), {row['joined']} joined; "
              f"{row['joined_rightly']} more were joined where the truth has them; {row['without_verdict']} without a verdict; {row['cpu_ms_per_pair']:.0f} ms a pair, {row['peak_bytes'] / 1e6:.0f} MB", flush=True)
        bench.keep("strangers", rows)
        batch += 1
    total = {what: sum(row[what] for row in rows.values()) for what in ("strangers", "joined", "pairs", "cpu_s", "without_verdict")}
    bench.table("strangers", "Maps that share nothing", ("batches", "maps", "pairs of strangers", "joined", "ms of a processor per pair"),
                [(len(rows), sum(row["maps"] for row in rows.values()), total["strangers"], total["joined"], f"{1e3 * total['cpu_s'] / max(1, total['pairs']):.0f}")])
    bench.gate("strangers", "pairs of strangers that were judged", total["strangers"], wanted, total["strangers"] >= wanted)
    bench.gate("strangers", "joined", total["joined"], "0", total["joined"] == 0)
