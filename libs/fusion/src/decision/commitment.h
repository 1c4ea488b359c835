#pragma once
// Which statements about two maps are believed together (pairwise consistency maximization: Mangelson et al., ICRA
// 2018): the heaviest set of statements that agree, then the heaviest set of those that contradict all of it, and so
// on. For both senses: cameras believe the first set and take the second for its rival, lasers make a hypothesis of
// whole maps of each.

#include <cstddef>
#include <vector>

namespace mapweave::fusion {

struct CommitmentLimits {
  std::size_t most = 2;          // sets
  double least_weight = 0.0;     // of a set; a lighter one is the last, and left out
  std::size_t budget = 200'000;  // search steps of each set
};

// Numbers of statements, rising.
struct Commitment {
  std::vector<std::size_t> agreeing;
  double weight = 0.0;  // sum over `agreeing`
  std::vector<std::size_t>
      contradicting;  // of those that this set was chosen from, the ones that agree with none of it
};

// agree[i * n + j], symmetric: whether two of n statements may both be right; the diagonal is ignored. weights > 0.
std::vector<Commitment> commit(const std::vector<char>& agree, const std::vector<double>& weights,
                               const CommitmentLimits& limits = {});

// The weight of a judgement. A probability below one half speaks for as little as one half, and none is surer than
// 0.9999.
double log_odds(double probability);

}  // namespace mapweave::fusion
