"""vision: what cameras have is kept: `bench team-visual`'s teams, rooms that are alike, and teams of cameras and lasers; none is joined falsely."""
import json

from benches import common, team_visual
from benches.team_bench import judging, placing
from benches.team_bench.program import Failed

ALIKE = "repeated-rooms-100"
WRONG_M = 0.5


def sequence(bench, name):
    row = team_visual.measure(name, bench.arguments.vision_seeds)
    single, team = sorted(row["single_m"])[len(row["single_m"]) // 2], sorted(row["team_m"])[len(row["team_m"]) // 2]
    bench.gate("vision", f"{name}: joined in every run", row["joined"], True, row["joined"])
    if row["joined"]:
        bench.gate("vision", f"{name}: team's error", f"{team:.4f} m", f"{1.1 * single:.4f} m", team <= 1.1 * single)
    return row


def team(bench, name):
    row = team_visual.measure_team(name)
    bench.gate("vision", f"{name}: joined falsely", row["falsely_joined"], "0", row["falsely_joined"] == 0)
    if "components" in row:
        bench.gate("vision", f"{name}: maps joined into", row["components"], "1", row["components"] == 1)
        if row["components"] == 1:
            bench.gate("vision", f"{name}: team's error", f"{row['team_m']:.4f} m", f"{1.1 * row['alone_m']:.4f} m", row["team_m"] <= 1.1 * row["alone_m"])
    return row


def both_senses(bench, seed):
    """Two robots of one flat with a depth camera and a laser each, mapped with both; the camera's frames are far apart in time, so that it is quick."""
    folder = bench.scratch("worlds", f"both-{seed}")
    if not (folder / "run.yaml").exists():
        bench.program("simulate", common.ROOT / "configs/worlds/camera_team.yaml", "--set", f"seed={seed}", "--out", folder, "--force")
    rows = {}
    for sensor in ("laser", "rgbd", "all"):
        out = bench.scratch(f"both-{seed}-{sensor}")
        done = bench.program("run", folder / "run.yaml", "--set", f"sensor={sensor}", "--out", out, "--force", "--threads", 1, "--set", "output.pcd=false")
        summary = json.loads((out / "summary.json").read_text())
        truths = {name: judging.Trajectory.read(folder / f"{name}.truth.tum") for name in ("alpha", "beta")}
        off = placing.of_team(judging.team_of(out, {}), truths).get(("alpha", "beta"))
        rows[f"both senses, seed {seed}, {sensor}"] = {"maps": summary["team"]["components"], "off_m": off and off[0], "off_deg": off and off[1], "cpu_s": done.cpu_s}
        wrong = off is not None and off[0] > WRONG_M
        if wrong:
            bench.keep_pictures(out, f"both-{seed}-{sensor}")
        if sensor != "laser":
            bench.gate("vision", f"camera and laser, seed {seed}, mapped with {sensor}: maps", summary["team"]["components"], "1", summary["team"]["components"] == 1)
        bench.gate("vision", f"camera and laser, seed {seed}, mapped with {sensor}: {summary['team']['components']} maps, off by", "-" if off is None else f"{off[0]:.3f} m", f"{WRONG_M} m", not wrong)
    return rows


def run(bench):
    rows = {}
    chosen = bench.arguments.vision

    def attempt(name, work):
        try:
            made = work()
            rows.update(made)
            bench.keep("vision", made)
        except Failed as failed:
            bench.gate("vision", name, failed, "a result", False)
    for name in team_visual.SEQUENCES:
        if name in chosen:
            attempt(name, lambda name=name: {name: sequence(bench, name)})
    for name in team_visual.TEAMS:
        if name in chosen:
            attempt(name, lambda name=name: {name: team(bench, name)})
    if "both" in chosen:
        for seed in range(7, 7 + bench.arguments.vision_seeds):
            attempt("both", lambda seed=seed: both_senses(bench, seed))
    bench.table("vision", "Camera teams", ("what", "numbers"), [(name, ", ".join(f"{key} {value}" for key, value in row.items() if isinstance(value, (int, float, bool)))) for name, row in rows.items()])
