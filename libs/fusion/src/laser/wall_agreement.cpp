#include "wall_agreement.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>

namespace mapweave::fusion {
namespace {

using matching::cell_of;
using matching::Sight;
using matching::SubmapModel;
using matching::WallPoint;

constexpr double kCell_m = 0.1;  // a wall counts once in each
constexpr double kBlock_m = 4.0;
constexpr double kRegion_m = 24.0;  // what is compared at a time
constexpr double kFarthestShift_m = 4.0, kNearestShift_m = 0.75, kShiftStep_m = 0.25;

struct LoadedSubmap {
  std::shared_ptr<const SubmapModel> model;
  Pose2 team_from_submap;
};

struct Region {
  double x_m, y_m;  // lower corner
  bool has(double x, double y) const { return x >= x_m && x < x_m + kRegion_m && y >= y_m && y < y_m + kRegion_m; }
};

// Walls of one side in a region of the team's frame, one a cell and direction.
std::vector<WallPoint> walls_of(const std::vector<LoadedSubmap>& side, const Region& region) {
  std::vector<std::pair<std::uint64_t, WallPoint>> keyed;
  for (const LoadedSubmap& submap : side) {
    const double c = std::cos(submap.team_from_submap.phi), s = std::sin(submap.team_from_submap.phi);
    for (const WallPoint& wall : submap.model->walls()) {
      const WallPoint there{static_cast<float>(c * wall.x - s * wall.y + submap.team_from_submap.x),
                            static_cast<float>(s * wall.x + c * wall.y + submap.team_from_submap.y),
                            static_cast<float>(c * wall.normal_x - s * wall.normal_y),
                            static_cast<float>(s * wall.normal_x + c * wall.normal_y)};
      if (!region.has(there.x, there.y)) continue;
      const auto quadrant = static_cast<std::uint64_t>((there.normal_x > there.normal_y ? 1 : 0) + (there.normal_x > -there.normal_y ? 2 : 0));
      const auto x = static_cast<std::uint64_t>(cell_of(there.x, 1.0 / kCell_m) + (1 << 28)),
                 y = static_cast<std::uint64_t>(cell_of(there.y, 1.0 / kCell_m) + (1 << 28));
      keyed.emplace_back((y << 34U) | (x << 3U) | quadrant, there);
    }
  }
  std::stable_sort(keyed.begin(), keyed.end(), [](const auto& l, const auto& r) { return l.first < r.first; });
  std::vector<WallPoint> walls;
  for (std::size_t i = 0; i < keyed.size(); ++i)
    if (i == 0 || keyed[i].first != keyed[i - 1].first) walls.push_back(keyed[i].second);
  return walls;
}

enum class Seen : std::uint8_t { not_at_all, wall, through, unclear };

// What one side saw of a place.
class Side {
 public:
  explicit Side(const std::vector<LoadedSubmap>& submaps) : submaps_(submaps) {
    for (std::uint32_t i = 0; i < submaps.size(); ++i) {
      const auto& sight = submaps[i].model->sight();
      from_team_.push_back(inverse(submaps[i].team_from_submap));
      // Blocks of the team's frame that the submap knows something of.
      const double cell = SubmapModel::kSightResolution;
      const double middle_x = (sight.first_x() + 0.5 * sight.width()) * cell, middle_y = (sight.first_y() + 0.5 * sight.height()) * cell;
      const double reach = 0.5 * std::hypot(sight.width(), sight.height()) * cell;
      const Pose2 middle = compose(submaps[i].team_from_submap, Pose2{middle_x, middle_y, 0.0});
      for (int y = cell_of(middle.y - reach, 1.0 / kBlock_m); y <= cell_of(middle.y + reach, 1.0 / kBlock_m); ++y)
        for (int x = cell_of(middle.x - reach, 1.0 / kBlock_m); x <= cell_of(middle.x + reach, 1.0 / kBlock_m); ++x)
          blocks_[{x, y}].push_back(i);
    }
  }

  Seen at(double x, double y) const {
    const auto block = blocks_.find({cell_of(x, 1.0 / kBlock_m), cell_of(y, 1.0 / kBlock_m)});
    if (block == blocks_.end()) return Seen::not_at_all;
    bool through = false, unclear = false;
    for (const std::uint32_t i : block->second) {
      const Pose2& here = from_team_[i];
      const double c = std::cos(here.phi), s = std::sin(here.phi), px = c * x - s * y + here.x, py = s * x + c * y + here.y;
      const SubmapModel& model = *submaps_[i].model;
      const int cx = cell_of(px, 1.0 / SubmapModel::kSightResolution), cy = cell_of(py, 1.0 / SubmapModel::kSightResolution);
      if (model.field().likelihood().get(cell_of(px, 1.0 / matching::WallField::kResolution),
                                         cell_of(py, 1.0 / matching::WallField::kResolution)) > 60)
        return Seen::wall;  // within 0.12 m
      const auto& sight = model.sight();
      if (sight.get(cx, cy) == Sight::unknown) continue;
      bool clear = sight.get(cx, cy) == Sight::free;
      for (int j = -2; j <= 2 && clear; ++j)
        for (int k = -2; k <= 2 && clear; ++k) clear = sight.get(cx + k, cy + j) == Sight::free;
      (clear ? through : unclear) = true;
    }
    return unclear ? Seen::unclear : through ? Seen::through : Seen::not_at_all;
  }

 private:
  const std::vector<LoadedSubmap>& submaps_;
  std::vector<Pose2> from_team_;
  std::map<std::pair<int, int>, std::vector<std::uint32_t>> blocks_;
};

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
      y += 0.2 * here.first, x += 0.2 * here.second, ++count;
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

constexpr std::size_t kMostShiftedWalls = 400, kMostMirroredWalls = 150, kMostRegions = 12;
constexpr double kLargeOverlap = 0.3;

// The two directions, at right angles, that most walls face.
Eigen::Matrix2d directions_of(const std::array<std::vector<WallPoint>, 2>& known) {
  double cosine = 0.0, sine = 0.0;
  for (const auto& walls : known)
    for (const WallPoint& wall : walls) {
      const double angle = 4.0 * std::atan2(wall.normal_y, wall.normal_x);
      cosine += std::cos(angle);
      sine += std::sin(angle);
    }
  const double angle = 0.25 * std::atan2(sine, cosine);
  Eigen::Matrix2d axes;
  axes << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  return axes;
}

// How much would coincide elsewhere: walls of each side, shifted along the two directions that the walls have.
double most_when_shifted(const std::array<Side, 2>& sides, const std::array<std::vector<WallPoint>, 2>& known, const Eigen::Matrix2d& axes) {
  double most = 0.0;
  for (int axis = 0; axis < 2; ++axis)
    for (const int sign : {1, -1})
      for (double step = kNearestShift_m; step <= kFarthestShift_m; step += kShiftStep_m) {
        const Eigen::Vector2d shift = sign * step * axes.col(axis);
        double sum = 0.0;
        for (std::size_t side = 0; side < 2; ++side) {
          const std::size_t count = std::min(kMostShiftedWalls, known[side].size());
          const double way = side == 0 ? 1.0 : -1.0;
          std::size_t hits = 0;
          for (std::size_t i = 0; i < count; ++i) {
            const WallPoint& wall = known[side][i * known[side].size() / count];
            hits += sides[1 - side].at(wall.x + way * shift.x(), wall.y + way * shift.y()) == Seen::wall;
          }
          if (count > 0) sum += kCell_m * static_cast<double>(hits) * static_cast<double>(known[side].size()) / static_cast<double>(count);
        }
        most = std::max(most, sum);
      }
  return most;
}

// The submaps that reach into the region, and so far beyond as walls are shifted.
std::vector<LoadedSubmap> loaded(const std::vector<PlacedSubmap>& side, const Region& region, const ModelOf& model_of) {
  std::vector<LoadedSubmap> result;
  for (const PlacedSubmap& submap : side) {
    const double x = std::clamp(submap.x_m, region.x_m - kFarthestShift_m, region.x_m + kRegion_m + kFarthestShift_m),
                 y = std::clamp(submap.y_m, region.y_m - kFarthestShift_m, region.y_m + kRegion_m + kFarthestShift_m);
    if (std::hypot(x - submap.x_m, y - submap.y_m) <= submap.radius_m) result.push_back({model_of(submap.number), submap.team_from_submap});
  }
  return result;
}

std::vector<std::pair<int, int>> regions_of(const std::vector<PlacedSubmap>& side) {
  std::vector<std::pair<int, int>> regions;
  for (const PlacedSubmap& submap : side)
    for (int y = cell_of(submap.y_m - submap.radius_m, 1.0 / kRegion_m); y <= cell_of(submap.y_m + submap.radius_m, 1.0 / kRegion_m); ++y)
      for (int x = cell_of(submap.x_m - submap.radius_m, 1.0 / kRegion_m); x <= cell_of(submap.x_m + submap.radius_m, 1.0 / kRegion_m); ++x)
        regions.emplace_back(y, x);
  std::sort(regions.begin(), regions.end());
  regions.erase(std::unique(regions.begin(), regions.end()), regions.end());
  return regions;
}

// How much would coincide if one side were its mirror image, about the best axis along or across the walls. Who fits its own mirror image
// tells nothing of how it lies.
double most_when_mirrored(const std::array<Side, 2>& sides, const std::array<std::vector<WallPoint>, 2>& known, const Eigen::Matrix2d& axes,
                          const Region& region) {
  const Eigen::Vector2d middle(region.x_m + 0.5 * kRegion_m, region.y_m + 0.5 * kRegion_m);
  double most = 0.0;
  for (int k = 0; k < 10; ++k) {
    const double turn = 0.015 * (k / 2 - 2);
    const Eigen::Vector2d normal = Eigen::Rotation2Dd(turn) * axes.col(k % 2);
    for (double offset = -0.75 * kRegion_m; offset <= 0.75 * kRegion_m; offset += 0.5 * kShiftStep_m) {
      double sum = 0.0;
      for (std::size_t side = 0; side < 2; ++side) {
        const std::size_t count = std::min(kMostMirroredWalls, known[side].size());
        std::size_t hits = 0;
        for (std::size_t i = 0; i < count; ++i) {
          const WallPoint& wall = known[side][i * known[side].size() / count];
          const Eigen::Vector2d place(wall.x, wall.y);
          const Eigen::Vector2d image = place - 2.0 * (normal.dot(place - middle) - offset) * normal;
          hits += sides[1 - side].at(image.x(), image.y()) == Seen::wall;
        }
        if (count > 0) sum += kCell_m * static_cast<double>(hits) * static_cast<double>(known[side].size()) / static_cast<double>(count);
      }
      most = std::max(most, sum);
    }
  }
  return most;
}

}  // namespace

WallAgreement wall_agreement(const std::vector<PlacedSubmap>& a, double a_walls_m, const std::vector<PlacedSubmap>& b, double b_walls_m,
                             const ModelOf& model_of) {
  WallAgreement result;
  std::array<double, 2> known_m{0.0, 0.0};
  Eigen::Matrix2d all_normals = Eigen::Matrix2d::Zero();
  std::array<std::vector<WallPoint>, 2> contradicted;
  struct Common {
    double coinciding_m;
    Region region;
    Eigen::Matrix2d normals;
    std::array<std::vector<WallPoint>, 2> known;  // that the other side saw anything of
  };
  std::vector<Common> telling;
  const auto of_a = regions_of(a), of_b = regions_of(b);
  std::vector<std::pair<int, int>> common;
  std::set_intersection(of_a.begin(), of_a.end(), of_b.begin(), of_b.end(), std::back_inserter(common));
  for (const auto& [row, column] : common) {
    Common here{0.0, {column * kRegion_m, row * kRegion_m}, Eigen::Matrix2d::Zero(), {}};
    const std::array<std::vector<LoadedSubmap>, 2> near{loaded(a, here.region, model_of), loaded(b, here.region, model_of)};
    if (near[0].empty() || near[1].empty()) continue;
    const std::array<Side, 2> sides{Side(near[0]), Side(near[1])};
    for (std::size_t side = 0; side < 2; ++side)
      for (const WallPoint& wall : walls_of(near[side], here.region)) {
        const Seen seen = sides[1 - side].at(wall.x, wall.y);
        if (seen == Seen::not_at_all) continue;
        here.known[side].push_back(wall);
        known_m[side] += kCell_m;
        if (seen == Seen::wall) {
          here.coinciding_m += kCell_m;
          here.normals(0, 0) += wall.normal_x * wall.normal_x;
          here.normals(0, 1) += wall.normal_x * wall.normal_y;
          here.normals(1, 1) += wall.normal_y * wall.normal_y;
        } else if (seen == Seen::through) {
          result.contradicted_m += kCell_m;
          contradicted[side].push_back(wall);
        } else {
          result.unclear_m += kCell_m;
        }
      }
    if (here.coinciding_m <= 0.0) continue;
    result.coinciding_m += here.coinciding_m;
    here.normals(1, 0) = here.normals(0, 1);
    all_normals += here.normals;
    telling.push_back(std::move(here));
  }
  result.overlap = std::min(1.0, std::max(known_m[0] / std::max(a_walls_m, kCell_m), known_m[1] / std::max(b_walls_m, kCell_m)));
  // A few regions tell enough, the fullest.
  std::stable_sort(telling.begin(), telling.end(), [](const Common& l, const Common& r) { return l.coinciding_m > r.coinciding_m; });
  if (telling.size() > kMostRegions) telling.resize(kMostRegions);
  for (const Common& here : telling) {
    const std::array<std::vector<LoadedSubmap>, 2> near{loaded(a, here.region, model_of), loaded(b, here.region, model_of)};
    const std::array<Side, 2> sides{Side(near[0]), Side(near[1])};
    const Eigen::Matrix2d axes = directions_of(here.known);
    double elsewhere_m = most_when_shifted(sides, here.known, axes);
    if (result.overlap < kLargeOverlap)
      elsewhere_m = std::max(elsewhere_m, most_when_mirrored(sides, here.known, axes, here.region));
    result.distinctive_m += std::max(0.0, here.coinciding_m - elsewhere_m);
  }
  for (const auto& walls : contradicted) gather(walls, result.contradictions);
  std::stable_sort(result.contradictions.begin(), result.contradictions.end(),
                   [](const Contradiction& l, const Contradiction& r) { return l.length_m > r.length_m; });
  if (all_normals.trace() > 0.0)
    result.observability =
        std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(all_normals / all_normals.trace()).eigenvalues()(0));
  return result;
}

}  // namespace mapweave::fusion
