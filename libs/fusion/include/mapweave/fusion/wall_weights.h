#pragma once
// How walls that speak against a hypothesis are weighed: the same where merges are decided and where they are
// explained.

namespace mapweave::fusion {

constexpr double kContradictionWeight = 4.0;  // a metre that the other map saw through, in metres that coincide
constexpr double kUnclearWeight =
    2.0;  // a metre that stands close beside the other map's walls, in metres that fit nowhere around

// Metres of wall that two hypotheses of one pair are compared by.
constexpr double fit_m(double coinciding_m, double unclear_m, double contradicted_m) {
  return coinciding_m - unclear_m - kContradictionWeight * contradicted_m;
}

}  // namespace mapweave::fusion
