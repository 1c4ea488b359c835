"""visits: three real visits to one hall (tinyslam); one map, and the paths' ends within a metre of each other. Walls are looked at in the pictures."""
import itertools
import math

from benches.team_bench import inputs, judging

GOAL_M = 1.0


def run(bench):
    maps = [bench.store.made(f"visits/{log}", [log], lambda folder, log=log: [inputs.text_of(log)])[0][0] for log in inputs.VISITS]
    out = bench.scratch("visits")
    done, summary, merges = bench.merge(maps, out, "--set", "output.pcd=false", quiet=False)
    team = judging.team_of(out, {})
    bench.keep_pictures(out, "visits")
    for path in maps:
        own = bench.scratch(f"visits-{path.stem}")
        bench.program("export", path, "--out", own, "--png", "--force")
        for picture in own.rglob("map.color.png"):
            picture.replace(bench.folder / f"pictures/visits-{path.stem}-alone.png")
    ends = {robot: (number, trajectory.poses[-1]) for robot, (number, trajectory) in team.items()}
    apart = {f"{a} {b}": math.dist(ends[a][1][:2], ends[b][1][:2]) if ends[a][0] == ends[b][0] else None for a, b in itertools.combinations(sorted(ends), 2)}
    row = {"maps": summary["team"]["components"], "exit_code": done.code, "cpu_s": done.cpu_s, "ends_apart_m": apart,
           "verdicts": [[verdict[what] for what in ("a", "b", "decision", "reason", "probability")] for verdict in merges]}
    bench.keep("visits", {"exp1 exp2 exp3": row})
    bench.table("visits", "Three visits to one hall (tinyslam)", ("pair", "verdict", "ends apart, m"), [(f"{a} {b}", f"{decision}: {reason}", "-" if apart[f"{a} {b}"] is None else f"{apart[f'{a} {b}']:.2f}")
                for a, b, decision, reason, _ in row["verdicts"]])
    bench.gate("visits", "maps", row["maps"], "1", row["maps"] == 1)
    known = [value for value in apart.values() if value is not None]
    bench.gate("visits", "ends apart", f"{max(known):.2f} m" if known else "nothing was joined", f"{GOAL_M} m, all of them", len(known) == len(apart) and max(known) <= GOAL_M)
    print(f"visits: look for double walls: {bench.folder}/pictures/visits-*.png")
