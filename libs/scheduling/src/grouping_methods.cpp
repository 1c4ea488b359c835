// What the default is compared with: RecSLAM's algorithms, its greedy and random comparisons, the exact answer.

#include <mapweave/scheduling/grouping.h>

#include "contracted_graph.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <limits>
#include <numeric>

namespace mapweave::scheduling {
namespace {

constexpr std::uint32_t kNobody = ~std::uint32_t{0};
using Links = std::vector<double>;  // [vertex * groups + group]: what a vertex is linked to in a group

Links links_to_groups(const OverlapGraph& graph, const GroupOf& group_of, std::uint32_t groups) {
  Links linked(graph.size() * groups, 0.0);
  for (std::uint32_t v = 0; v < graph.size(); ++v)
    for (const Neighbour& neighbour : graph.neighbours(v))
      linked[std::size_t{v} * groups + group_of[neighbour.vertex]] += neighbour.weight;
  return linked;
}

void swap_groups(const OverlapGraph& graph, std::uint32_t a, std::uint32_t b, std::uint32_t groups, GroupOf& group_of,
                 Links& linked) {
  const std::uint32_t of_a = group_of[a], of_b = group_of[b];
  for (const auto& [vertex, sign] : {std::pair(a, 1.0), {b, -1.0}})
    for (const Neighbour& neighbour : graph.neighbours(vertex)) {
      linked[std::size_t{neighbour.vertex} * groups + of_a] -= sign * neighbour.weight;
      linked[std::size_t{neighbour.vertex} * groups + of_b] += sign * neighbour.weight;
    }
  std::swap(group_of[a], group_of[b]);
}

// By how much the cut shrinks.
double swap_gain(const OverlapGraph& graph, std::uint32_t a, std::uint32_t b, std::uint32_t groups,
                 const GroupOf& group_of, const Links& linked) {
  const std::size_t of_a = group_of[a], of_b = group_of[b], row_a = std::size_t{a} * groups,
                    row_b = std::size_t{b} * groups;
  const double apart = linked[row_a + of_b] - linked[row_a + of_a] + linked[row_b + of_a] - linked[row_b + of_b];
  return apart > 0.0 ? apart - 2.0 * graph.weight(a, b) : apart;  // an upper bound where it cannot gain
}

// Algorithm 1.
GroupOf algorithm_1(const OverlapGraph& graph, std::uint32_t groups) {
  const auto vertices = static_cast<std::uint32_t>(graph.size());
  GroupOf group_of(vertices, groups - 1);  // line 27: who is left
  std::vector<bool> candidate(vertices, true);
  std::uint32_t candidates = vertices;
  bool buffer_is_empty = true;
  std::vector<double> to_candidates(vertices, 0.0);
  std::vector<std::uint32_t> neighbours(vertices, 0);  // among the candidates
  for (std::uint32_t v = 0; v < vertices; ++v) {
    neighbours[v] = static_cast<std::uint32_t>(graph.neighbours(v).size());
    for (const Neighbour& neighbour : graph.neighbours(v)) to_candidates[v] += neighbour.weight;
  }
  Links linked(std::size_t{vertices} * groups, 0.0);
  const auto full = [&] { return std::uint64_t{candidates} * groups <= vertices; };
  for (bool done = groups < 2 || full(); !done;) {
    const bool seeding = buffer_is_empty;
    for (std::uint32_t group = 0; group + 1 < groups && !done; ++group) {
      std::uint32_t chosen = kNobody;
      double most = 0.0;
      for (std::uint32_t v = 0; v < vertices; ++v) {
        if (!candidate[v]) continue;
        const double rank = seeding ? -static_cast<double>(neighbours[v])
                                    : linked[std::size_t{v} * groups + group] - to_candidates[v];  // eq. 5
        if (chosen == kNobody || rank > most) {
          chosen = v;
          most = rank;
        }
      }
      group_of[chosen] = group;
      candidate[chosen] = false;
      --candidates;
      for (const Neighbour& neighbour : graph.neighbours(chosen)) {
        buffer_is_empty = buffer_is_empty && !candidate[neighbour.vertex];
        linked[std::size_t{neighbour.vertex} * groups + group] += neighbour.weight;
        to_candidates[neighbour.vertex] -= neighbour.weight;
        --neighbours[neighbour.vertex];
      }
      done = full();
    }
  }
  return group_of;
}

// Algorithm 2.
GroupOf algorithm_2(const OverlapGraph& graph, std::uint32_t groups, GroupOf group_of, const RecslamOptions& options) {
  const auto vertices = static_cast<std::uint32_t>(graph.size());
  const bool filters = options.search == RecslamSearch::tabu;
  struct Swap {
    double gain;
    std::uint32_t a, b;
  };
  constexpr double kNone = -std::numeric_limits<double>::infinity();
  GroupOf best = group_of, held_best;  // held_best: G_k as printed, the best of all candidates ever made
  double cut = cut_weight(graph, group_of), best_cut = cut, held_cut = std::numeric_limits<double>::infinity();
  std::vector<std::pair<std::uint32_t, std::uint32_t>> tabu;
  for (int iteration = 0; iteration < options.iterations; ++iteration) {
    Links linked = links_to_groups(graph, group_of, groups);
    Swap chosen{kNone, 0, 0};
    for (std::uint32_t a = 0; a < vertices; ++a)
      for (std::uint32_t b = a + 1; b < vertices; ++b) {
        if (group_of[a] == group_of[b]) continue;
        const std::size_t of_a = group_of[a], of_b = group_of[b], row_a = std::size_t{a} * groups,
                          row_b = std::size_t{b} * groups;
        const double apart = linked[row_a + of_b] - linked[row_a + of_a] + linked[row_b + of_a] - linked[row_b + of_b];
        if (apart <= chosen.gain) continue;
        const double gain = apart - 2.0 * graph.weight(a, b);
        if (gain <= chosen.gain) continue;
        const bool passed_over = filters && std::find(tabu.begin(), tabu.end(), std::pair(a, b)) != tabu.end();
        constexpr double kNoise = 1e-12;
        if (passed_over && cut - gain >= best_cut - kNoise) continue;
        chosen = {gain, a, b};
      }
    if (chosen.gain == kNone) break;
    if (filters) {
      swap_groups(graph, chosen.a, chosen.b, groups, group_of, linked);
      cut -= chosen.gain;
      if (const auto listed = std::find(tabu.begin(), tabu.end(), std::pair(chosen.a, chosen.b)); listed != tabu.end())
        tabu.erase(listed);
      tabu.emplace_back(chosen.a, chosen.b);
      if (tabu.size() > static_cast<std::size_t>(options.tabu_length)) tabu.erase(tabu.begin());
    } else {
      // S and G grow and are never cleared: what line 11 finds is the best candidate of all iterations, the first of
      // equals.
      if (cut - chosen.gain >= held_cut)
        break;  // line 24 brings back what is there already: no later iteration can differ
      swap_groups(graph, chosen.a, chosen.b, groups, group_of, linked);
      cut -= chosen.gain;
      held_cut = cut;
    }
    if (cut < best_cut) {
      best_cut = cut;
      best = group_of;
    }
  }
  return best;
}

// Groups of the sizes, in their order, from vertices in theirs.
GroupOf dealt(const std::vector<std::uint32_t>& order, const std::vector<std::uint32_t>& sizes) {
  GroupOf group_of(order.size());
  std::size_t next = 0;
  for (std::uint32_t group = 0; group < sizes.size(); ++group)
    for (std::uint32_t i = 0; i < sizes[group]; ++i) group_of[order[next++]] = group;
  return group_of;
}

std::vector<std::uint32_t> shuffled(std::size_t vertices, std::uint64_t seed) {
  std::vector<std::uint32_t> order(vertices);
  std::iota(order.begin(), order.end(), 0u);
  RandomBits random(seed);
  random.shuffle(order);
  return order;
}

}  // namespace

const std::vector<std::string>& recslam_search_names() {
  static const std::vector<std::string> names{"none", "printed", "tabu"};
  return names;
}

GroupOf group_recslam(const OverlapGraph& graph, std::uint32_t groups, const RecslamOptions& options) {
  MAPWEAVE_EXPECT(groups >= 1, "there is a group");
  GroupOf group_of = algorithm_1(graph, groups);
  if (options.search == RecslamSearch::none) return group_of;
  return algorithm_2(graph, groups, std::move(group_of), options);
}

GroupOf group_randomly(std::size_t vertices, const std::vector<std::uint32_t>& sizes, std::uint64_t seed) {
  MAPWEAVE_EXPECT(std::accumulate(sizes.begin(), sizes.end(), std::size_t{0}) == vertices,
                  "the groups take all vertices");
  return dealt(shuffled(vertices, seed), sizes);
}

GroupOf group_greedy(const OverlapGraph& graph, const std::vector<std::uint32_t>& sizes, std::uint64_t seed) {
  MAPWEAVE_EXPECT(std::accumulate(sizes.begin(), sizes.end(), std::size_t{0}) == graph.size(),
                  "the groups take all vertices");
  const auto groups = static_cast<std::uint32_t>(sizes.size()), vertices = static_cast<std::uint32_t>(graph.size());
  GroupOf group_of(vertices, kNobody);
  std::vector<std::uint32_t> left = sizes;
  const auto order = shuffled(vertices, seed);
  for (std::uint32_t i = 0; i < vertices; ++i) {
    const std::uint32_t v = order[i];
    std::uint32_t chosen = kNobody;
    if (i < groups) {
      chosen = i;
    } else {
      std::vector<double> overlap(groups, 0.0);
      for (const Neighbour& neighbour : graph.neighbours(v))
        if (group_of[neighbour.vertex] != kNobody) overlap[group_of[neighbour.vertex]] += neighbour.weight;
      for (std::uint32_t group = 0; group < groups; ++group)
        if (left[group] > 0 && (chosen == kNobody || overlap[group] > overlap[chosen])) chosen = group;
    }
    group_of[v] = chosen;
    --left[chosen];
  }
  Links linked = links_to_groups(graph, group_of, groups);
  for (const std::uint32_t v : order) {
    double most = 0.0;
    std::uint32_t chosen = kNobody;
    for (std::uint32_t u = 0; u < vertices; ++u) {
      if (group_of[u] == group_of[v]) continue;
      if (const double gain = swap_gain(graph, v, u, groups, group_of, linked); gain > most) {
        most = gain;
        chosen = u;
      }
    }
    if (chosen != kNobody) swap_groups(graph, v, chosen, groups, group_of, linked);
  }
  return group_of;
}

GroupOf group_exactly(const OverlapGraph& graph, const std::vector<std::uint32_t>& sizes) {
  const auto vertices = static_cast<std::uint32_t>(graph.size());
  MAPWEAVE_EXPECT(vertices <= kMostExact, "exact groupings are for few vertices");
  MAPWEAVE_EXPECT(std::accumulate(sizes.begin(), sizes.end(), 0u) == vertices, "the groups take all vertices");
  const std::uint32_t sets = 1u << vertices;
  std::vector<double> inside(sets, 0.0);  // weight of the links within a set
  for (std::uint32_t set = 1; set < sets; ++set) {
    const auto top = static_cast<std::uint32_t>(31 - __builtin_clz(set));
    inside[set] = inside[set ^ (1u << top)];
    for (const Neighbour& neighbour : graph.neighbours(top))
      if (neighbour.vertex < top && (set >> neighbour.vertex & 1u) != 0) inside[set] += neighbour.weight;
  }
  // most[set]: of the first groups, where they take exactly this set; taken[set]: what the last of them took. How many
  // robots a set holds says how many groups there are.
  std::vector<double> most(sets, -1.0);
  std::vector<std::uint32_t> taken(sets, 0), reached{0};
  most[0] = 0.0;
  for (const std::uint32_t size : sizes) {
    std::vector<std::uint32_t> next;
    const bool all_alike =
        size == sizes.back();  // from here on: then who comes first of those who are left may as well be in this group
    for (const std::uint32_t set : reached) {
      std::vector<std::uint32_t> rest;
      for (std::uint32_t v = 0; v < vertices; ++v)
        if ((set >> v & 1u) == 0) rest.push_back(v);
      const std::uint32_t first = all_alike ? 1u << rest.front() : 0u, chosen = size - (all_alike ? 1 : 0);
      if (all_alike) rest.erase(rest.begin());
      // All subsets of `rest` of this size (Gosper's hack), spread over the vertices that are left.
      for (std::uint32_t pick = (1u << chosen) - 1; pick < (1u << rest.size());) {
        std::uint32_t group = first;
        for (std::uint32_t bits = pick; bits != 0; bits &= bits - 1)
          group |= 1u << rest[static_cast<std::size_t>(__builtin_ctz(bits))];
        const std::uint32_t together = set | group;
        if (most[together] < 0.0) next.push_back(together);
        if (const double weight = most[set] + inside[group]; weight > most[together]) {
          most[together] = weight;
          taken[together] = group;
        }
        if (pick == 0) break;
        const std::uint32_t low = pick & -pick, ripple = pick + low;
        pick = (((ripple ^ pick) >> 2) / low) | ripple;
      }
    }
    reached = std::move(next);
  }
  GroupOf group_of(vertices, 0);
  std::uint32_t set = sets - 1;
  for (auto group = static_cast<std::uint32_t>(sizes.size()); group-- > 0; set ^= taken[set])
    for (std::uint32_t v = 0; v < vertices; ++v)
      if ((taken[set] >> v & 1u) != 0) group_of[v] = group;
  return group_of;
}

}  // namespace mapweave::scheduling
