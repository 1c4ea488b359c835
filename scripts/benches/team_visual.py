"""team maps of camera robots: accuracy against a single run, and times

Needs the program (scripts/build) and the sequences below MAPWEAVE_DATA (default ../shared/data): visual/SEQUENCE. Cuts each into two robots
that share some seconds, on an edge each; the cloud joins them. Writes the table between <!-- bench:team-visual --> and <!-- /bench --> of
README.md, and out/bench/team-visual.json.
"""
import json
import math
import statistics

from benches import common

SEQUENCES = {"tum_fr1_rpy": {"overlap_s": 2.3}, "hololens_office_part1": {"overlap_s": 5}}
HEADERS = ("sequence", "robots", "joined", "single run, ATE m", "team, ATE m (least to most)", "goal, m", "witnesses", "merge, s (match + optimise)")


def add_arguments(parser):
    parser.add_argument("--sequences", default=",".join(SEQUENCES), metavar="NAME,...", help="default: all of %(default)s")
    parser.add_argument("--seeds", type=int, default=3, metavar="N", help="the median error of N seeds (default: %(default)s)")
    parser.add_argument("--dry-run", action="store_true", help="leave README.md as it is")


def rows_of(path):
    return [[float(value) for value in line.split()] for line in path.read_text().splitlines() if line and line[0] != "#"]


def team_file(folder, out):
    """All robots' frames as one trajectory for one alignment: where two robots have the same stamp, the later one's is moved by 10 us."""
    taken, rows = set(), []
    for path in sorted(folder.glob("trajectories/*.tum")):
        for row in rows_of(path):
            while round(row[0] * 1e6) in taken:
                row[0] += 1e-5
            taken.add(round(row[0] * 1e6))
            rows.append(row)
    out.write_text("".join(f"{row[0]:.6f} " + " ".join(f"{value:.6f}" for value in row[1:]) + "\n" for row in sorted(rows)))
    return out


def error_of(trajectory, truth):
    _, text = common.mapweave("evaluate", "trajectory", "--estimate", trajectory, "--reference", truth, "--align", "se3", "--json")
    return json.loads(text)["ate_translation_rmse_m"]


def measure(name, seeds):
    source, out = common.DATA / "visual" / name, common.OUT / "team-visual" / name
    truth = source / "groundtruth.txt"
    out.mkdir(parents=True, exist_ok=True)
    common.mapweave("split", source, "--robots", 2, "--overlap", SEQUENCES[name]["overlap_s"], "--out", out / "logs", "--force")
    single, team, witnesses, seconds, joined = [], [], [], [], True
    for seed in range(1, seeds + 1):
        common.mapweave("slam", source, "--seed", seed, "--out", out / "single", "--force")
        single.append(error_of(out / "single/trajectory.tum", truth))
        # An edge each: else the cloud would remember what one edge had judged, and no time for matching be seen.
        common.mapweave("run", out / "logs/run.yaml", "--set", "edges=[{id: north}, {id: south}]", "--seed", seed, "--out", out / "run",
                        "--force")
        verdicts = [v for v in json.loads((out / "run/merges.json").read_text()) if v["tier"] == "cloud"]
        joined = joined and all(v["accepted"] for v in verdicts)
        witnesses.append(sum(len(v["witnesses"]) for v in verdicts))
        team.append(error_of(team_file(out / "run/team", out / "team.tum"), truth))
        stages = json.loads((out / "run/summary.json").read_text())["stages"]
        seconds.append([sum(s["seconds"] for s in stages if s["tier"] == "cloud" and s["name"] == stage)
                        for stage in ("pairwise matching", "transform optimisation")])
    return {"name": name, "robots": 2, "joined": joined, "single_m": single, "team_m": team, "witnesses": statistics.median(witnesses),
            "match_s": statistics.median(s[0] for s in seconds), "optimise_s": statistics.median(s[1] for s in seconds)}


def cells(row):
    single = statistics.median(row["single_m"])
    return (row["name"], row["robots"], "yes" if row["joined"] else "no", f"{single:.4f}",
            f"{statistics.median(row['team_m']):.4f} ({min(row['team_m']):.4f} to {max(row['team_m']):.4f})", f"{1.1 * single:.4f}",
            math.floor(row["witnesses"]), f"{row['match_s']:.2f} + {row['optimise_s']:.2f}")


def run(arguments):
    chosen = [name for name in arguments.sequences.split(",") if name]
    for name in chosen:
        if name not in SEQUENCES:
            common.give_up(f"unknown sequence '{name}'; known: {', '.join(SEQUENCES)}", 2)
    common.need(common.PROGRAM, "run scripts/build first")
    for name in chosen:
        common.need(common.DATA / "visual" / name, "set MAPWEAVE_DATA to the folder that holds visual/")
    stored = common.OUT / "team-visual.json"
    rows = {row["name"]: row for row in json.loads(stored.read_text())["rows"]} if stored.exists() else {}
    for name in chosen:
        rows[name] = measure(name, arguments.seeds)
        common.write_json("team-visual", {"machine": common.machine(), "commit": common.commit(), "rows": [rows[key] for key in SEQUENCES if key in rows]})
    text = common.table(HEADERS, [cells(rows[key]) for key in SEQUENCES if key in rows])
    text += (f"\n\nMeasured by `scripts/bench team-visual` on {common.machine()}: each sequence cut into two robots that share some seconds, on an edge each. One "
             f"alignment for the whole team; goal: 1.1 times the single run's error. Median of {arguments.seeds} seeds; wall times.")
    print(text)
    if not arguments.dry_run:
        common.write_readme("team-visual", text)
    return 0
