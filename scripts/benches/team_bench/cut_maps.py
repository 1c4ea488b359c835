"""maps: makes the robots' own maps that `teams` merges, and nothing else."""
from benches.team_bench import cut_teams, inputs
from benches.team_bench.program import Failed


def run(bench):
    single = [inputs.Cut(log, 1) for log in bench.arguments.logs]
    for cut, made in bench.side_by_side(bench.store.maps, [*single, *cut_teams.cuts(bench.arguments)]):
        said = made if isinstance(made, Failed) else f"{sum(robot['cpu_s'] for robot in made[1]['robots']):.1f} s"
        print(f"maps of {cut.log} {cut.key()}: {said}", flush=True)
