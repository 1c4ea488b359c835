"""overlap: how often two maps of real logs are joined rightly (0.3 m, 2 degrees of the joint optimum), by how much they share.

Two stretches of one log that have no second in common and saw the same places on different passes, so that their scans, their odometry and their
drift are independent (of corrected logs the odometry is ours, drawn for each stretch). Overlap: cells of half a metre that both saw, of the smaller
one's; within 5 % of the level. Joint optimum: the log as one robot. Right: of the scans of the two robots that saw the same place, four of five
lie to each other in the team's map as they do in the joint optimum. Elsewhere a robot's map may be bent, with or without the other one.
"""
import itertools
import math
import random

from benches.team_bench import judging, placing, windows
from benches.team_bench.program import Failed

LEVELS = {80: 0.99, 50: 0.98, 30: 0.95, 15: 0.80}
WITHIN = 0.05
STRETCH_M = (40.0, 150.0)
POOL = 70                # stretches of each log
APART_S = 10.0           # between two stretches, at least
RIGHT_M, RIGHT_DEG = 0.3, 2.0
PAIRS = 220              # wanted a level
NOT_LOOKED_AT = ("mit-killian", "fr-clinic")   # of these no stretch was, when weights were set
PROPOSERS = ("ring keys", "whole maps", "corners")   # in the order in which they are asked
MOST_OF_ONE = 12         # pairs of a level that one stretch takes part in


def pool(bench, log):
    draw, seen = random.Random(f"pool {log}"), windows.seen(bench, log)
    found = []
    for i in range(POOL):
        first, end = seen.draw(draw, *STRETCH_M)
        window = windows.Window(log, round(first, 3), round(end, 3), f"w{i}", odometry_seed=1 + i)
        found.append((window, seen.of(first, end)))
    return found


def candidates(bench, log):
    """{level: [(window, window, overlap)]}."""
    found = {level: [] for level in LEVELS}
    for (a, seen_a), (b, seen_b) in itertools.combinations(pool(bench, log), 2):
        if a.first_s < b.end_s + APART_S and b.first_s < a.end_s + APART_S:
            continue
        shared = windows.overlap(seen_a, seen_b)
        for level in LEVELS:
            if abs(shared - level / 100) <= WITHIN:
                found[level].append((a, b, shared))
    return found


def choose(bench, level, found, wanted):
    """Turn by turn of each log, seeded."""
    turns, chosen, used = [], [], {}
    for log in bench.arguments.logs:
        some = list(found[log][level])
        random.Random(f"choose {log} {level}").shuffle(some)
        turns.append(some)
    for turn in itertools.zip_longest(*turns):
        for pair in turn:
            if pair is None or len(chosen) >= wanted or any(used.get(one, 0) >= MOST_OF_ONE for one in pair[:2]):
                continue
            for one in pair[:2]:
                used[one] = used.get(one, 0) + 1
            chosen.append(pair)
    return chosen


def measure(bench, item):
    level, (a, b, shared) = item
    seen = windows.seen(bench, a.log)
    looks = seen.looks_at_the_same(a, b)
    maps, own = zip(*(window.map(bench) for window in (a, b)))
    out = bench.scratch(f"overlap-{a.log}-{level}-{a.name}-{b.name}")
    done, _, merges = bench.merge(maps, out)
    team = judging.team_of(out, {})
    is_one = team[a.name][0] == team[b.name][0]
    off = placing.off_where_shared(looks, team[a.name][1], team[b.name][1], seen.truth) if is_one else None
    result = "apart" if off is None else "right" if off[0] <= RIGHT_M and off[1] <= RIGHT_DEG else "off"
    if result != "right":
        bench.picture(list(maps), f"overlap-{a.log}-{level}-{a.name}-{b.name}")
    # Maps that were joined are judged as they lie in the team's map; others as the best alignment lays them, which bends nothing.
    right = lambda verdict: result == "right" if off else placing.is_right_where_shared(verdict, looks, {a.name: own[0], b.name: own[1]}, seen.truth, RIGHT_M, RIGHT_DEG)
    beliefs = [[verdict["probability"], right(verdict)] for verdict in merges if verdict["b_from_a"] and "x" in verdict["b_from_a"]]
    return {"log": a.log, "level": level, "beliefs": beliefs, "a": a.name, "b": b.name, "overlap": shared,
            "result": result, "off_m": off and off[0], "off_deg": off and off[1],
            "reason": merges[0]["reason"] if merges else "none", "proposer": merges[0]["proposer"] if merges else "none", "cpu_s": done.cpu_s}


def line_of(what, goal, rows):
    """A line of the table; none without rows."""
    if not rows:
        return []
    right, offs = sum(row["result"] == "right" for row in rows), sorted(row["off_m"] for row in rows if row["result"] == "off")
    return [(what, len(rows), right, f"{100 * right / len(rows):.1f} %", f"{100 * goal:g} %", sum(row["result"] == "apart" for row in rows), len(offs),
             f"{offs[-1]:.2f}" if offs else "-")]


def run(bench):
    found = {log: candidates(bench, log) for log in bench.arguments.logs}
    for log, levels in found.items():
        print(f"overlap: {log}: pairs there are: {', '.join(f'{level} %: {len(some)}' for level, some in levels.items())}", flush=True)
    wanted = bench.arguments.overlap_pairs
    items = [(level, pair) for level in LEVELS for pair in choose(bench, level, found, wanted)]
    rows = {}
    for (level, (a, b, _)), row in bench.side_by_side(lambda item: measure(bench, item), items):
        if isinstance(row, Failed):
            row = {"log": a.log, "level": level, "a": a.name, "b": b.name, "result": "failed", "reason": str(row)}
        rows[f"{level} {a.log} {a.name} {b.name}"] = row
        off = f"{row['off_m']:.2f} m {row['off_deg']:.1f} deg" if row.get("off_m") is not None else row["reason"]
        print(f"overlap: {level} % {a.log} {a.name} {b.name}: {row['result']}, {off}", flush=True)
    kept = bench.keep("overlap", rows)
    lines = []
    for level, goal in LEVELS.items():
        some = [row for row in rows.values() if row["level"] == level]
        right = sum(row["result"] == "right" for row in some)
        bench.gate("overlap", f"{level} %: pairs", len(some), wanted, len(some) >= wanted)
        bench.gate("overlap", f"{level} %: right", f"{right} of {len(some)}", f"{100 * goal:g} %", bool(some) and right >= math.ceil(goal * len(some)))
        bench.gate("overlap", f"{level} %: off", sum(row["result"] == "off" for row in some), 0, all(row["result"] != "off" for row in some))
        for what, is_wanted in (("", False), (", left out", True)):
            lines += line_of(f"{level} %{what}", goal, [row for row in kept.values() if row["level"] == level and (row["log"] in NOT_LOOKED_AT) == is_wanted])
    joined = [row for row in kept.values() if row["result"] in ("right", "off")]
    shares = [(proposer, *(sum(row.get("proposer") == proposer and row["result"] == result for row in joined) for result in ("right", "off"))) for proposer in PROPOSERS]
    bench.table("overlap", "Who proposed the joins of the table above", ("proposer", "right", "off", "share of all"),
                [(proposer, right, off, f"{100 * (right + off) / max(1, len(joined)):.1f} %") for proposer, right, off in shares])
    bench.table("overlap", "Joined rightly (0.3 m, 2 degrees of the joint optimum) by overlap, real logs, no common seconds",
                ("overlap", "pairs", "right", "share", "goal", "apart", "off", "farthest off, m"), lines)
