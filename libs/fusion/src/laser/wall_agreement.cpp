#include "wall_agreement.h"

#include "region_tiles.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <tuple>

namespace mapweave::fusion {
namespace {

using matching::cell_of;
using matching::Sight;
using matching::WallPoint;

constexpr double kCell_m = 0.1;  // a wall counts once in each
constexpr double kRegion_m = RegionAgreement::kSide_m;
// Where chance is measured: off the walls themselves, within a room.
constexpr double kFarthestShift_m = 4.0, kNearestShift_m = 0.75, kShiftStep_m = 0.25;

struct Region {
  double x_m, y_m;  // lower corner
  bool has(double x, double y) const { return x >= x_m && x < x_m + kRegion_m && y >= y_m && y < y_m + kRegion_m; }
  // Whether the submap reaches into it, or so far beyond as walls are shifted.
  bool is_reached_by(const PlacedSubmap& submap) const {
    const double x = std::clamp(submap.x_m, x_m - kFarthestShift_m, x_m + kRegion_m + kFarthestShift_m),
                 y = std::clamp(submap.y_m, y_m - kFarthestShift_m, y_m + kRegion_m + kFarthestShift_m);
    return std::hypot(x - submap.x_m, y - submap.y_m) <= submap.radius_m;
  }
};

// Walls of one side in the team's frame, one a cell and direction; of those submaps and places that are wanted.
template <class WantsSubmap, class WantsPlace>
std::vector<WallPoint> walls_of(const std::vector<PlacedSubmap>& side, WantsSubmap&& wants_submap,
                                WantsPlace&& wants_place) {
  std::vector<std::pair<std::uint64_t, WallPoint>> keyed;
  for (const PlacedSubmap& submap : side) {
    if (!wants_submap(submap)) continue;
    const double c = std::cos(submap.team_from_submap.phi), s = std::sin(submap.team_from_submap.phi);
    for (const WallPoint& wall : *submap.walls) {
      const WallPoint there{static_cast<float>(c * wall.x - s * wall.y + submap.team_from_submap.x),
                            static_cast<float>(s * wall.x + c * wall.y + submap.team_from_submap.y),
                            static_cast<float>(c * wall.normal_x - s * wall.normal_y),
                            static_cast<float>(s * wall.normal_x + c * wall.normal_y)};
      if (!wants_place(there)) continue;
      const auto quadrant = static_cast<std::uint64_t>((there.normal_x > there.normal_y ? 1 : 0) +
                                                       (there.normal_x > -there.normal_y ? 2 : 0));
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

std::vector<WallPoint> walls_of(const std::vector<PlacedSubmap>& side, const Region& region) {
  return walls_of(
      side, [&](const PlacedSubmap& submap) { return region.is_reached_by(submap); },
      [&](const WallPoint& wall) { return region.has(wall.x, wall.y); });
}

// From the team's frame to a submap's.
class IntoSubmap {
 public:
  explicit IntoSubmap(const Pose2& team_from_submap)
      : from_team_(inverse(team_from_submap)), c_(std::cos(from_team_.phi)), s_(std::sin(from_team_.phi)) {}
  Eigen::Vector2d operator()(double x, double y) const {
    return {c_ * x - s_ * y + from_team_.x, s_ * x + c_ * y + from_team_.y};
  }

 private:
  Pose2 from_team_;
  double c_, s_;
};

// Walls of all sides, by the regions that at least two of them reach, and what others saw of them.
class Comparison {
 public:
  struct Place {
    Region region;
    std::vector<std::pair<std::size_t, std::vector<WallPoint>>> walls;  // of each side that has some, in their order
  };

  Comparison(const std::vector<std::vector<PlacedSubmap>>& sides, const SightOf& sight_of)
      : sides_(sides), sight_of_(sight_of) {
    std::map<std::pair<int, int>, std::vector<std::size_t>> reached;
    for (std::size_t side = 0; side < sides.size(); ++side)
      for (const auto& region : regions_of(sides[side])) reached[region].push_back(side);
    for (const auto& [region, by] : reached) {
      if (by.size() < 2) continue;
      Place place{{region.second * kRegion_m, region.first * kRegion_m}, {}};
      for (const std::size_t side : by) {
        auto walls = walls_of(sides[side], place.region);
        if (!walls.empty()) place.walls.emplace_back(side, std::move(walls));
      }
      if (place.walls.size() < 2) continue;
      place_of_[region] = places_.size();
      places_.push_back(std::move(place));
    }
  }

  const std::vector<Place>& places() const { return places_; }

  // visit(place, owner, walls, seen): what the side saw of another's walls, of every region that it reaches.
  template <class Visit>
  void see(std::size_t seer, Visit&& visit) const {
    std::map<std::pair<std::size_t, std::size_t>, std::vector<Seen>> seen;  // by place, and number among its walls
    for (const PlacedSubmap& submap : sides_[seer]) {
      const std::vector<std::size_t> near = places_near(submap);
      if (near.empty()) continue;
      const auto sight = sight_of_(submap.number);
      const IntoSubmap into(submap.team_from_submap);
      for (const std::size_t p : near)
        for (std::size_t k = 0; k < places_[p].walls.size(); ++k) {
          const auto& [owner, walls] = places_[p].walls[k];
          if (owner == seer) continue;
          auto& result = seen[{p, k}];
          result.resize(walls.size(), Seen::not_at_all);
          for (std::size_t i = 0; i < walls.size(); ++i) {
            if (result[i] == Seen::wall) continue;
            const Eigen::Vector2d at = into(walls[i].x, walls[i].y);
            result[i] = std::max(result[i], sight->at(at.x(), at.y()));
          }
        }
    }
    for (const auto& [where, result] : seen)
      visit(where.first, places_[where.first].walls[where.second].first,
            places_[where.first].walls[where.second].second, result);
  }

  std::vector<std::size_t> places_near(const PlacedSubmap& submap) const {
    std::vector<std::size_t> result;
    const double reach = submap.radius_m + kFarthestShift_m;
    for (int y = cell_of(submap.y_m - reach, 1.0 / kRegion_m); y <= cell_of(submap.y_m + reach, 1.0 / kRegion_m); ++y)
      for (int x = cell_of(submap.x_m - reach, 1.0 / kRegion_m); x <= cell_of(submap.x_m + reach, 1.0 / kRegion_m);
           ++x) {
        const auto place = place_of_.find({y, x});
        if (place != place_of_.end() && places_[place->second].region.is_reached_by(submap))
          result.push_back(place->second);
      }
    return result;
  }

 private:
  static std::vector<std::pair<int, int>> regions_of(const std::vector<PlacedSubmap>& side) {
    std::vector<std::pair<int, int>> regions;
    for (const PlacedSubmap& submap : side)
      for (int y = cell_of(submap.y_m - submap.radius_m, 1.0 / kRegion_m);
           y <= cell_of(submap.y_m + submap.radius_m, 1.0 / kRegion_m); ++y)
        for (int x = cell_of(submap.x_m - submap.radius_m, 1.0 / kRegion_m);
             x <= cell_of(submap.x_m + submap.radius_m, 1.0 / kRegion_m); ++x)
          regions.emplace_back(y, x);
    std::sort(regions.begin(), regions.end());
    regions.erase(std::unique(regions.begin(), regions.end()), regions.end());
    return regions;
  }

  const std::vector<std::vector<PlacedSubmap>>& sides_;
  const SightOf& sight_of_;
  std::vector<Place> places_;
  std::map<std::pair<int, int>, std::size_t> place_of_;
};

// Where one side has walls, in a region and so far beyond as walls are shifted.
class WallRaster {
 public:
  explicit WallRaster(const Region& region)
      : x_m_(region.x_m - kFarthestShift_m),
        y_m_(region.y_m - kFarthestShift_m),
        cells_(static_cast<std::size_t>(kSide) * kSide, 0) {}
  void add(const WallSight& sight, const Pose2& team_from_submap) {
    const IntoSubmap into(team_from_submap);
    const double c = std::cos(team_from_submap.phi), s = std::sin(team_from_submap.phi);
    for (const WallSight::Block& block : sight.wall_blocks()) {
      const double x = c * block.middle.x() - s * block.middle.y() + team_from_submap.x - x_m_,
                   reach_x = std::abs(c) * block.half.x() + std::abs(s) * block.half.y();
      const double y = s * block.middle.x() + c * block.middle.y() + team_from_submap.y - y_m_,
                   reach_y = std::abs(s) * block.half.x() + std::abs(c) * block.half.y();
      const int low_x = std::max(0, cell_of(x - reach_x, 1.0 / kCell_m)),
                high_x = std::min(kSide - 1, cell_of(x + reach_x, 1.0 / kCell_m));
      const int low_y = std::max(0, cell_of(y - reach_y, 1.0 / kCell_m)),
                high_y = std::min(kSide - 1, cell_of(y + reach_y, 1.0 / kCell_m));
      for (int j = low_y; j <= high_y; ++j)
        for (int i = low_x; i <= high_x; ++i) {
          char& cell = cells_[static_cast<std::size_t>(j) * kSide + static_cast<std::size_t>(i)];
          if (cell != 0) continue;
          const Eigen::Vector2d at = into(x_m_ + (i + 0.5) * kCell_m, y_m_ + (j + 0.5) * kCell_m);
          cell = sight.at(at.x(), at.y()) == Seen::wall ? 1 : 0;
        }
    }
  }
  bool at(double x, double y) const {
    const int cx = cell_of(x - x_m_, 1.0 / kCell_m), cy = cell_of(y - y_m_, 1.0 / kCell_m);
    return cx >= 0 && cy >= 0 && cx < kSide && cy < kSide &&
           cells_[static_cast<std::size_t>(cy) * kSide + static_cast<std::size_t>(cx)] != 0;
  }

 private:
  static constexpr int kSide = static_cast<int>((kRegion_m + 2 * kFarthestShift_m) / kCell_m + 0.5);
  double x_m_, y_m_;
  std::vector<char> cells_;
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

// Samples: bound time.
constexpr std::size_t kMostShiftedWalls = 400, kMostMirroredWalls = 150, kMostRegions = 12;
constexpr double kLargeOverlap = 0.3;  // of the smaller map: above it, mirror images are not asked

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
double most_when_shifted(const std::array<WallRaster, 2>& sides, const std::array<std::vector<WallPoint>, 2>& known,
                         const Eigen::Matrix2d& axes) {
  double most = 0.0;
  for (int axis = 0; axis < 2; ++axis)
    for (const int sign : {1, -1})
      for (double step = kNearestShift_m; step <= kFarthestShift_m; step += kShiftStep_m) {
        const Eigen::Vector2d shift = sign * step * axes.col(axis);
        double sum = 0.0;
        for (std::size_t side = 0; side < 2; ++side) {
          const std::size_t count = std::min(kMostShiftedWalls, known[side].size());
          const double direction = side == 0 ? 1.0 : -1.0;
          std::size_t hits = 0;
          for (std::size_t i = 0; i < count; ++i) {
            const WallPoint& wall = known[side][i * known[side].size() / count];
            hits += sides[1 - side].at(wall.x + direction * shift.x(), wall.y + direction * shift.y());
          }
          if (count > 0)
            sum += kCell_m * static_cast<double>(hits) * static_cast<double>(known[side].size()) /
                   static_cast<double>(count);
        }
        most = std::max(most, sum);
      }
  return most;
}

// How much would coincide if one side were its mirror image, about the best axis along or across the walls. A map that
// fits its own mirror image says nothing of how it lies.
double most_when_mirrored(const std::array<WallRaster, 2>& sides, const std::array<std::vector<WallPoint>, 2>& known,
                          const Eigen::Matrix2d& axes, const Region& region) {
  const Eigen::Vector2d middle(region.x_m + 0.5 * kRegion_m, region.y_m + 0.5 * kRegion_m);
  const auto coinciding_m = [&](int axis, double turn, double offset) {
    const Eigen::Vector2d normal = Eigen::Rotation2Dd(turn) * axes.col(axis);
    double sum = 0.0;
    for (std::size_t side = 0; side < 2; ++side) {
      const std::size_t count = std::min(kMostMirroredWalls, known[side].size());
      std::size_t hits = 0;
      for (std::size_t i = 0; i < count; ++i) {
        const WallPoint& wall = known[side][i * known[side].size() / count];
        const Eigen::Vector2d place(wall.x, wall.y);
        const Eigen::Vector2d image = place - 2.0 * (normal.dot(place - middle) - offset) * normal;
        hits += sides[1 - side].at(image.x(), image.y());
      }
      if (count > 0)
        sum +=
            kCell_m * static_cast<double>(hits) * static_cast<double>(known[side].size()) / static_cast<double>(count);
    }
    return sum;
  };
  constexpr double kTurn_rad = 0.015, kOffset_m = 0.5 * kShiftStep_m;  // first steps, halved from there
  double most = -1.0, best_turn = 0.0, best_offset = 0.0;
  int best_axis = 0;
  const auto consider = [&](int axis, double turn, double offset) {
    const double sum = coinciding_m(axis, turn, offset);
    if (sum <= most) return;
    most = sum;
    best_axis = axis;
    best_turn = turn;
    best_offset = offset;
  };
  for (int k = -2; k <= 2; ++k)
    for (int axis = 0; axis < 2; ++axis)
      for (double offset = -0.75 * kRegion_m; offset <= 0.75 * kRegion_m; offset += kOffset_m)
        consider(axis, kTurn_rad * k, offset);
  for (double part : {0.5, 0.25}) {
    const double turn = best_turn, offset = best_offset;
    for (int i = -1; i <= 1; ++i)
      for (int j = -2; j <= 2; ++j) consider(best_axis, turn + part * i * kTurn_rad, offset + part * j * kOffset_m);
  }
  return std::max(0.0, most);
}

// What both sides have in one region.
struct Common {
  double coinciding_m = 0.0;
  Eigen::Matrix2d normals = Eigen::Matrix2d::Zero();  // of the coinciding walls
  std::array<std::vector<WallPoint>, 2> known;        // that the other side saw anything of
};

// Of the fullest regions, which are enough: what coincides there and would not elsewhere.
double distinctive_in(const std::map<std::size_t, Common>& common, const Comparison& comparison, bool with_mirror,
                      const std::vector<std::vector<PlacedSubmap>>& sides, const SightOf& sight_of) {
  std::vector<std::size_t> informative;
  for (const auto& [place, here] : common)
    if (here.coinciding_m > 0.0) informative.push_back(place);
  std::stable_sort(informative.begin(), informative.end(),
                   [&](std::size_t l, std::size_t r) { return common.at(l).coinciding_m > common.at(r).coinciding_m; });
  if (informative.size() > kMostRegions) informative.resize(kMostRegions);
  std::map<std::size_t, std::array<WallRaster, 2>> rasters;
  for (const std::size_t place : informative) {
    const WallRaster empty(comparison.places()[place].region);
    rasters.emplace(place, std::array<WallRaster, 2>{empty, empty});
  }
  for (std::size_t side = 0; side < 2; ++side)
    for (const PlacedSubmap& submap : sides[side])
      for (const std::size_t place : comparison.places_near(submap))
        if (const auto raster = rasters.find(place); raster != rasters.end())
          raster->second[side].add(*sight_of(submap.number), submap.team_from_submap);
  double result = 0.0;
  for (const std::size_t place : informative) {
    const Common& here = common.at(place);
    const Eigen::Matrix2d axes = directions_of(here.known);
    double elsewhere_m = most_when_shifted(rasters.at(place), here.known, axes);
    if (with_mirror)
      elsewhere_m = std::max(
          elsewhere_m, most_when_mirrored(rasters.at(place), here.known, axes, comparison.places()[place].region));
    result += std::max(0.0, here.coinciding_m - elsewhere_m);
  }
  return result;
}

std::vector<Contradiction> longest_first(std::vector<Contradiction> contradictions) {
  std::stable_sort(contradictions.begin(), contradictions.end(),
                   [](const Contradiction& l, const Contradiction& r) { return l.length_m > r.length_m; });
  return contradictions;
}

template <class Agreement>
void add(Seen seen, Agreement& walls) {
  (seen == Seen::wall ? walls.coinciding_m : seen == Seen::through ? walls.contradicted_m : walls.unclear_m) += kCell_m;
}

}  // namespace

double length_of_walls(const std::vector<PlacedSubmap>& side) {
  const auto all = [](const auto&) { return true; };
  return kCell_m * static_cast<double>(walls_of(side, all, all).size());
}

WallAgreement wall_agreement(const std::vector<PlacedSubmap>& a, double a_walls_m, const std::vector<PlacedSubmap>& b,
                             double b_walls_m, const SightOf& sight_of) {
  const std::vector<std::vector<PlacedSubmap>> sides{a, b};
  const Comparison comparison(sides, sight_of);
  WallAgreement result;
  std::array<double, 2> known_m{0.0, 0.0};
  std::array<std::vector<WallPoint>, 2> contradicted;
  std::map<std::size_t, Common> common;
  for (std::size_t seer = 0; seer < 2; ++seer)
    comparison.see(seer, [&](std::size_t place, std::size_t owner, const std::vector<WallPoint>& walls,
                             const std::vector<Seen>& seen) {
      Common& here = common[place];
      for (std::size_t i = 0; i < walls.size(); ++i) {
        const WallPoint& wall = walls[i];
        if (seen[i] == Seen::not_at_all) continue;
        here.known[owner].push_back(wall);
        known_m[owner] += kCell_m;
        if (seen[i] == Seen::wall) {
          here.coinciding_m += kCell_m;
          here.normals(0, 0) += wall.normal_x * wall.normal_x;
          here.normals(0, 1) += wall.normal_x * wall.normal_y;
          here.normals(1, 1) += wall.normal_y * wall.normal_y;
        } else if (seen[i] == Seen::through) {
          result.contradicted_m += kCell_m;
          contradicted[owner].push_back(wall);
        } else {
          result.unclear_m += kCell_m;
          if (seen[i] == Seen::in_part) result.in_part_m += kCell_m;
        }
      }
    });
  Eigen::Matrix2d all_normals = Eigen::Matrix2d::Zero();
  for (auto& [place, here] : common) {
    result.coinciding_m += here.coinciding_m;
    here.normals(1, 0) = here.normals(0, 1);
    all_normals += here.normals;
  }
  result.overlap =
      std::min(1.0, std::max(known_m[0] / std::max(a_walls_m, kCell_m), known_m[1] / std::max(b_walls_m, kCell_m)));
  result.distinctive_m = distinctive_in(common, comparison, result.overlap < kLargeOverlap, sides, sight_of);
  for (const auto& walls : contradicted) gather(walls, result.contradictions);
  result.contradictions = longest_first(std::move(result.contradictions));
  if (all_normals.trace() > 0.0)
    result.observability = std::max(
        0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(all_normals / all_normals.trace()).eigenvalues()(0));
  return result;
}

std::vector<RegionAgreement> compare_by_region(const std::vector<std::vector<PlacedSubmap>>& maps,
                                               const SightOf& sight_of) {
  const Comparison comparison(maps, sight_of);
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
      here.x_m = region.x_m + 0.5 * kRegion_m;
      here.y_m = region.y_m + 0.5 * kRegion_m;
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
    agreement.around = tiles.at({agreement.a, agreement.b}).around_doubt_of(agreement);
    result.push_back(std::move(agreement));
  }
  return result;
}

}  // namespace mapweave::fusion
