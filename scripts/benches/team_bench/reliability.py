"""reliability: of the best alignments of all pairs of maps that the parts rooms, strangers and overlap judged, how many are right, by the
probability that the verdict gives. Apart: what nobody looked at when the weights were set."""
from benches.team_bench import overlaps

SOURCES = {"rooms": "small simulated rooms", "strangers": "strangers, and stretches of one building", "overlap": "stretches of real logs that overlap"}
EDGES = (0.0, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 1.0)
LEAST = 20          # pairs of a bin that is judged
SLACK = 0.05        # by which fewer may be right than the bin's lower edge says


ROOMS_LOOKED_AT = 20   # seeds


def is_left_out(part, row):
    """Rooms of other seeds, strangers, and stretches of logs of which no stretch was looked at."""
    return {"rooms": lambda: row["seed"] > ROOMS_LOOKED_AT, "strangers": lambda: True, "overlap": lambda: row["log"] in overlaps.NOT_LOOKED_AT}[part]()


def run(bench):
    parts = bench.stored_parts()
    beliefs = [(*belief, is_left_out(part, row)) for part in SOURCES for row in parts.get(part, {}).get("rows", {}).values() for belief in row.get("beliefs", [])]
    lines = []
    for low, high in zip(EDGES, EDGES[1:]):
        here = [belief for belief in beliefs if low <= belief[0] < high or (high == 1.0 and belief[0] == 1.0)]
        some, left_out = [right for _, right, _ in here], [right for _, right, is_left in here if is_left]
        share = lambda found: f"{100 * sum(found) / len(found):.1f} %" if found else "-"
        lines.append((f"{low:g} to {high:g}", len(some), sum(some), share(some), len(left_out), sum(left_out), share(left_out)))
        if len(some) >= LEAST and low >= 0.5:
            bench.gate("reliability", f"right of those of probability {low:g} to {high:g}", f"{sum(some)} of {len(some)}", f"{100 * (low - SLACK):g} %",
                       sum(some) >= (low - SLACK) * len(some))
    bench.table("reliability", "Best alignments that are right, by the probability that the verdict gives", ("probability", "pairs", "right", "share", "left out: pairs", "right", "share"), lines)
    bench.gate("reliability", "pairs", len(beliefs), 200, len(beliefs) >= 200)
