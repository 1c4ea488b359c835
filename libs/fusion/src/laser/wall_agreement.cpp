#include "wall_agreement.h"

#include "distinctive_walls.h"
#include "region_tiles.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <map>
#include <tuple>

namespace mapweave::fusion {
namespace {

using matching::cell_of;
using matching::WallPoint;

constexpr double kLargeOverlap = 0.3;  // of the smaller map: above it, mirror images are not asked

// Walls that were seen through, gathered where they touch (cells of 0.2 m).
void gather(const std::vector<WallPoint>& walls, std::vector<Contradiction>& into) {
  std::map<std::pair<int, int>, bool> open;
  for (const WallPoint& wall : walls) open[{cell_of(wall.y, 5.0), cell_of(wall.x, 5.0)}] = true;
  std::vector<std::pair<int, int>> stack;
  for (auto& [start, is_open] : open) {
    if (!is_open) continue;
    is_open = false;
    stack.assign(1, start);
    double x = 0.0, y = 0.0;
    std::size_t count = 0;
    while (!stack.empty()) {
      const auto here = stack.back();
      stack.pop_back();
      y += 0.2 * here.first;
      x += 0.2 * here.second;
      ++count;
      for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) {
          const auto next = open.find({here.first + j, here.second + i});
          if (next == open.end() || !next->second) continue;
          next->second = false;
          stack.push_back(next->first);
        }
    }
    const auto n = static_cast<double>(count);
    if (count > 3) into.push_back({x / n + 0.1, y / n + 0.1, 0.2 * n});
  }
}

std::vector<Contradiction> longest_first(std::vector<Contradiction> contradictions) {
  std::stable_sort(contradictions.begin(), contradictions.end(),
                   [](const Contradiction& l, const Contradiction& r) { return l.length_m > r.length_m; });
  return contradictions;
}

template <class Agreement>
void add(Seen seen, Agreement& walls) {
  (seen == Seen::wall      ? walls.coinciding_m
   : seen == Seen::through ? walls.contradicted_m
                           : walls.unclear_m) += kWallCell_m;
}

}  // namespace

double length_of_walls(const std::vector<PlacedSubmap>& side) {
  return kWallCell_m * static_cast<double>(walls_of(side).size());
}

WallAgreement wall_agreement(const std::vector<PlacedSubmap>& a, double a_walls_m, const std::vector<PlacedSubmap>& b,
                             double b_walls_m, const SightOf& sight_of) {
  const std::vector<std::vector<PlacedSubmap>> sides{a, b};
  const RegionComparison comparison(sides, sight_of);
  WallAgreement result;
  std::array<double, 2> known_m{0.0, 0.0};
  std::array<std::vector<WallPoint>, 2> contradicted;
  std::map<std::size_t, CommonWalls> common;
  for (std::size_t seer = 0; seer < 2; ++seer)
    comparison.see(seer, [&](std::size_t place, std::size_t owner, const std::vector<WallPoint>& walls,
                             const std::vector<Seen>& seen) {
      CommonWalls& here = common[place];
      for (std::size_t i = 0; i < walls.size(); ++i) {
        const WallPoint& wall = walls[i];
        if (seen[i] == Seen::not_at_all) continue;
        here.known[owner].push_back(wall);
        known_m[owner] += kWallCell_m;
        if (seen[i] == Seen::wall) {
          here.coinciding_m += kWallCell_m;
          here.normals(0, 0) += wall.normal_x * wall.normal_x;
          here.normals(0, 1) += wall.normal_x * wall.normal_y;
          here.normals(1, 1) += wall.normal_y * wall.normal_y;
        } else if (seen[i] == Seen::through) {
          result.contradicted_m += kWallCell_m;
          contradicted[owner].push_back(wall);
        } else {
          result.unclear_m += kWallCell_m;
          if (seen[i] == Seen::in_part) result.in_part_m += kWallCell_m;
        }
      }
    });
  Eigen::Matrix2d all_normals = Eigen::Matrix2d::Zero();
  for (auto& [place, here] : common) {
    result.coinciding_m += here.coinciding_m;
    here.normals(1, 0) = here.normals(0, 1);
    all_normals += here.normals;
  }
  result.overlap = std::min(
      1.0, std::max(known_m[0] / std::max(a_walls_m, kWallCell_m), known_m[1] / std::max(b_walls_m, kWallCell_m)));
  const DistinctiveWalls distinctive =
      distinctive_walls(common, comparison, result.overlap < kLargeOverlap, sides, sight_of);
  result.distinctive_m = distinctive.distinctive_m;
  result.unique_m = distinctive.unique_m;
  result.repeats = distinctive.repeats;
  for (const auto& walls : contradicted) gather(walls, result.contradictions);
  result.contradictions = longest_first(std::move(result.contradictions));
  if (all_normals.trace() > 0.0)
    result.observability = std::max(
        0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(all_normals / all_normals.trace()).eigenvalues()(0));
  return result;
}

std::vector<RegionAgreement> compare_by_region(const std::vector<std::vector<PlacedSubmap>>& maps,
                                               const SightOf& sight_of) {
  const RegionComparison comparison(maps, sight_of);
  std::map<std::tuple<std::size_t, std::size_t, std::size_t>, RegionAgreement> found;  // by place and pair
  std::map<std::pair<std::size_t, std::size_t>, RegionTiles> tiles;
  for (std::size_t seer = 0; seer < maps.size(); ++seer)
    comparison.see(seer, [&](std::size_t place, std::size_t owner, const std::vector<WallPoint>& walls,
                             const std::vector<Seen>& seen) {
      const auto [a, b] = std::minmax(owner, seer);
      const Region& region = comparison.places()[place].region;
      RegionAgreement& here = found[{place, a, b}];
      here.a = a;
      here.b = b;
      here.x_m = region.x_m + 0.5 * Region::kSide_m;
      here.y_m = region.y_m + 0.5 * Region::kSide_m;
      RegionTiles& of_pair = tiles[{a, b}];
      std::vector<WallPoint> contradicted;
      for (std::size_t i = 0; i < walls.size(); ++i) {
        if (seen[i] == Seen::not_at_all) continue;
        add(seen[i], here);
        add(seen[i], of_pair.at(walls[i].x, walls[i].y));
        if (seen[i] == Seen::through) contradicted.push_back(walls[i]);
      }
      gather(contradicted, here.contradictions);
    });
  std::vector<RegionAgreement> result;
  for (auto& [key, agreement] : found) {
    agreement.contradictions = longest_first(std::move(agreement.contradictions));
    const RegionTiles& of_pair = tiles.at({agreement.a, agreement.b});
    agreement.centred = of_pair.around_doubt_of(agreement);
    agreement.most_doubted = of_pair.most_doubted_of(agreement);
    result.push_back(std::move(agreement));
  }
  return result;
}

}  // namespace mapweave::fusion
