"""reliability: of the best alignments of all pairs of maps that the parts rooms, strangers and overlap judged, how many are right, by the
probability that the verdict gives. Rooms of seeds 1 to 20 helped to set the weights: --seeds beyond these, strangers and overlap did not."""

SOURCES = {"rooms": "small simulated rooms", "strangers": "strangers, and stretches of one building", "overlap": "stretches of real logs that overlap"}
EDGES = (0.0, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 1.0)
LEAST = 20          # pairs of a bin that is judged
SLACK = 0.05        # by which fewer may be right than the bin's lower edge says


def run(bench):
    parts = bench.stored_parts()
    beliefs = [belief for part in SOURCES for row in parts.get(part, {}).get("rows", {}).values() for belief in row.get("beliefs", [])]
    lines = []
    for low, high in zip(EDGES, EDGES[1:]):
        some = [right for probability, right in beliefs if low <= probability < high or (high == 1.0 and probability == 1.0)]
        lines.append((f"{low:g} to {high:g}", len(some), sum(some), f"{100 * sum(some) / len(some):.1f} %" if some else "-"))
        if len(some) >= LEAST and low >= 0.5:
            bench.gate("reliability", f"right of those of probability {low:g} to {high:g}", f"{sum(some)} of {len(some)}", f"{100 * (low - SLACK):g} %",
                       sum(some) >= (low - SLACK) * len(some))
    bench.table("reliability", "Best alignments that are right, by the probability that the verdict gives", ("probability", "pairs", "right", "share"), lines)
    bench.gate("reliability", "pairs", len(beliefs), 200, len(beliefs) >= 200)
