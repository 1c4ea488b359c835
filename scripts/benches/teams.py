"""teams that can be trusted: right on any log, or apart; what they cost; what their verdicts do not depend on

Needs the program (scripts/build; vision also team_benchmark) and laser/ below MAPWEAVE_DATA (default ../shared/data). Parts:
  teams      logs cut into 2 to 6 robots, equal and seeded cuts: right, wrong or apart by hand-checked relations
  rooms      RecSLAM's small rooms: one map in every run, within a centimetre
  visits     three real visits to one hall
  strangers  maps that share nothing: none joined
  overlap    how often two maps are joined rightly, by how much they share
  cost       ten robots of the paper; four robots against mapping them alone; time and memory against the number of robots
  mirror     every log and grid with its mirror image: none joined
  vision     camera teams as they were
  names      verdicts do not depend on names, order, threads or where odometry begins
  halmstad   grids of other makers
  reliability  how often verdicts of rooms, strangers and overlap are right, by their probability: what those parts kept
Robots' own maps are made once and kept (out/bench/teams/maps). Writes tables between <!-- bench:trust --> and <!-- /bench --> of datasets/RESULTS.md. Rows go to
out/bench/teams.json; a partial run keeps the others, and tables of parts that were not run stay as they are. Pictures of every
wrong or apart pair: out/bench/teams/pictures. Exit code 5 where a goal is missed. Everything takes hours; every part can be run by itself and in part.
"""
import importlib
import pathlib
import re

from benches import common
from benches.team_bench import inputs

PARTS = {"teams": "cut_teams", "rooms": "small_rooms", "visits": "visits", "strangers": "strangers", "overlap": "overlaps", "cost": "costs", "mirror": "mirror_images",
         "vision": "vision", "names": "names", "halmstad": "halmstad", "reliability": "reliability"}
MAPS = {"maps": "cut_maps"}   # makes what `teams` needs, measures nothing
VISION = ("tum_fr1_rpy", "hololens_office_part1", "apartment-3", "apartment-8", "single-camera", "another-day", "repeated-rooms-100", "both")
COST = ("ten", "four", "cuts", "floor")


def some(known, what):
    def parse(text):
        chosen = [name.strip() for name in text.split(",") if name.strip()]
        for name in chosen:
            if name not in known:
                common.give_up(f"unknown {what} '{name}'; known: {', '.join(known)}", 2)
        return chosen
    return parse


def numbers(text):
    return [int(number) for number in text.split(",")]


def add_arguments(parser):
    every = (*inputs.BENCHMARK_LOGS, *inputs.CORRECTED_LOGS)
    parser.add_argument("--part", default=list(PARTS), type=some({**PARTS, **MAPS}, "part"), metavar="NAME,...", help=f"default: all of {','.join(PARTS)}; maps: only make robots' maps")
    parser.add_argument("--logs", type=some((*every, *inputs.VISITS), "log"), metavar="NAME,...", help=f"default: all of {','.join(every)}")
    parser.add_argument("--robots", default=[2, 3, 4, 5, 6], type=numbers, metavar="N,...", help="teams: of so many (default: 2 to 6)")
    parser.add_argument("--cuts", default=10, type=int, metavar="N", help="teams: seeded random cuts beside the equal parts (default: %(default)s)")
    parser.add_argument("--no-equal", action="store_true", help="teams: no equal parts")
    parser.add_argument("--overlap", default=0.0, type=float, metavar="SECONDS", help="teams: every cut once more with so many common seconds on either side")
    parser.add_argument("--whole", action="store_true", help="teams: each also by `run` with two edges: the verdicts must be the same")
    parser.add_argument("--no-single", action="store_true", help="teams: do not compare with the log as one robot")
    parser.add_argument("--seeds", default=20, type=int, metavar="N", help="rooms: of each scene (default: %(default)s)")
    parser.add_argument("--pairs", default=20000, type=int, metavar="N", help="strangers: how many (default: %(default)s)")
    parser.add_argument("--overlap-pairs", default=200, type=int, metavar="N", help="overlap: pairs a level (default: %(default)s)")
    parser.add_argument("--halmstad-pairs", default=0, type=int, metavar="N", help="halmstad: the first N pairs; 0: all")
    parser.add_argument("--halmstad-resolution", default=0.02, type=float, metavar="M", help="halmstad: metres a pixel, which the data set does not say (default: %(default)s)")
    parser.add_argument("--halmstad-positives", action="store_true", help="halmstad: leave out the pairs that must not join")
    parser.add_argument("--cost", default=list(COST), type=some(COST, "cost"), metavar="NAME,...", help=f"cost: default: all of {','.join(COST)}")
    parser.add_argument("--curve", default=[5, 10, 20, 40], type=numbers, metavar="N,...", help="cost: numbers of robots (default: 5,10,20,40)")
    parser.add_argument("--vision", default=list(VISION), type=some(VISION, "team"), metavar="NAME,...", help=f"vision: default: all of {','.join(VISION)}")
    parser.add_argument("--vision-seeds", default=3, type=int, metavar="N", help="vision: (default: %(default)s)")
    parser.add_argument("--jobs", default=1, type=int, metavar="N", help="runs side by side, one thread each (default: %(default)s)")
    parser.add_argument("--program", default=common.PROGRAM, type=pathlib.Path, metavar="FILE", help="another mapweave")
    parser.add_argument("--program-stamp", metavar="TEXT", help="of the program that made the stored maps (default: its checksum)")
    parser.add_argument("--keep-maps", action="store_true", help="stored maps of robots are used though the program is another one")
    parser.add_argument("--maps", metavar="DIR", help="where they are stored (default: out/bench/teams/maps)")
    parser.add_argument("--out", default=common.OUT, type=pathlib.Path, metavar="DIR", help="default: out/bench")
    parser.add_argument("--dry-run", action="store_true", help="leave RESULTS.md and README.md as they are")
    parser.add_argument("--no-pictures", action="store_true", help="of teams that are wrong or apart")


def tables_of(text):
    """{title: table} of what stands in RESULTS.md: parts that were not run, here or ever on this machine, stay."""
    return {title: table.strip() for title, table in re.findall(r"^([^|\n][^\n]*):\n\n((?:\|[^\n]*\n)+)", text, re.MULTILINE)}


def run(arguments):
    from benches.team_bench.bench import Bench
    arguments.logs_chosen = arguments.logs is not None
    arguments.logs = arguments.logs or [*inputs.BENCHMARK_LOGS, *inputs.CORRECTED_LOGS]
    common.PROGRAM, common.OUT = arguments.program.resolve(), arguments.out.resolve()
    arguments.out = common.OUT
    bench = Bench(arguments)
    for part in arguments.part:
        importlib.import_module("benches.team_bench." + {**PARTS, **MAPS}[part]).run(bench)
    tables = {**tables_of(common.results_text("trust")), **bench.tables(PARTS)}
    if not arguments.dry_run:
        text = "\n\n".join(f"{title}:\n\n{table}" for title, table in tables.items())
        common.write_results("trust", text + f"\n\nMeasured by `scripts/bench teams` on {common.machine()}.")
    for line in bench.missed:
        print("missed:", line)
    return 5 if bench.missed else 0
