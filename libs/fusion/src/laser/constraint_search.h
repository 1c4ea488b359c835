#pragma once
// The search for further matches once some are known: where the joint graph says that submaps lie near each other, as
// certainly as it knows. After each solution again, until nothing new is found. The same between robots, and within
// one.

#include "search_candidates.h"

namespace mapweave::fusion {

// Whether two matches contradict each other, given what lies between them in the solved graph (pairwise consistency:
// Mangelson et al., ICRA 2018). Squared error in standard deviations, 3 degrees of freedom. Both lead from the one side
// of the graph to the other.
double inconsistency(const SubmapMatch& one, const SubmapMatch& other, const SolvedSubmaps& from_side,
                     graph::RelativeCovariance& from_covariance, const SolvedSubmaps& to_side,
                     graph::RelativeCovariance& to_covariance);
constexpr double kConsistent = 14.2;  // 99.73 % of what is consistent

struct ConstraintSearchResult {
  std::vector<SubmapMatch> matches;  // that hold: those given and those found
  SolvedSubmaps solved;              // with these
  std::size_t supporting = 0;        // places expected to coincide, and found to
  std::size_t contradicting = 0;     // the same, and found not to
  bool is_hopeless = false;          // given up early: most of what was expected is not there
};
enum class SearchExtent {
  quick,     // gives up early
  thorough,  // does not
  final,     // looks also where the graph hardly knows how two places lie to each other (a loop of hundreds of metres)
  alike      // first looks at places that look alike, wherever the graph has them
};

class ConstraintSearch {
 public:
  ConstraintSearch(const std::vector<PreparedMap>& maps, const SubmapGraph& graph, SubmapJudge& judge)
      : maps_(maps), graph_(graph), judge_(judge) {}

  // `in_scope(i, j)`, i < j: whether a pair of submaps of the members is looked at.
  ConstraintSearchResult run(const std::vector<std::size_t>& members, std::vector<SubmapMatch> matches,
                             const SubmapsInScope& in_scope, int most_rounds, SearchExtent extent);

 private:
  const std::vector<PreparedMap>& maps_;
  const SubmapGraph& graph_;
  SubmapJudge& judge_;
};

}  // namespace mapweave::fusion
