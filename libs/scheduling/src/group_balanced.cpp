#include <mapweave/scheduling/grouping.h>

#include "contracted_graph.h"
#include "grow_groups.h"
#include "tabu_search.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace mapweave::scheduling {
namespace {

// Groups that differ by one robot may change places; the others keep their sizes.
std::vector<SizeBounds> bounds_of(const std::vector<std::uint32_t>& sizes) {
  std::vector<SizeBounds> bounds;
  const std::int64_t most = sizes.front();
  const bool some_smaller = std::find(sizes.begin(), sizes.end(), most - 1) != sizes.end();
  for (const std::int64_t size : sizes)
    bounds.push_back(size >= most - 1 ? SizeBounds{some_smaller ? most - 1 : most, most} : SizeBounds{size, size});
  return bounds;
}

struct Candidate {
  GroupOf group_of;
  std::int64_t cut = 0;
};

// How a grouping is made. Few robots: many short tries reach more than few long ones do.
struct Habits {
  std::uint32_t few_vertices;                   // contracting fewer brings nothing
  std::uint32_t tries;                          // on the smallest graph
  std::uint32_t patience, vertices_for_a_step;  // steps that may bring nothing: patience and one for so many vertices
  std::uint32_t fresh;                          // one in so many begins anew
};

class Search {
 public:
  Search(const ContractedGraph& graph, const std::vector<std::uint32_t>& sizes, const GroupingOptions& options)
      : graph_(graph),
        bounds_(bounds_of(sizes)),
        random_(options.seed),
        habits_(graph.size() <= kSmall ? Habits{16, 1, 10, 8, 4} : Habits{30, 3, 20, 4, 2}),
        budget_(budget(options.effort)) {}

  GroupOf run(const std::vector<GroupOf>& starts) {
    std::vector<Candidate> kept{cycle(std::vector<std::uint32_t>(graph_.size(), 0), nullptr)};
    for (const GroupOf& start : starts) kept.push_back(searched(start));
    std::stable_sort(kept.begin(), kept.end(), [](const Candidate& a, const Candidate& b) { return a.cut < b.cut; });
    while (spent_ < budget_) {
      const Candidate found = kept.size() < kKept || random_.below(habits_.fresh) == 0
                                  ? cycle(std::vector<std::uint32_t>(graph_.size(), 0), nullptr)
                                  : recombine(kept);
      const bool known =
          std::any_of(kept.begin(), kept.end(), [&](const Candidate& one) { return one.cut == found.cut; });
      if (kept.size() < kKept)
        kept.push_back(found);
      else if (!known && found.cut < kept.back().cut)
        kept.back() = found;
      std::stable_sort(kept.begin(), kept.end(), [](const Candidate& a, const Candidate& b) { return a.cut < b.cut; });
    }
    return kept.front().group_of;
  }

 private:
  static constexpr std::size_t kKept = 4;       // groupings: fewer grow alike, more take the budget from the best
  static constexpr std::uint32_t kSmall = 100;  // robots, up to which habits are those of few
  static constexpr std::uint32_t kMostDisturbed = 30;  // vertices that a try moves: more of them begin anew

  // In units of TabuSearch, of which there are about 400 to 600 in a microsecond; between these numbers of robots, by
  // powers.
  std::uint64_t budget(double effort) const {
    constexpr std::pair<double, double> kBudgets[] = {{2, 1e3},     {10, 2e4},     {20, 2.4e5},
                                                      {50, 2.6e5},  {100, 2.5e6},  {200, 10e6},
                                                      {1000, 16e6}, {10'000, 9e8}, {100'000, 2e10}};
    std::size_t i = 1;
    while (i + 1 < std::size(kBudgets) && graph_.size() > kBudgets[i].first) ++i;
    const auto [robots, units] = kBudgets[i - 1];
    const double power = std::log(kBudgets[i].second / units) / std::log(kBudgets[i].first / robots);
    return static_cast<std::uint64_t>(effort * units * std::pow(graph_.size() / robots, power));
  }

  Candidate searched(const GroupOf& start) {
    TabuSearch search(graph_, bounds_, start, random_);
    search.rebalance();
    search.search(budget_ / 8, habits_.patience + graph_.size() / habits_.vertices_for_a_step);
    constexpr std::uint64_t kMaking = 12;  // of a start, per pair of robots
    spent_ += search.spent() + kMaking * graph_.size() * graph_.size();
    return {search.group_of(), search.cut()};
  }

  // What two of the kept ones have in common is contracted, then the better one is searched on.
  Candidate recombine(const std::vector<Candidate>& kept) {
    const std::uint32_t a = random_.below(kKept), b = random_.below(kKept);
    const auto groups = static_cast<std::uint32_t>(bounds_.size());
    std::vector<std::uint32_t> labels(graph_.size());
    for (std::uint32_t v = 0; v < graph_.size(); ++v) labels[v] = kept[a].group_of[v] * groups + kept[b].group_of[v];
    return cycle(std::move(labels), &kept[std::min(a, b)].group_of);
  }

  // Contracts pairs of one label, level by level; groups the coarsest graph (or goes on from `start`, which labels
  // refine); searches on the way back.
  Candidate cycle(std::vector<std::uint32_t> labels, const GroupOf* start) {
    std::vector<Contraction> levels;
    const auto groups = static_cast<std::uint32_t>(bounds_.size());
    const std::uint32_t enough = std::max(habits_.few_vertices, 6 * groups);
    const std::uint32_t heaviest = 1 + 3 * graph_.size() / (2 * enough);
    GroupOf group_of = start != nullptr ? *start : GroupOf();
    const ContractedGraph* graph = &graph_;
    std::vector<const ContractedGraph*> graphs{graph};
    levels.reserve(64);  // graphs point into it
    while (graph->size() > enough && levels.size() < 64 && !is_dense(*graph)) {
      Contraction next = contract(*graph, labels, heaviest, random_);
      spent_ += 4 * graph->links.size() + 30 * graph->size();
      if (next.graph.size() > 0.9 * graph->size()) break;
      std::vector<std::uint32_t> coarse_labels(next.graph.size()),
          coarse_groups(start != nullptr ? next.graph.size() : 0);
      for (std::uint32_t v = 0; v < graph->size(); ++v) {
        coarse_labels[next.vertex_of[v]] = labels[v];
        if (start != nullptr) coarse_groups[next.vertex_of[v]] = group_of[v];
      }
      labels = std::move(coarse_labels);
      group_of = std::move(coarse_groups);
      levels.push_back(std::move(next));
      graph = &levels.back().graph;
      graphs.push_back(graph);
    }
    Candidate result;
    for (std::uint32_t tries = start != nullptr || graphs.size() == 1 ? 0 : habits_.tries; tries > 0; --tries) {
      TabuSearch search(*graph, loosened(*graph), grow_groups(*graph, bounds_, random_), random_);
      search.rebalance();
      search.search(budget_ / 8, habits_.patience + graph->size());
      spent_ += search.spent() + std::uint64_t{graph->size()} * graph->size() + graph->links.size();
      if (!group_of.empty() && search.cut() >= result.cut) continue;
      result.cut = search.cut();
      group_of = search.group_of();
    }
    if (group_of.empty()) {
      group_of = grow_groups(*graph, bounds_, random_);
      spent_ += std::uint64_t{graph->size()} * graph->size() + graph->links.size();
    }
    for (std::size_t level = graphs.size(); level-- > 0;) {
      const ContractedGraph& at = *graphs[level];
      if (level + 1 < graphs.size()) {
        GroupOf finer(at.size());
        for (std::uint32_t v = 0; v < at.size(); ++v) finer[v] = group_of[levels[level].vertex_of[v]];
        group_of = std::move(finer);
      }
      TabuSearch search(at, loosened(at), std::move(group_of), random_);
      search.rebalance();
      if (start != nullptr && level + 1 == graphs.size())
        search.disturb(1 + random_.below(std::clamp(at.size() / 8, 2u, kMostDisturbed)));
      search.search(budget_ / 8, habits_.patience + at.size() / habits_.vertices_for_a_step);
      spent_ += search.spent();
      group_of = search.group_of();
      result.cut = search.cut();
    }
    result.group_of = std::move(group_of);
    return result;
  }

  // Where nearly all are linked, pairs of vertices say little of groups: one time in four is enough.
  bool is_dense(const ContractedGraph& graph) {
    const double share = static_cast<double>(graph.links.size()) / graph.size() / graph.size();
    return share > 0.1 && random_.below(4) != 0;
  }

  // A vertex of several robots needs room to move.
  std::vector<SizeBounds> loosened(const ContractedGraph& graph) const {
    std::vector<SizeBounds> bounds = bounds_;
    if (graph.most_robots > 1)
      for (SizeBounds& bound : bounds) {
        const std::int64_t room = std::min<std::int64_t>(graph.most_robots, 1 + bound.high / 50);
        bound.low = std::max<std::int64_t>(0, bound.low - room);
        bound.high += room;
      }
    return bounds;
  }

  const ContractedGraph& graph_;
  const std::vector<SizeBounds> bounds_;
  RandomBits random_;
  const Habits habits_;
  const std::uint64_t budget_;
  std::uint64_t spent_ = 0;
};

// Tables of robots by groups, and of groups by groups, are to stay below about a hundred megabytes.
bool is_large(std::size_t robots, std::size_t groups) { return groups > 512 || robots * groups > std::size_t{1} << 24; }

// Of many groups: first a few parts of as many robots as their groups take, then each part by itself.
GroupOf group_by_parts(const OverlapGraph& graph, const std::vector<std::uint32_t>& sizes,
                       const GroupingOptions& options) {
  const std::size_t parts = std::min<std::size_t>(16, (sizes.size() + 1) / 2);
  std::vector<std::vector<std::uint32_t>> sizes_of(parts);
  for (std::size_t i = 0; i < sizes.size(); ++i) sizes_of[i % parts].push_back(sizes[i]);
  const auto sum = [](const std::vector<std::uint32_t>& some) {
    return std::accumulate(some.begin(), some.end(), std::uint32_t{0});
  };
  std::stable_sort(sizes_of.begin(), sizes_of.end(), [&](const auto& a, const auto& b) { return sum(a) > sum(b); });
  std::vector<std::uint32_t> sums;
  for (const auto& some : sizes_of) sums.push_back(sum(some));
  const GroupOf part_of = group_balanced(graph, sums, options);
  std::vector<std::vector<std::uint32_t>> members(parts);
  for (std::uint32_t v = 0; v < graph.size(); ++v) members[part_of[v]].push_back(v);
  std::stable_sort(members.begin(), members.end(), [](const auto& a, const auto& b) { return a.size() > b.size(); });
  GroupOf group_of(graph.size());
  std::vector<std::uint32_t> place(graph.size());
  std::uint32_t first_group = 0;
  for (std::size_t part = 0; part < parts; ++part) {
    for (std::uint32_t i = 0; i < members[part].size(); ++i) {
      group_of[members[part][i]] = ~std::uint32_t{0};  // of this part, not grouped yet
      place[members[part][i]] = i;
    }
    std::vector<OverlapLink> links;
    for (const std::uint32_t v : members[part])
      for (const Neighbour& neighbour : graph.neighbours(v))
        if (neighbour.vertex > v && group_of[neighbour.vertex] == ~std::uint32_t{0})
          links.push_back({place[v], place[neighbour.vertex], neighbour.weight});
    const GroupOf within = group_balanced(OverlapGraph(members[part].size(), links), sizes_of[part], options);
    for (std::uint32_t i = 0; i < members[part].size(); ++i) group_of[members[part][i]] = first_group + within[i];
    first_group += static_cast<std::uint32_t>(sizes_of[part].size());
  }
  return group_of;
}

}  // namespace

double cut_weight(const OverlapGraph& graph, const GroupOf& group_of) {
  double cut = 0.0;
  for (std::uint32_t v = 0; v < graph.size(); ++v)
    for (const Neighbour& neighbour : graph.neighbours(v))
      if (neighbour.vertex > v && group_of[neighbour.vertex] != group_of[v]) cut += neighbour.weight;
  return cut;
}

double in_group_weight(const OverlapGraph& graph, const GroupOf& group_of) {
  double kept = 0.0;
  for (std::uint32_t v = 0; v < graph.size(); ++v)
    for (const Neighbour& neighbour : graph.neighbours(v))
      if (neighbour.vertex > v && group_of[neighbour.vertex] == group_of[v]) kept += neighbour.weight;
  return kept;
}

GroupOf group_balanced(const OverlapGraph& overlaps, const std::vector<std::uint32_t>& sizes,
                       const GroupingOptions& options) {
  MAPWEAVE_EXPECT(std::accumulate(sizes.begin(), sizes.end(), std::size_t{0}) == overlaps.size(),
                  "the groups take all vertices");
  GroupOf group_of(overlaps.size(), 0);
  if (sizes.size() <= 1) return group_of;
  if (sizes.front() == 1) {
    std::iota(group_of.begin(), group_of.end(), 0u);
    return group_of;
  }
  if (is_large(overlaps.size(), sizes.size())) return group_by_parts(overlaps, sizes, options);
  constexpr std::size_t kExactly = 10;  // which takes no longer
  if (overlaps.size() <= kExactly) return group_exactly(overlaps, sizes);
  // What others find is cheap on small graphs, and then never better than what is found from there.
  constexpr std::size_t kFew = 40;
  std::vector<GroupOf> starts;
  if (overlaps.size() <= kFew)
    starts = {group_greedy(overlaps, sizes), group_recslam(overlaps, static_cast<std::uint32_t>(sizes.size()))};
  const ContractedGraph graph = contracted(overlaps);
  return Search(graph, sizes, options).run(starts);
}

}  // namespace mapweave::scheduling
