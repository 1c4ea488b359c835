"""which robot to which edge: cut weights and times of groupings against METIS, RecSLAM, greedy, random and the exact answer

Needs grouping_benchmark (scripts/build release grouping_benchmark). Random overlap graphs: robots in a building (discs of what they saw), the same
gathered around places, sparse and dense graphs of Erdos and Renyi. Writes the table between <!-- bench:scheduling --> and <!-- /bench --> of
datasets/RESULTS.md, out/bench/scheduling.json, and plots (PNG) and report.html beside it. Takes two minutes.
"""
import json
import pathlib
import random
import statistics
import subprocess
import tempfile

from benches import common, plots, report

PROGRAM = common.PROGRAM.parent / "grouping_benchmark"
KINDS = {"building": "building", "clustered": "gathered", "sparse": "random, sparse", "dense": "random, dense"}
OTHERS = ("metis", "greedy", "recslam", "random")


def add_arguments(parser):
    parser.add_argument("--robots", type=int, default=2000, metavar="N", help="largest graphs that are compared (default: %(default)s)")
    parser.add_argument("--graphs", type=int, default=200, metavar="N", help="graphs that are solved exactly (default: %(default)s)")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md and README.md as they are")


def measured(*arguments):
    run = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
    if run.returncode != 0:
        common.give_up(f"grouping_benchmark failed: {run.stderr.strip()}")
    return json.loads(run.stdout)


def against(rows, other):
    """Mean and worst of (ours / theirs - 1) where theirs cuts anything; how often we are worse by more than one percent."""
    excess = [row["default"] / row[other] - 1 for row in rows if row.get(other, 0) > 1e-9]
    return (sum(excess) / len(excess), max(excess), sum(one > 0.01 for one in excess)) if excess else None


def cell(result):
    return "-" if result is None else f"{100 * result[0]:+.1f} % (worst {100 * result[1]:+.2f} %)"


def overlap_problem(robots, edges, seed):
    """As RecSLAM's fig. 16 has them: robots of which few share anything, and how much is random."""
    numbers = random.Random(f"{robots} {seed}")
    names = [f"r{i}" for i in range(robots)]
    overlaps = [[a, b, round(numbers.uniform(0.01, 0.5), 4)] for i, a in enumerate(names) for b in names[i + 1:] if numbers.random() < 4.0 / robots]
    return {"robots": names, "overlaps": overlaps, "edges": [{"id": f"e{i}", "bandwidth_bytes_per_s": 2.5e6} for i in range(edges)]}


def by_search(edges=3, seeds=20):
    """Fig. 16: the weight that is cut, with and without tabu search, as `mapweave plan` groups; mean of the seeds, by robots."""
    cuts = {}
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "problem.json"
        for robots in (10, 20, 30, 40, 50):
            for seed in range(seeds):
                path.write_text(json.dumps(overlap_problem(robots, edges, seed)))
                printed = subprocess.run([common.PROGRAM, "plan", path, "--compare", "--json"], capture_output=True, text=True, check=True).stdout
                for row in json.loads(printed)["compared"]:
                    if "cut_weight" in row:
                        cuts.setdefault(row["method"], {}).setdefault(robots, []).append(row["cut_weight"])
    return {method: sorted((robots, statistics.mean(some)) for robots, some in found.items()) for method, found in cuts.items()}


SEARCHES = {"recslam, search none": "algorithm 1", "recslam, search printed": "algorithm 2 as printed", "recslam, search tabu": "algorithm 2, list filters", "default": "mapweave's default"}


def median_by_robots(rows, value):
    found = {}
    for row in rows:
        found.setdefault(row["robots"], []).append(value(row))
    return [(robots, statistics.median(some)) for robots, some in sorted(found.items())]


def figures(rows, times, searches):
    def relative(name):
        return median_by_robots([row for row in rows if name in row and row["default"] > 1e-9], lambda row: row[name] / row["default"])
    return [plots.figure("scheduling-cut", "cut weight, median of all graphs", "robots", "cut / default", {name: relative(name) for name in OTHERS}, log_y=True),
            plots.figure("scheduling-tabu", "RecSLAM: effect of the tabu search, median", "robots", "cut / default",
                         {label: relative(name) for name, label in (("recslam_no_search", "algorithm 1"), ("recslam", "as printed"), ("recslam_tabu", "list filters"))}),
            plots.figure("scheduling-fig16", "weight between groups, 3 edges, mean of 20 graphs (fig. 16)", "robots", "cut weight",
                         {label: searches[method] for method, label in SEARCHES.items()}),
            plots.figure("scheduling-methods", "time of the methods, one core, median (fig. 15, 20)", "robots", "ms",
                         {label: median_by_robots([row for row in rows if f"{name}_ms" in row], lambda row: row[f"{name}_ms"])
                          for name, label in (("default", "default"), ("recslam_no_search", "algorithm 1"), ("recslam", "with tabu"), ("greedy", "greedy"), ("metis", "metis"))},
                         log_y=True),
            plots.figure("scheduling-time", "time of the default grouping, one core", "robots", "ms",
                         {label: median_by_robots([row for row in times if row["kind"] == kind], lambda row: row["ms"]) for kind, label in KINDS.items()}, log_y=True)]


def run(arguments):
    common.need(PROGRAM, "run scripts/build release grouping_benchmark first")
    exact, rows, times, unseen = measured("exact", arguments.graphs), measured("compare", arguments.robots), measured("time"), measured("worse", 20)
    searches = by_search()
    common.OUT.mkdir(parents=True, exist_ok=True)
    drawn = figures(rows, times, searches)
    plots.draw(common.OUT, drawn)
    text = common.table(("graphs", "robots", "against METIS 5", "against greedy", "against recslam", "against random"),
                        [(label, f"{min(row['robots'] for row in some)} to {max(row['robots'] for row in some)}", *(cell(against(some, other)) for other in OTHERS))
                         for kind, label in KINDS.items() if (some := [row for row in rows if row["kind"] == kind])])
    shown = [at for at in (10, 50, 1000, 10000) if any(row["robots"] == at for row in times)]
    text += "\n\n" + common.table(("robots", "time, ms (least to most)", "goal, ms"),
                                  [(at, "{:.3g} to {:.3g}".format(min(some), max(some)), {10: 0.1, 50: 1, 1000: 100, 10000: 2000}[at])
                                   for at in shown for some in [[row["ms"] for row in times if row["robots"] == at]]])
    text += "\n\n" + common.table(("weight between groups (fig. 16), 3 edges", *(f"{robots} robots" for robots, _ in searches["default"])),
                                  [(label, *(f"{cut:.3g}" for _, cut in searches[method])) for method, label in SEARCHES.items()])
    text += (f"\n\nMeasured by `scripts/bench scheduling` on {common.machine()}, one core, processor time. {len(rows)} graphs in 2 to 16 groups of equal size, recslam up to {max(row['robots'] for row in rows if 'recslam' in row)} robots; METIS: ufactor 1, the "
             f"better of its two forms, sizes repaired. Against the least cut there is, {exact['graphs']} graphs of 4 to 16 robots: {100 * exact['mean_excess']:.3f} % above on average, "
             f"{100 * exact['worst_excess']:.1f} % at most, {exact['optimal']} of them exactly it. Of {sum(some['graphs'] for some in unseen)} further graphs of 10 to 64 robots, METIS, greedy or recslam is "
             f"better by more than a percent in {sum(some['behind_by_a_percent'] for some in unseen)}.")
    common.write_json("scheduling", {"machine": common.machine(), "commit": common.commit(), "exact": exact, "compare": rows, "time": times, "unseen": unseen, "searches": searches, "figures": drawn})
    report.write()
    print(text)
    if not arguments.dry_run:
        common.write_results("scheduling", text)
    return 0
