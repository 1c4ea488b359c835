#include "grid_conflicts.h"

#include <mapweave/core/disjoint_sets.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace mapweave::fusion {

std::vector<PairHypothesis::ContradictedWall> places_of(const std::vector<matching::WallPoint>& walls,
                                                        double sample_m) {
  // Walls this near hang together; shorter pieces are furniture.
  constexpr double kLeastCell_m = 0.2, kLeastLength_m = 0.6;
  const double cell_m = std::max(kLeastCell_m, 2.0 * sample_m);
  std::map<std::pair<long, long>, std::size_t> number_of;  // of the first wall in each cell, by row and column
  DisjointSets together(walls.size());
  for (std::size_t i = 0; i < walls.size(); ++i) {
    const long row = std::lround(std::floor(walls[i].y / cell_m)),
               column = std::lround(std::floor(walls[i].x / cell_m));
    for (long y = row - 1; y <= row + 1; ++y)
      for (long x = column - 1; x <= column + 1; ++x)
        if (const auto neighbour = number_of.find({y, x}); neighbour != number_of.end())
          together.join(neighbour->second, i);
    number_of.emplace(std::make_pair(row, column), i);
  }
  std::map<std::size_t, PairHypothesis::ContradictedWall> sums;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    PairHypothesis::ContradictedWall& sum = sums[together.find(i)];
    sum.x_m += walls[i].x * sample_m;
    sum.y_m += walls[i].y * sample_m;
    sum.length_m += sample_m;
  }
  std::vector<PairHypothesis::ContradictedWall> places;
  for (const auto& entry : sums) {
    const PairHypothesis::ContradictedWall& sum = entry.second;
    if (sum.length_m >= kLeastLength_m)
      places.push_back({sum.x_m / sum.length_m, sum.y_m / sum.length_m, sum.length_m});
  }
  std::stable_sort(places.begin(), places.end(), [](const auto& l, const auto& r) { return l.length_m > r.length_m; });
  if (places.size() > kMostPlaces) places.resize(kMostPlaces);
  return places;
}

}  // namespace mapweave::fusion
