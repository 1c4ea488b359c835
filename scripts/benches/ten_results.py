"""the ten results of README.md, taken from datasets/RESULTS.md; measures nothing

Other benches do the same once they have written their tables. Writes the table between <!-- ten results --> and <!-- /ten results --> of README.md.
"""
from benches import common

# What was measured, the result (columns of the table in braces), the bench, the block <!-- bench:NAME -->, the row: columns and what stands in them.
CHOSEN = [
    ("Public log intel (office, 1 laser) cut into 3 robots: error of relations, maps joined", "{relation error, m} m; {maps joined}",
     "accuracy", "accuracy", {"log": "intel", "verb": "run", "robots": "3"}),
    ("mit-killian (250 m of corridors) cut into 6 robots: merges of pairs", "{right} right, {wrong} wrong, {apart} apart of {pairs}",
     "teams", "trust", {"log": "mit-killian", "robots": "6"}),
    ("fr-clinic (outdoors) cut into 3 robots: merges of pairs", "{right} right, {wrong} wrong, {apart} apart of {pairs}",
     "teams", "trust", {"log": "fr-clinic", "robots": "3"}),
    ("Pairs of laser maps that share nothing", "{joined} merged of {pairs of strangers}", "teams", "trust", {"pairs of strangers": None}),
    ("Pairs of laser maps that share 30 % of what they saw", "{right} right, {off} off, {apart} apart of {pairs}",
     "teams", "trust", {"overlap": "30 %"}),
    ("Grids of another program (Halmstad, building E5): merges of pairs", "{right} right, {wrong} wrong, {apart} apart of {pairs}",
     "teams", "trust", {"site": "E5"}),
    ("TUM RGB-D freiburg1_rpy, depth camera: ATE RMSE in metres (least to most of seeds)", "{ATE RMSE, m (least to most of seeds)}",
     "visual", "visual", {"sequence": "tum_fr1_rpy"}),
    ("8 robots with cameras, simulated apartment: ATE of the team (of each robot alone)", "{team, ATE m} m ({each alone, ATE m} m)",
     "team-visual", "teams", {"cameras": "apartment, 8 robots"}),
    ("Camera map server with 16 cameras at the speed of their sensors: load", "{server, cores} cores", "live", "live", {"clients": "16"}),
    ("6 simulated robots on edges: time until their map is complete, against the cloud alone", "{against cloud alone}",
     "recslam", "recslam", {"team": "13 x 18 m, 6 robots"}),
]


def result(template, block, wanted):
    for headers, _, *rows in common.tables_of(block):
        for cells in rows:
            row = dict(zip(headers, cells))
            if all(key in row and value in (None, row[key]) for key, value in wanted.items()):
                return template.format_map(row)
    return "not measured"


def table():
    return common.table(["What was measured", "Result", "By `scripts/bench`"],
                        [(what, result(template, block, wanted), f"`{bench}`") for what, template, bench, block, wanted in CHOSEN])


def write():
    common.replace_between(common.ROOT / "README.md", "<!-- ten results -->\n", "<!-- /ten results -->", table())


def add_arguments(parser):
    parser.add_argument("--dry-run", action="store_true", help="print the table, leave README.md as it is")


def run(arguments):
    print(table())
    if not arguments.dry_run:
        write()
    return 0
