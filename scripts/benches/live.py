"""what the live camera map server costs: processor time per client, waiting, and dropped frames of whole clients in real time

Needs live_server_benchmark (scripts/build release live_server_benchmark). Robots with depth cameras in one apartment, 10 frames/s, cameras
that hand over features; what they publish is recorded once, below out/bench/live. Writes the table between <!-- bench:live --> and
<!-- /bench --> of datasets/RESULTS.md, and out/bench/live.json. Where the clients' maps did not become one, the exit code is 5 and what merging took is left
out. Takes a minute for each row.
"""
import json
import subprocess

from benches import common

PROGRAM = common.PROGRAM.parent / "live_server_benchmark"
HEADERS = ("clients", "maps at the end", "server, CPU s per client-minute", "of it merging", "server, cores", "update, ms", "retrieval, ms", "sending, ms", "place, ms",
           "an update waits, ms (longest)", "maps held, ms (longest)", "merges (longest, s)")


def add_arguments(parser):
    parser.add_argument("--clients", default="1,2,4,8,16", metavar="N,...", help="recorded streams at sensor speed (default: %(default)s)")
    parser.add_argument("--team", type=int, default=8, metavar="N", help="whole clients in real time; 0: none (default: %(default)s)")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md and README.md as they are")


def measured(*arguments):
    run = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
    if run.returncode != 0:
        common.give_up(f"live_server_benchmark failed: {run.stderr.strip()}")
    return run.stdout


def cells(row):
    is_one = row["components"] == 1
    return (row["clients"], row["components"], f"{row['cpu_s_per_client_minute']:.2f}", f"{row['merging_s_per_client_minute']:.2f}" if is_one else "-", f"{row['cores']:.2f}",
            f"{row['update_ms']:.2f}", f"{row['retrieval_ms']:.3f}", f"{row['sending_ms']:.3f}", f"{row['place_ms']:.1f}",
            f"{row['mean_wait_ms']:.1f} ({row['longest_wait_ms']:.0f})", f"{row['longest_hold_ms']:.0f}",
            f"{row['merges']} ({row['longest_merge_s']:.1f})" if is_one else "-")


def run(arguments):
    common.need(PROGRAM, "run scripts/build release live_server_benchmark first")
    folder = common.OUT / "live"
    folder.mkdir(parents=True, exist_ok=True)
    stream = folder / "published-by-16"
    if not stream.exists():
        measured("record", stream, 16, 60)
    rows = json.loads(measured("replay", stream, arguments.clients))
    for row in rows:
        if row.get("trouble"):
            common.give_up(f"with {row['clients']} clients the server had trouble: {row['trouble']}")
    text = common.table(HEADERS, [cells(row) for row in rows])
    text += (f"\n\nMeasured by `scripts/bench live` on {common.machine()}: recorded streams of robots in one apartment at sensor speed, a minute each. Goals: CPU per "
             "client flat, 8 under one core; update 5 ms, retrieval 0.2 ms, sending 1 ms (processor time). CVS (table II, Core i7-8809G, other data): 24.8, 1.7 and 2.1 ms.")
    team = json.loads(measured("team", arguments.team, 60)) if arguments.team else None
    if team:
        text += (f" {team['clients']} whole clients (features, 10 frames/s) with their server in real time took {team['cores']:.2f} cores, retrieved in {team['retrieval_ms']:.2f} ms and dropped {team['dropped']} of "
                 f"{team['frames']} frames; their maps became {team['components']}.")
    common.write_json("live", {"machine": common.machine(), "commit": common.commit(), "rows": rows, "team": team})
    print(text)
    if not arguments.dry_run:
        common.write_results("live", text)
    return common.unmet("not one map", [f"{row['clients']} clients ({row['components']} maps)" for row in [*rows, *([team] if team else [])] if row["components"] != 1])
