"""What a server keeps for a client with little room: a drive of 2,000 keyframes by a client of 300

Needs team_benchmark (scripts/build release team_benchmark). A robot whose camera hands over features drives through three rooms again and again, culls nothing, and forgets what it has no room for; beside it, the same drive with a
server that sends nothing. Writes the table between <!-- bench:forgetting --> and <!-- /bench --> of datasets/RESULTS.md, and out/bench/forgetting.json. A drive of fewer keyframes, a client that holds more than
its room, a final map that lacks more than a fiftieth of what the client dropped, and a client that takes a twentieth more memory than that of the silent server end with exit code 5. Takes some minutes; --quick one.
"""
import json
import subprocess

from benches import common

DRIVES = {"whole": {"room": 300, "metres": 600, "keyframes": 2000}, "quick": {"room": 60, "metres": 60, "keyframes": 150}}
GOAL_MISSING, GOAL_MEMORY = 0.02, 1.05


def add_arguments(parser):
    parser.add_argument("--quick", action="store_true", help="a tenth of it, to try it out; leaves RESULTS.md as it is")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md as it is")


def problems(row, drive):
    made = row["client_keyframes"] + row["forgotten"]
    found = []
    if made < drive["keyframes"]:
        found.append(f"the drive made {made} keyframes, at least {drive['keyframes']} were expected")
    if row["client_keyframes"] > drive["room"]:
        found.append(f"the client holds {row['client_keyframes']} keyframes, it has room for {drive['room']}")
    if made - row["whole_keyframes"] > GOAL_MISSING * row["forgotten"]:
        found.append(f"the final map lacks {made - row['whole_keyframes']} of {row['forgotten']} keyframes that the client dropped")
    if row["client_mb"] > GOAL_MEMORY * row["unheard_client_mb"]:
        found.append(f"the client takes {row['client_mb']:.1f} MB, {row['unheard_client_mb']:.1f} where the server sends nothing")
    return found


def run(arguments):
    program = common.need(common.PROGRAM.with_name("team_benchmark"), "run scripts/build release team_benchmark first")
    drive = DRIVES["quick" if arguments.quick else "whole"]
    done = subprocess.run([program, f"forgetting-{drive['room']}@{drive['metres']}"], stdout=subprocess.PIPE, text=True, check=True)
    row = json.loads(done.stdout)
    made = row["client_keyframes"] + row["forgotten"]
    text = common.table(("room, keyframes", "frames (lost)", "keyframes made", "the client holds", "in the final map", "landmarks, client", "final map", "client, MB", "where the server sends nothing, MB", "trajectory, ATE m", "final map, ATE m"),
                        [(drive["room"], f"{row['frames']} ({row['lost']})", made, row["client_keyframes"], row["whole_keyframes"], row["client_landmarks"], row["whole_landmarks"], f"{row['client_mb']:.1f}",
                          f"{row['unheard_client_mb']:.1f}", f"{row['trajectory_m']:.4f}", f"{row['whole_m']:.4f}")])
    text += f"\n\nMeasured by `scripts/bench forgetting` on {common.machine()}: {drive['metres']} m through three simulated rooms, a depth camera that hands over features, 12 frames/s. Memory: what ending the client gives back."
    common.write_json("forgetting", {"machine": common.machine(), "commit": common.commit(), "row": row})
    print(text)
    if found := problems(row, drive):
        common.give_up("; ".join(found), 5)
    if not arguments.dry_run and not arguments.quick:
        common.write_results("forgetting", text)
    return 0
