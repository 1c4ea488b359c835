"""Fleets: what up to a thousand robots with lasers cost their edges, the cloud and the coordinator while they drive

Needs fleet_benchmark (scripts/build release fleet_benchmark). Five simulated robots drive in each flat, twenty belong to an edge; their maps go up in four rounds of virtual time, and every tier merges what it has. Robots of a flat are on one edge, or spread over the edges, so that the cloud has to find them.
Processor time is of the last round, in which maps are largest. The bottleneck is what takes longest of a round that is shared by nobody: one edge, the cloud or the coordinator.
Writes the table between <!-- bench:fleet --> and <!-- /bench --> of datasets/RESULTS.md, with what a thousand robots would need by its last row, and out/bench/fleet.json. A fleet of which fewer than half of the robots are merged with another one, or with a map of robots of two flats, ends with exit code 5.
Takes five minutes; 200 robots (--sizes 200) take more than half an hour.
"""
import itertools
import json
import subprocess

from benches import common

SIZES = (20, 60)
MERGED = 0.5
OF_EDGE = 20  # robots
HEADERS = ("robots", "edges", "robots of a flat", "a robot: sensed, kB/s", "maps up to an edge, kB/s", "an edge up to the cloud, kB/s", "reports to the coordinator, kB/s", "mapping, processors a robot", "an edge's round, s", "the cloud's, s",
           "a decision, s", "bottleneck", "robots in joint maps", "all together, MB a robot")


def add_arguments(parser):
    parser.add_argument("--sizes", default=",".join(map(str, SIZES)), metavar="N,...", help="fleets (default: %(default)s); another list leaves RESULTS.md as it is")
    parser.add_argument("--first-seed", type=int, default=100, metavar="N", help="of the flats (default: %(default)s)")
    parser.add_argument("--patience", type=float, default=3600.0, metavar="S", help="a fleet that takes longer is left out (default: %(default)s)")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md as it is")


def measured(program, size, is_spread, first_seed, patience_s):
    try:
        done = subprocess.run([program, str(size), str(first_seed)] + ["spread"] * is_spread, stdout=subprocess.PIPE, text=True, check=True, timeout=patience_s)
    except subprocess.TimeoutExpired:
        return None
    return json.loads(done.stdout) | {"is_spread": is_spread}


def cells(row):
    last, period_s = row["rounds"][-1], row["drive_s"] / len(row["rounds"])
    costs = {"an edge": last["longest_edge_s"], "the cloud": last["cloud_s"], "the coordinator": last["coordinator_s"]}
    slowest = max(costs, key=costs.get)
    return (row["robots"], row["edges"], "on all edges" if row["is_spread"] else "on one edge", f"{row['sensed_bytes'] / row['drive_s'] / 1000:.1f}", f"{last['robot_bytes'] / row['robots'] / period_s / 1000:.1f}", f"{last['cloud_bytes'] / row['edges'] / period_s / 1000:.1f}",
            f"{last['report_bytes'] / period_s / 1000:.1f}", f"{row['mapping_s'] / row['drive_s']:.3f}", f"{last['longest_edge_s']:.2f}", f"{last['cloud_s']:.2f}", f"{last['coordinator_s']:.2f}",
            f"{slowest}, {costs[slowest] / period_s:.2f} processors", last["merged_robots"], f"{(row['peak_mb'] - row['before_mb']) / row['robots']:.2f}")


def of_a_thousand(row):
    """What 1,000 robots on 50 edges need by this row: all grows with robots, but for an edge's load and the coordinator's."""
    last, period_s, scale = row["rounds"][-1], row["drive_s"] / len(row["rounds"]), 1000 / row["robots"]
    sensed, edges, cloud = (value / 1e6 for value in (1000 * row["sensed_bytes"] / row["drive_s"], scale * last["robot_bytes"] / period_s, scale * last["cloud_bytes"] / period_s))
    return (f" By the last row, 1,000 robots on 50 edges sense {sensed:.1f} MB/s, which is what edges store ({3.6 * sensed / 50:.2f} GB an hour each); maps go up to edges with {edges:.1f} MB/s, to the cloud with {cloud:.1f} MB/s; "
            f"{1000 * row['mapping_s'] / row['drive_s']:.0f} processors map, an edge's rounds take {last['longest_edge_s'] / period_s:.2f} of one, and the cloud's {scale * last['cloud_s'] / period_s:.0f}, "
            "which is the first bottleneck: it compares each new map with the twelve most like it, and what ranks them does not know neighbours from others. A ranking that does would move it.")


def run(arguments):
    program = common.need(common.PROGRAM.with_name("fleet_benchmark"), "run scripts/build release fleet_benchmark first")
    rows, late, problems = [], [], []
    for size, is_spread in itertools.product(map(int, arguments.sizes.split(",")), (False, True)):
        if is_spread and size <= OF_EDGE:
            continue
        row = measured(program, size, is_spread, arguments.first_seed, arguments.patience)
        if row is None:
            late.append(size)
            continue
        rows.append(row)
        print(json.dumps(row))
        if mixed := row["rounds"][-1]["mixed_maps"]:
            problems.append(f"of {size} robots {mixed} maps hold robots of two flats")
        if row["rounds"][-1]["merged_robots"] < MERGED * size:
            problems.append(f"of {size} robots {row['rounds'][-1]['merged_robots']} are in joint maps")
    text = common.table(HEADERS, [cells(row) for row in rows])
    text += f"\n\nMeasured by `scripts/bench fleet` on {common.machine()}, one core: simulated flats of five robots each, which drive for {rows[-1]['drive_s']:.0f} s in four rounds."
    if mixed := max(one["mixed_maps"] for row in rows for one in row["rounds"]):
        text += f" In a round before the last, up to {mixed} maps of a preview held robots of two flats, which look alike as long as little of them is seen."
    text += of_a_thousand(rows[-1])
    text += "".join(f" {size} robots did not end within {arguments.patience:.0f} s." for size in late)
    common.write_json("fleet", {"machine": common.machine(), "commit": common.commit(), "rows": rows, "late": late})
    print(text)
    if problems:
        common.give_up("; ".join(problems), 5)
    if not arguments.dry_run and arguments.sizes == ",".join(map(str, SIZES)):
        common.write_results("fleet", text)
    return 0
