#pragma once
// Robots that share much in one group, groups of given sizes (RecSLAM IV-B): the cut, that is the weight of links
// between groups, is to be small. Pure functions; thread-safe. Results depend on graph, sizes and seed alone: budgets
// count work, never time.

#include <mapweave/scheduling/overlap_graph.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::scheduling {

using GroupOf = std::vector<std::uint32_t>;  // by vertex

double cut_weight(const OverlapGraph&, const GroupOf&);       // each link once
double in_group_weight(const OverlapGraph&, const GroupOf&);  // each link once

// `sizes` of the functions below: how many vertices the groups take, largest first, none of them 0; together all
// vertices (else ContractViolation). Group i of the result need not be of size sizes[i]: what is kept is how many
// groups there are of each size.

struct GroupingOptions {
  std::uint64_t seed = 1;
  double effort = 1.0;  // of the search, relative to the default; 0: what the first start gives
};

// The default: multilevel (heavy links first), greedy growing from spread seeds, tabu search with incremental gains on
// every level, and recombination: links that two good groupings both keep are contracted and the search begins again on
// what is left. Ten vertices or fewer: exact.
GroupOf group_balanced(const OverlapGraph&, const std::vector<std::uint32_t>& sizes, const GroupingOptions& = {});

// How RecSLAM's first groups are improved (Algorithm 2).
enum class RecslamSearch {
  none,     // not at all: Algorithm 1 alone
  printed,  // as the listing is printed, whose tabu list is written and never read
  tabu  // as its text means it: swaps are tried anew in each iteration, and those in the list are passed over unless
        // they lead to the best so far
};
const std::vector<std::string>& recslam_search_names();  // in the order of RecslamSearch

// RecSLAM: Algorithms 1 and 2 (DECISIONS.md has each reading). Sizes are the algorithm's own: within one for any number
// of groups.
struct RecslamOptions {
  RecslamSearch search = RecslamSearch::printed;
  int iterations = 40;   // kappa, which the paper leaves open
  int tabu_length = 10;  // tau, likewise; 0: no swap is passed over
  template <class Visitor>
  void describe(Visitor& v) {
    v.choice(
        "search", search,
        {{"none", RecslamSearch::none}, {"printed", RecslamSearch::printed}, {"tabu", RecslamSearch::tabu}},
        "how method recslam improves its first groups: none; printed: Algorithm 2 as its listing is printed, whose "
        "tabu list is never read; tabu: Algorithm 2 as its text means it, where the list forbids swaps");
    v.integer("kappa", iterations, 0, 1000000, "iterations of Algorithm 2; larger values search longer");
    v.integer("tau", tabu_length, 0, 1000000,
              "swaps that the tabu list of Algorithm 2 holds; larger values forbid the last swaps for longer");
  }
};
GroupOf group_recslam(const OverlapGraph&, std::uint32_t groups, const RecslamOptions& = {});

// RecSLAM's comparison (VI-B): random seeds, then each robot to the group it overlaps most, then one round of swaps.
GroupOf group_greedy(const OverlapGraph&, const std::vector<std::uint32_t>& sizes, std::uint64_t seed = 1);
GroupOf group_randomly(std::size_t vertices, const std::vector<std::uint32_t>& sizes, std::uint64_t seed = 1);
// METIS 5 (ufactor 1), the better of its recursive and its k-way form, repaired to the sizes; nullopt where built
// without it.
std::optional<GroupOf> group_with_metis(const OverlapGraph&, const std::vector<std::uint32_t>& sizes,
                                        std::uint64_t seed = 1);
// The least cut there is, by dynamic programming over subsets: up to kMostExact vertices, else ContractViolation. Some
// ten milliseconds.
constexpr std::size_t kMostExact = 16;
GroupOf group_exactly(const OverlapGraph&, const std::vector<std::uint32_t>& sizes);

}  // namespace mapweave::scheduling
