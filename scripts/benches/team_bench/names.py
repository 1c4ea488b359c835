"""names: verdicts do not depend on what robots are called, on their order, on threads, or on where an input's odometry begins."""
import hashlib
import json
import math

from benches.team_bench import carmen, inputs
from benches.team_bench.program import Failed

TEAMS = (("fr079", 3), ("mit-killian", 3), ("freiburg-101", 3))
NAMES = {"as they are": ("r0", "r1", "r2"), "the other way round": ("z", "k", "b"), "turned": ("m", "zz", "a")}
SAME_M, SAME_DEG = 0.01, 0.05    # another name is another side to match a pair from: a fifth of a cell
MOVED = (13.7, -8.1, 2.2)
MOVED_M, MOVED_DEG = 0.02, 0.2   # text has six digits: a moved odometry differs by its rounding


def parts(log, robots, names, moved=None):
    """Logs of a team with these names, the last one's odometry moved."""
    def write(folder):
        folder.mkdir(parents=True, exist_ok=True)
        whole = inputs.text(log, 1 if log in inputs.CORRECTED_LOGS else 0)
        first, last = inputs.span(log)
        paths = []
        for i, name in enumerate(names):
            part = carmen.cut(whole, first + (last - first) * i / robots, first + (last - first) * (i + 1) / robots + (1.0 if i + 1 == robots else 0.0))
            if moved and i + 1 == robots:
                part = carmen.Log([scan.at(carmen.compose(moved, scan.laser), carmen.compose(moved, scan.robot)) for scan in part.scans], part.parameters)
            paths.append(part.write(folder / f"{name}.log.gz"))
        return paths
    return write


def said(merges, names):
    """{(number, number): (decision, reason, transform)} whatever the robots are called."""
    found = {}
    for verdict in merges:
        a, b, place = names.index(verdict["a"]), names.index(verdict["b"]), verdict["b_from_a"]
        pose = (place["x"], place["y"], place["yaw"])
        found[min(a, b), max(a, b)] = verdict["decision"], verdict["reason"], pose if a < b else carmen.inverse(pose)
    return found


def differences(one, other, metres, degrees):
    """What two runs say otherwise, in words, and the farthest that a pair which both join lies aside, in m. Transforms count where a pair is joined."""
    texts, farthest = [], 0.0
    for pair in sorted(set(one) | set(other)):
        a, b = one.get(pair), other.get(pair)
        if a is None or b is None or a[:2] != b[:2]:
            texts.append(f"{pair}: {a and a[:2]} and {b and b[:2]}")
        elif a[0] == "accepted":
            x, y, yaw = carmen.between(a[2], b[2])
            farthest = max(farthest, math.hypot(x, y))
            if math.hypot(x, y) > metres or abs(math.degrees(carmen.wrap(yaw))) > degrees:
                texts.append(f"{pair}: {math.hypot(x, y):.4f} m, {abs(math.degrees(yaw)):.3f} deg")
    return texts, farthest


def outputs(out):
    """Checksums of all that speaks of the team; verdicts without their times."""
    found = {}
    for path in sorted([*out.glob("team*/**/*"), *out.glob("*.png")]):
        if path.is_file():
            found[str(path.relative_to(out))] = hashlib.sha256(path.read_bytes()).hexdigest()
    merges = json.loads((out / "merges.json").read_text())
    found["merges.json"] = [{key: value for key, value in verdict.items() if not key.endswith("seconds")} for verdict in merges]
    return found


def measure(bench, log, robots):
    row, plain, maps = {"log": log, "robots": robots}, None, None
    for what, names in NAMES.items():
        some, _ = bench.store.made(f"names/{log}-{robots}-{''.join(names)}", list(names), parts(log, robots, names))
        _, _, merges = bench.merge(some, bench.scratch(f"names-{log}-{''.join(names)}"))
        if plain is None:
            plain, maps = said(merges, names), some
            row["joined"] = sum(verdict[0] == "accepted" for verdict in plain.values())
        else:
            row[f"named {what}"], farthest = differences(plain, said(merges, names), SAME_M, SAME_DEG)
            row["farthest_m"] = max(row.get("farthest_m", 0.0), farthest)
    names = NAMES["as they are"]
    moved, _ = bench.store.made(f"names/{log}-{robots}-moved", list(names), parts(log, robots, names, MOVED))
    _, _, merges = bench.merge(moved, bench.scratch(f"names-{log}-moved"))
    row["moved"], _ = differences(plain, said(merges, names), MOVED_M, MOVED_DEG)
    first = None
    for what, some, threads in (("1", maps, 1), ("turned order", maps[1:] + maps[:1], 1), ("other order", maps[::-1], 2), ("3 threads", maps, 3), ("4 threads", maps, 4)):
        out = bench.scratch(f"names-{log}-bytes")
        # Without --frame the first file gives it.
        bench.merge(some, out, "--set", "output.pgm=true", "--frame", names[0], threads=threads)
        now = outputs(out)
        first = first or now
        if what != "1":
            row[f"bytes, {what}"] = sorted(name for name in {*first, *now} if first.get(name) != now.get(name))
    return row


def run(bench):
    rows = {}
    for log, robots in TEAMS:
        if bench.arguments.logs_chosen and log not in bench.arguments.logs:
            continue
        try:
            row = measure(bench, log, robots)
        except Failed as failed:
            bench.gate("names", f"{log} in {robots}", failed, "a result", False)
            continue
        rows[f"{log} in {robots}"] = row
        for what, texts in row.items():
            if isinstance(texts, list):
                bench.gate("names", f"{log} in {robots}, {what} ({row['joined']} pairs joined)", "the same" if not texts else "; ".join(texts[:4]), "the same", not texts)
        bench.keep("names", rows)
    kept = bench.keep("names", rows)
    what = [key for key, value in next(iter(kept.values()), {}).items() if isinstance(value, list)]
    bench.table("names", "What verdicts and bytes do not depend on", ("team", "pairs joined", "farthest aside under other names, mm", *what),
                [(name, row["joined"], f"{1000 * row['farthest_m']:.1f}", *("same" if not row[key] else f"{len(row[key])} differ" for key in what)) for name, row in kept.items()])
    bench.gate("names", "teams in which anything was joined", sum(row["joined"] > 0 for row in rows.values()), "1 or more", any(row["joined"] for row in rows.values()))
