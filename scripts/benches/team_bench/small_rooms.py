"""rooms: the paper's small rooms; every run ends in one map, within a centimetre of the truth (mean over pairs of the relative placement).

Of the seeds every second one has a building of its own, the others that of `bench recslam`.
"""

from benches import recslam
from benches.team_bench import judging, placing
from benches.team_bench.program import Failed

ROOMS = [name for name in recslam.SCENES if recslam.SCENES[name].get("apartment", {}).get("width_m", 99) < 10]
GOAL_M = 0.01


def logs_of(bench, scene, seed, folder, kept):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "world.yaml").write_text(recslam.world_text(scene, seed, building_seed=seed if seed % 2 == 0 else recslam.BUILDING_SEED))
    bench.program("simulate", folder / "world.yaml", "--out", folder / "world", "--force")
    names = [f"r{i}" for i in range(scene["robots"])]
    for name in names:
        (kept / f"{name}.truth.tum").write_bytes((folder / f"world/{name}.truth.tum").read_bytes())
    return [folder / f"world/{name}.rawlog" for name in names]


def measure(bench, item):
    name, seed = item
    scene, key = recslam.SCENES[name], f"rooms/{name.split(',')[0].replace(' ', '')}-{seed}"
    names = [f"r{i}" for i in range(scene["robots"])]
    kept = bench.store.folder / key
    maps, _ = bench.store.made(key, names, lambda folder: logs_of(bench, scene, seed, folder, kept))
    out = bench.scratch(key.replace("/", "-"))
    done, summary, merges = bench.merge(maps, out)
    truths = {robot: judging.Trajectory.read(kept / f"{robot}.truth.tum") for robot in names}
    offs = placing.of_team(judging.team_of(out, {}), truths)
    joined = [off for off in offs.values() if off]
    if summary["team"]["components"] > 1 or max((off[0] for off in joined), default=0) > 0.3:
        bench.picture(maps, key.replace("/", "-"))
    fits = {robot: placing.fit(judging.Trajectory.read(kept / f"{robot}.tum"), truths[robot]) for robot in names}
    beliefs = [found for verdict in merges if (found := placing.belief(verdict, fits))]
    return {"scene": name, "seed": seed, "beliefs": beliefs, "robots": len(names), "maps": summary["team"]["components"], "exit_code": done.code, "cpu_s": done.cpu_s,
            "off_m": judging.mean(off[0] for off in joined), "worst_m": max((off[0] for off in joined), default=None),
            "reasons": [verdict["reason"] for verdict in merges if not verdict["accepted"]]}


def run(bench):
    rows, items = {}, [(name, seed) for name in ROOMS for seed in range(1, bench.arguments.seeds + 1)]
    for (name, seed), row in bench.side_by_side(lambda item: measure(bench, item), items):
        if isinstance(row, Failed):
            bench.gate("rooms", f"{name}, seed {seed}", row, "a result", False)
            continue
        rows[f"{name} {seed}"] = row
        off = "-" if row["off_m"] is None else f"{1e3 * row['off_m']:.1f} mm"
        print(f"rooms: {name}, seed {seed}: {row['maps']} maps, {off} {' '.join(row['reasons'])}", flush=True)
    kept = list(bench.keep("rooms", rows).values())

    def line(name):
        some = [row for row in kept if row["scene"] == name]
        one = [row for row in some if row["maps"] == 1]
        offs = [row["off_m"] for row in one if row["off_m"] is not None]
        return (name, len(some), len(one), f"{1e3 * judging.mean(offs):.1f}" if offs else "-", f"{1e3 * max(offs):.1f}" if offs else "-")
    bench.table("rooms", "Small rooms, one simulated team a seed", ("room", "runs", "in one map", "off by, mean, mm", "worst run, mm"),
                [line(name) for name in ROOMS if any(row["scene"] == name for row in kept)])
    one = sum(row["maps"] == 1 for row in rows.values())
    bench.gate("rooms", "runs that end in one map", f"{one} of {len(rows)}", "all", one == len(rows) > 0)
    offs = [row["off_m"] for row in rows.values() if row["maps"] == 1 and row["off_m"] is not None]
    bench.gate("rooms", "mean offset of the worst run that ends in one map", f"{max(offs):.4f} m" if offs else "there is none", f"{GOAL_M} m", bool(offs) and max(offs) <= GOAL_M)
