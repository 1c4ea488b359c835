#include <mapweave/scheduling/grouping.h>

#include "contracted_graph.h"
#include "tabu_search.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <numeric>

#if MAPWEAVE_HAVE_METIS
#include <metis.h>
#endif

namespace mapweave::scheduling {

#if MAPWEAVE_HAVE_METIS

std::optional<GroupOf> group_with_metis(const OverlapGraph& overlaps, const std::vector<std::uint32_t>& sizes,
                                        std::uint64_t seed) {
  ContractedGraph graph = contracted(overlaps);
  if (sizes.size() <= 1 || sizes.front() == 1)
    return group_balanced(overlaps, sizes);  // nothing to decide, and METIS complains on standard output
  std::vector<idx_t> begin(graph.begin.begin(), graph.begin.end()), to, weights;
  for (const auto& link : graph.links) {
    to.push_back(static_cast<idx_t>(link.to));
    weights.push_back(link.weight);
  }
  std::optional<GroupOf> best;
  for (const bool recursive : {true, false}) {
    auto vertices = static_cast<idx_t>(graph.size()), constraints = idx_t{1}, groups = static_cast<idx_t>(sizes.size()),
         cut = idx_t{0};
    std::vector<idx_t> options(METIS_NOPTIONS), parts(graph.size(), 0);
    METIS_SetDefaultOptions(options.data());
    options[METIS_OPTION_UFACTOR] = 1;
    options[METIS_OPTION_SEED] = static_cast<idx_t>(seed & 0x7fffffff);
    const auto divide = recursive ? METIS_PartGraphRecursive : METIS_PartGraphKway;
    const int status = divide(&vertices, &constraints, begin.data(), to.data(), nullptr, nullptr, weights.data(),
                              &groups, nullptr, nullptr, options.data(), &cut, parts.data());
    if (status != METIS_OK) continue;
    RandomBits random(
        seed);  // even groups were asked for, since METIS fails at very uneven ones: what capacities change is repaired
    std::vector<std::uint32_t> by_size(sizes.size());
    std::iota(by_size.begin(), by_size.end(), 0u);
    std::stable_sort(by_size.begin(), by_size.end(), [&](std::uint32_t a, std::uint32_t b) {
      return std::count(parts.begin(), parts.end(), static_cast<idx_t>(a)) >
             std::count(parts.begin(), parts.end(), static_cast<idx_t>(b));
    });
    std::vector<SizeBounds> bounds(sizes.size());
    for (std::size_t i = 0; i < sizes.size(); ++i) bounds[by_size[i]] = {sizes[i], sizes[i]};
    TabuSearch repair(graph, bounds, GroupOf(parts.begin(), parts.end()), random);
    repair.rebalance();
    if (!best || cut_weight(overlaps, repair.group_of()) < cut_weight(overlaps, *best)) best = repair.group_of();
  }
  if (!best) throw Error(ErrorCode::kInternal, "METIS refused the graph", "", "choose another method");
  return best;
}

#else

std::optional<GroupOf> group_with_metis(const OverlapGraph&, const std::vector<std::uint32_t>&, std::uint64_t) {
  return std::nullopt;
}

#endif

}  // namespace mapweave::scheduling
