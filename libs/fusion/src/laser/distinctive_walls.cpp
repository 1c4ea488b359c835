#include "distinctive_walls.h"

#include <Eigen/Geometry>

namespace mapweave::fusion {
namespace {

using matching::cell_of;
using matching::WallPoint;

// Where chance is measured: off the walls themselves, within the next rooms.
constexpr double kNearestShift_m = 0.75, kShiftStep_m = 0.25;
// A building repeats itself where so much of what coincides here does so there, and so much of what lies where the
// other side looked, as a share of the same here. Aisles and rooms that are alike have 0.93 and more, offices up to
// 0.85.
constexpr double kHalf = 0.5, kRepeats = 0.9;
// Samples: bound time.
constexpr std::size_t kMostShiftedWalls = 400, kMostMirroredWalls = 150, kMostRegions = 12, kMostRepetitions = 8;

// Where one side has walls, and where it looked, in a region and so far beyond as walls are shifted.
class SideOfRegion {
 public:
  explicit SideOfRegion(const Region& region)
      : x_m_(region.x_m - kFarthestShift_m),
        y_m_(region.y_m - kFarthestShift_m),
        cells_(static_cast<std::size_t>(kSide) * kSide, 0) {}
  void add(const std::shared_ptr<const WallSight>& sight, const Pose2& team_from_submap) {
    const IntoSubmap into(team_from_submap);
    sights_.emplace_back(into, sight);
    const double c = std::cos(team_from_submap.phi), s = std::sin(team_from_submap.phi);
    for (const WallSight::Block& block : sight->wall_blocks()) {
      const double x = c * block.middle.x() - s * block.middle.y() + team_from_submap.x - x_m_,
                   reach_x = std::abs(c) * block.half.x() + std::abs(s) * block.half.y();
      const double y = s * block.middle.x() + c * block.middle.y() + team_from_submap.y - y_m_,
                   reach_y = std::abs(s) * block.half.x() + std::abs(c) * block.half.y();
      const int low_x = std::max(0, cell_of(x - reach_x, 1.0 / kWallCell_m)),
                high_x = std::min(kSide - 1, cell_of(x + reach_x, 1.0 / kWallCell_m));
      const int low_y = std::max(0, cell_of(y - reach_y, 1.0 / kWallCell_m)),
                high_y = std::min(kSide - 1, cell_of(y + reach_y, 1.0 / kWallCell_m));
      for (int j = low_y; j <= high_y; ++j)
        for (int i = low_x; i <= high_x; ++i) {
          char& cell = cells_[static_cast<std::size_t>(j) * kSide + static_cast<std::size_t>(i)];
          if (cell != 0) continue;
          const Eigen::Vector2d at = into(x_m_ + (i + 0.5) * kWallCell_m, y_m_ + (j + 0.5) * kWallCell_m);
          cell = sight->at(at.x(), at.y()) == Seen::wall ? 1 : 0;
        }
    }
  }
  bool has_wall(double x, double y) const {
    const int cx = cell_of(x - x_m_, 1.0 / kWallCell_m), cy = cell_of(y - y_m_, 1.0 / kWallCell_m);
    return cx >= 0 && cy >= 0 && cx < kSide && cy < kSide &&
           cells_[static_cast<std::size_t>(cy) * kSide + static_cast<std::size_t>(cx)] != 0;
  }

  bool looked_at(double x, double y) const {
    return std::any_of(sights_.begin(), sights_.end(), [&](const auto& seen) {
      const Eigen::Vector2d at = seen.first(x, y);
      return seen.second->at(at.x(), at.y()) != Seen::not_at_all;
    });
  }

 private:
  static constexpr int kSide = static_cast<int>((Region::kSide_m + 2 * kFarthestShift_m) / kWallCell_m + 0.5);
  double x_m_, y_m_;
  std::vector<char> cells_;
  std::vector<std::pair<IntoSubmap, std::shared_ptr<const WallSight>>> sights_;
};

using KnownWalls = std::array<std::vector<WallPoint>, 2>;
using SidesOfRegion = std::array<SideOfRegion, 2>;

// The two directions, at right angles, that most walls face.
Eigen::Matrix2d directions_of(const KnownWalls& known) {
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

// Metres of known walls of both sides for which is_there(side, x, y) where the other side's are shifted towards them.
template <class IsThere>
double shifted_m(const KnownWalls& known, const Eigen::Vector2d& shift, const IsThere& is_there) {
  double sum_m = 0.0;
  for (std::size_t side = 0; side < 2; ++side) {
    const std::size_t count = std::min(kMostShiftedWalls, known[side].size());
    const double direction = side == 0 ? 1.0 : -1.0;
    std::size_t hits = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const WallPoint& wall = known[side][i * known[side].size() / count];
      hits += is_there(1 - side, wall.x + direction * shift.x(), wall.y + direction * shift.y()) ? 1U : 0U;
    }
    if (count > 0)
      sum_m += kWallCell_m * static_cast<double>(hits) * static_cast<double>(known[side].size()) /
               static_cast<double>(count);
  }
  return sum_m;
}

// How much would coincide elsewhere: what was seen to, and what is taken to where a building repeats itself.
struct Elsewhere {
  double seen_m = 0.0, taken_m = 0.0;
};

// Of walls of each side, shifted along the two directions that the walls have.
Elsewhere most_when_shifted(const SidesOfRegion& sides, const CommonWalls& here, const Eigen::Matrix2d& axes) {
  std::vector<std::pair<double, Eigen::Vector2d>> places;  // what coincides there, and the shift
  for (int axis = 0; axis < 2; ++axis)
    for (const int sign : {1, -1})
      for (double step = kNearestShift_m; step <= kFarthestShift_m; step += kShiftStep_m) {
        const Eigen::Vector2d shift = sign * step * axes.col(axis);
        const double coinciding_m = shifted_m(
            here.known, shift, [&](std::size_t side, double x, double y) { return sides[side].has_wall(x, y); });
        places.emplace_back(coinciding_m, shift);
      }
  std::stable_sort(places.begin(), places.end(), [](const auto& l, const auto& r) { return l.first > r.first; });
  Elsewhere most{places.front().first, places.front().first};
  const double known_m = kWallCell_m * static_cast<double>(here.known[0].size() + here.known[1].size());
  std::vector<Eigen::Vector2d> looked_at;
  for (const auto& [coinciding_m, shift] : places) {
    if (coinciding_m < kHalf * here.coinciding_m || looked_at.size() == kMostRepetitions) break;
    const auto is_near = [&, there = shift](const Eigen::Vector2d& other) {
      return (other - there).norm() < kNearestShift_m;
    };
    if (std::any_of(looked_at.begin(), looked_at.end(), is_near)) continue;
    looked_at.push_back(shift);
    const double known_there_m =
        shifted_m(here.known, shift, [&](std::size_t side, double x, double y) { return sides[side].looked_at(x, y); });
    const double repeats = coinciding_m * known_m / std::max(kWallCell_m, known_there_m * here.coinciding_m);
    if (repeats >= kRepeats) most.taken_m = std::max(most.taken_m, std::min(1.0, repeats) * here.coinciding_m);
  }
  return most;
}

// How much would coincide if one side were its mirror image, about the best axis along or across the walls. A map that
// fits its own mirror image says nothing of how it lies.
double most_when_mirrored(const SidesOfRegion& sides, const KnownWalls& known, const Eigen::Matrix2d& axes,
                          const Region& region) {
  const Eigen::Vector2d middle(region.x_m + 0.5 * Region::kSide_m, region.y_m + 0.5 * Region::kSide_m);
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
        hits += sides[1 - side].has_wall(image.x(), image.y());
      }
      if (count > 0)
        sum += kWallCell_m * static_cast<double>(hits) * static_cast<double>(known[side].size()) /
               static_cast<double>(count);
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
      for (double offset = -0.75 * Region::kSide_m; offset <= 0.75 * Region::kSide_m; offset += kOffset_m)
        consider(axis, kTurn_rad * k, offset);
  for (double part : {0.5, 0.25}) {
    const double turn = best_turn, offset = best_offset;
    for (int i = -1; i <= 1; ++i)
      for (int j = -2; j <= 2; ++j) consider(best_axis, turn + part * i * kTurn_rad, offset + part * j * kOffset_m);
  }
  return std::max(0.0, most);
}

}  // namespace

DistinctiveWalls distinctive_walls(const std::map<std::size_t, CommonWalls>& common, const RegionComparison& comparison,
                                   bool with_mirror, const std::vector<std::vector<PlacedSubmap>>& sides,
                                   const SightOf& sight_of) {
  std::vector<std::size_t> informative;
  for (const auto& [place, here] : common)
    if (here.coinciding_m > 0.0) informative.push_back(place);
  std::stable_sort(informative.begin(), informative.end(),
                   [&](std::size_t l, std::size_t r) { return common.at(l).coinciding_m > common.at(r).coinciding_m; });
  if (informative.size() > kMostRegions) informative.resize(kMostRegions);
  std::map<std::size_t, SidesOfRegion> sides_of;
  for (const std::size_t place : informative) {
    const SideOfRegion empty(comparison.places()[place].region);
    sides_of.emplace(place, SidesOfRegion{empty, empty});
  }
  for (std::size_t side = 0; side < 2; ++side)
    for (const PlacedSubmap& submap : sides[side])
      for (const std::size_t place : comparison.places_near(submap))
        if (const auto of_place = sides_of.find(place); of_place != sides_of.end())
          of_place->second[side].add(sight_of(submap.number), submap.team_from_submap);
  DistinctiveWalls result;
  for (const std::size_t place : informative) {
    const CommonWalls& here = common.at(place);
    const Eigen::Matrix2d axes = directions_of(here.known);
    const Elsewhere elsewhere = most_when_shifted(sides_of.at(place), here, axes);
    const double mirrored_m =
        with_mirror ? most_when_mirrored(sides_of.at(place), here.known, axes, comparison.places()[place].region) : 0.0;
    const double distinctive_m = std::max(0.0, here.coinciding_m - std::max(elsewhere.seen_m, mirrored_m));
    result.distinctive_m += distinctive_m;
    result.repeated_m += distinctive_m - std::max(0.0, here.coinciding_m - std::max(elsewhere.taken_m, mirrored_m));
  }
  return result;
}

}  // namespace mapweave::fusion
