"""teams: one log cut into robots; right, wrong or apart by hand-checked relations."""
import json

from benches.team_bench import inputs, judging
from benches.team_bench.program import Failed

HEADERS = ("log", "robots", "runs", "pairs", "right", "wrong", "apart", "pairs of 20 relations or more in one map", "relation error, one robot, m", "team, m", "within robots, m",
           "across, m", "across, joined")


def cuts(arguments):
    """Equal parts and seeded ones, without and with common seconds; every second seeded one with clocks apart."""
    for log in arguments.logs:
        for robots in arguments.robots:
            for seed in range(arguments.cuts + 1):
                if seed == 0 and arguments.no_equal:
                    continue
                clocks = seed % 2 == 0 and seed > 0
                yield inputs.Cut(log, robots, seed, 0.0, clocks)
                if arguments.overlap:
                    yield inputs.Cut(log, robots, seed, arguments.overlap, clocks)


def single(bench, log):
    """Mean error of the log as one robot; {relation's number: metres} says which it holds for."""
    maps, _ = bench.store.maps(inputs.Cut(log, 1))
    team = {"r0": (0, judging.Trajectory.read(maps[0].with_suffix(".tum")))}
    return judging.totals(judging.errors(inputs.relations(log), team))


def measure(bench, cut):
    maps, info = bench.store.maps(cut)
    name = f"{cut.log}-{cut.key()}"
    out = bench.scratch(name)
    done, summary, merges = bench.merge(maps, out)
    team = judging.team_of(out, cut.shifts())
    found = judging.errors(inputs.relations(cut.log), team)
    row = {"log": cut.log, "robots": cut.robots, "seed": cut.seed, "overlap_s": cut.overlap_s, "clocks": cut.clocks, "exit_code": done.code,
           "components": summary["team"]["components"], "cpu_s": done.cpu_s, "peak_bytes": done.peak_bytes,
           "mapping_cpu_s": sum(robot["cpu_s"] for robot in info["robots"]), "pairs": judging.pairs(found), "totals": judging.totals(found),
           "verdicts": [[verdict[what] for what in ("a", "b", "decision", "reason")] for verdict in merges]}
    if bench.arguments.whole:
        row["edges_agree"] = run_by_edges(bench, cut, merges)
    if any(pair["verdict"] != "right" for pair in row["pairs"]):
        bench.picture(maps, name)
    return row


def run_by_edges(bench, cut, merges):
    """The same by `run` with two edges: whether the cloud says the same of every pair: in one map, or why not."""
    folder = bench.scratch(f"{cut.log}-{cut.key()}-edges")
    logs = cut.write_parts(bench.program, folder / "logs")
    lines = [f"  - {{id: {robot}, log: {json.dumps(str(log))}, edge: e{i % 2}}}\n" for i, (robot, log) in enumerate(zip(cut.robot_names(), logs))]
    (folder / "team.yaml").write_text("robots:\n" + "".join(lines))
    bench.program("run", folder / "team.yaml", "--out", folder / "run", "--force", "--threads", 1, "--set", "output.png=false", "--set", "output.pcd=false", "--set", "output.report=false")

    def said(verdicts):
        return sorted((verdict["a"], verdict["b"], *(("in one map",) if verdict["in_one_map"] else (verdict["decision"], verdict["reason"]))) for verdict in verdicts)
    return said(merges) == said(verdict for verdict in json.loads((folder / "run/merges.json").read_text()) if verdict["tier"] == "cloud")


def line(key, row):
    totals = []
    for pair in row["pairs"]:
        error = f"{pair['error_m']:.3f}" if "error_m" in pair else "apart"
        totals.append(f"{pair['a']}{pair['b']}:{error}{'!' if pair['verdict'] == 'wrong' else ''}({pair['relations']})")
    return f"{key} rc {row['exit_code']} components {row['components']} {row['cpu_s']:.1f} s  " + " ".join(totals)


def sums(rows):
    totals = {"runs": len(rows)}
    pairs = [pair for row in rows for pair in row["pairs"]]
    for verdict in ("right", "wrong", "apart"):
        totals[verdict] = sum(pair["verdict"] == verdict for pair in pairs)
    related = [pair for pair in pairs if pair["relations"] >= judging.WELL_RELATED]
    totals["related"], totals["related_joined"] = len(related), sum(pair["verdict"] != "apart" for pair in related)
    for what in ("within", "within_sum_m", "across", "across_joined", "across_sum_m"):
        totals[what] = sum(row["totals"][what] for row in rows)
    return totals


def team_error(totals):
    count = totals["within"] + totals["across_joined"]
    return (totals["within_sum_m"] + totals["across_sum_m"]) / count if count else float("nan")


def metres(total, count):
    return f"{total / count:.4f}" if count else "-"


def report(bench, rows, singles, part):
    lines = []
    for log in dict.fromkeys(row["log"] for row in rows):
        for robots in sorted({row["robots"] for row in rows if row["log"] == log}):
            totals = sums([row for row in rows if row["log"] == log and row["robots"] == robots])
            alone = singles.get(log)
            lines.append((log, robots, totals["runs"], totals["right"] + totals["wrong"] + totals["apart"], totals["right"], totals["wrong"], totals["apart"],
                          f"{totals['related_joined']} of {totals['related']}", metres(alone["within_sum_m"], alone["within"]) if alone else "-", f"{team_error(totals):.4f}",
                          metres(totals["within_sum_m"], totals["within"]), metres(totals["across_sum_m"], totals["across_joined"]), f"{totals['across_joined']} of {totals['across']}"))
    bench.table(part, "One log cut into robots, judged by hand-checked relations (corrected logs: by the poses they bring)", HEADERS, lines)


def judge(bench, rows, singles, part):
    totals = sums(rows)
    bench.gate(part, "wrong pairs", totals["wrong"], "0", totals["wrong"] == 0)
    if totals["related"]:
        share = totals["related_joined"] / totals["related"]
        bench.gate(part, "pairs with 20 relations or more in one map", f"{totals['related_joined']} of {totals['related']}", "95 %", share >= 0.95)
    for log, alone in singles.items():
        of_log = sums([row for row in rows if row["log"] == log])
        if of_log["across_joined"] and alone["within"]:
            ratio = team_error(of_log) / (alone["within_sum_m"] / alone["within"])
            bench.gate(part, f"{log}, team's relation error against one robot's", f"{ratio:.3f} ({of_log['across_joined']} of {of_log['across']} relations across are in one map)", "1.05", ratio <= 1.05)
    checked = [row for row in rows if "edges_agree" in row]
    if checked:
        agree = sum(row["edges_agree"] for row in checked)
        bench.gate(part, "two edges give the verdicts of one", f"{agree} of {len(checked)}", "all", agree == len(checked))


def run(bench, part="teams"):
    rows, failures = {}, 0
    for cut, row in bench.side_by_side(lambda cut: measure(bench, cut), list(cuts(bench.arguments))):
        key = f"{cut.log} {cut.key()}"
        if isinstance(row, Failed):
            failures += 1
            print(key, row, flush=True)
            continue
        rows[key] = row
        print(line(key, row), flush=True)
        bench.keep(part, {key: row})
    totals = sums(list(rows.values()))
    print(f"joined rightly {totals['right']}, wrongly {totals['wrong']}, left apart {totals['apart']}, failed {failures}")
    singles = {} if bench.arguments.no_single else {log: single(bench, log) for log in bench.arguments.logs}
    kept = bench.keep(part, rows, singles=singles)
    report(bench, list(kept.values()), singles, part)
    bench.gate(part, "runs that failed", failures, "0", failures == 0)
    judge(bench, list(rows.values()), singles, part)
