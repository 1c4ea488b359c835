#pragma once
// How walls that speak against a hypothesis are weighed: the same where merges are decided and where they are
// explained.

namespace mapweave::fusion {

constexpr double kContradictionWeight = 4.0;  // a metre that the other map saw through, in metres that coincide
constexpr double kUnclearWeight =
    2.0;  // a metre that stands close beside the other map's walls, in metres that fit nowhere around

// Where rooms are wider in one map than in the other, walls coincide that are not the same: from the first bound on
// they count less, from the second on nothing. Right merges differ by 0.02 m at most, lasers by their own errors.
constexpr double kAsWide_m = 0.03, kOtherWidth_m = 0.05;
// The share of walls that fit which speaks for a hypothesis by which rooms are so much wider.
constexpr double counted_share(double wider_m) {
  const double share = (kOtherWidth_m - (wider_m < 0.0 ? -wider_m : wider_m)) / (kOtherWidth_m - kAsWide_m);
  return share < 0.0 ? 0.0 : share > 1.0 ? 1.0 : share;
}

// Metres of wall that two hypotheses of one pair are compared by.
constexpr double fit_m(double coinciding_m, double unclear_m, double contradicted_m) {
  return coinciding_m - unclear_m - kContradictionWeight * contradicted_m;
}

}  // namespace mapweave::fusion
