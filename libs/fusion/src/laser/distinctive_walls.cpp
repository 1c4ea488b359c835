#include "distinctive_walls.h"

#include <Eigen/Geometry>
#include <limits>

namespace mapweave::fusion {
namespace {

using matching::cell_of;
using matching::WallPoint;

// Where chance is measured: off the walls themselves, within the next rooms.
constexpr double kNearestShift_m = 0.75, kShiftStep_m = 0.25;
constexpr double kFacing = 0.7;  // cosine to a shift
// Shifts to the next rooms, of which those count where half as much coincides as here.
constexpr double kNextRoom_m = 2.5, kHalf = 0.5;
// A building repeats itself where so large a share of what lies where the other side looked coincides, of the share
// here. Rooms that are alike have 0.91 and more, others up to 0.8.
constexpr double kRepeats = 0.9;
// Where the other side looked at so much of what faces along a shift, the rest is taken to be as what it looked at.
constexpr double kEnoughLooked = 2.0 / 3.0;
// Samples: bound time.
constexpr std::size_t kMostShiftedWalls = 400, kMostMirroredWalls = 150, kMostRegions = 12;

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

// The two directions, at right angles, that most walls face; the same from either side.
Eigen::Matrix2d directions_of(const std::vector<const CommonWalls*>& common) {
  Eigen::Vector2d sums[2] = {Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};
  for (const CommonWalls* here : common)
    for (std::size_t side = 0; side < 2; ++side)
      for (const WallPoint& wall : here->known[side]) {
        const double angle = 4.0 * std::atan2(wall.normal_y, wall.normal_x);
        sums[side] += Eigen::Vector2d(std::cos(angle), std::sin(angle));
      }
  const Eigen::Vector2d sum = sums[0] + sums[1];
  return Eigen::Rotation2Dd(0.25 * std::atan2(sum.y(), sum.x())).toRotationMatrix();
}

// Metres of walls, and of those that face along a shift: the others slide along themselves.
struct ShiftedWalls {
  double all_m = 0.0, facing_m = 0.0;
  double sliding_m() const { return all_m - facing_m; }
};

// Known walls of both sides for which is_there(side, x, y) where the other side's are shifted towards them.
template <class IsThere>
ShiftedWalls shifted(const KnownWalls& known, const Eigen::Vector2d& along, double step_m, const IsThere& is_there) {
  ShiftedWalls sum;
  for (std::size_t side = 0; side < 2; ++side) {
    const std::size_t count = std::min(kMostShiftedWalls, known[side].size());
    const Eigen::Vector2d shift = (side == 0 ? step_m : -step_m) * along;
    std::size_t hits = 0, facing = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const WallPoint& wall = known[side][i * known[side].size() / count];
      if (!is_there(1 - side, wall.x + shift.x(), wall.y + shift.y())) continue;
      ++hits;
      facing += std::abs(wall.normal_x * along.x() + wall.normal_y * along.y()) > kFacing ? 1U : 0U;
    }
    if (count == 0) continue;
    const double each_m = kWallCell_m * static_cast<double>(known[side].size()) / static_cast<double>(count);
    sum.all_m += each_m * static_cast<double>(hits);
    sum.facing_m += each_m * static_cast<double>(facing);
  }
  return sum;
}

// How much would coincide elsewhere: walls of each side, shifted along the two directions that the walls have.
double most_when_shifted(const SidesOfRegion& sides, const KnownWalls& known, const Eigen::Matrix2d& axes) {
  const auto has_wall = [&](std::size_t side, double x, double y) { return sides[side].has_wall(x, y); };
  double most_m = 0.0;
  for (int axis = 0; axis < 2; ++axis)
    for (const int sign : {1, -1})
      for (double step_m = kNearestShift_m; step_m <= kFarthestShift_m; step_m += kShiftStep_m)
        most_m = std::max(most_m, shifted(known, axes.col(axis), sign * step_m, has_wall).all_m);
  return most_m;
}

// All regions, shifted together.
class Shifts {
 public:
  void add(const CommonWalls& common, const SidesOfRegion& sides) {
    common_.push_back(&common);
    sides_.push_back(&sides);
  }

  // At the next rooms, where enough of the walls lie; the most of all of them.
  struct Fit {
    // How well walls fit where the other side looked, as a share of how well they fit here: all of them, and those that
    // face along the shift. 0 where there is no such room.
    double repeats = 0.0;
    double distinctive_m = std::numeric_limits<double>::infinity();  // coinciding here, and not taken to there
  };
  Fit at_next_rooms() const {
    const Eigen::Matrix2d axes = directions_of(common_);
    const Fit one = at_next_rooms(axes.col(0)), other = at_next_rooms(axes.col(1));
    return {std::max(one.repeats, other.repeats), std::min(one.distinctive_m, other.distinctive_m)};
  }

 private:
  template <class IsThere>
  ShiftedWalls sum(const Eigen::Vector2d& along, double step_m, const IsThere& is_there) const {
    ShiftedWalls all;
    for (std::size_t i = 0; i < common_.size(); ++i) {
      const auto is_there_here = [&](std::size_t side, double x, double y) {
        return is_there((*sides_[i])[side], x, y);
      };
      const ShiftedWalls here = shifted(common_[i]->known, along, step_m, is_there_here);
      all.all_m += here.all_m;
      all.facing_m += here.facing_m;
    }
    return all;
  }
  ShiftedWalls coinciding(const Eigen::Vector2d& along, double step_m) const {
    return sum(along, step_m, [](const SideOfRegion& side, double x, double y) { return side.has_wall(x, y); });
  }
  ShiftedWalls looked_at(const Eigen::Vector2d& along, double step_m) const {
    return sum(along, step_m, [](const SideOfRegion& side, double x, double y) { return side.looked_at(x, y); });
  }

  Fit at_next_rooms(const Eigen::Vector2d& along) const {
    const ShiftedWalls here = coinciding(along, 0.0), looked_here = looked_at(along, 0.0);
    std::vector<std::pair<double, double>> places;  // what coincides there, and the step
    for (const int sign : {1, -1})
      for (double step_m = kNextRoom_m; step_m <= kFarthestShift_m; step_m += kShiftStep_m)
        places.emplace_back(coinciding(along, sign * step_m).all_m, sign * step_m);
    std::stable_sort(places.begin(), places.end(), [](const auto& l, const auto& r) { return l.first > r.first; });
    const auto share = [](double there_m, double looked_there_m, double here_m, double looked_here_m) {
      return here_m == 0.0 ? 1.0 : there_m * looked_here_m / std::max(kWallCell_m, looked_there_m * here_m);
    };
    Fit most;
    std::vector<double> asked;
    for (const auto& [coinciding_m, step_m] : places) {
      if (coinciding_m < kHalf * here.all_m) break;
      const auto is_beside = [place = step_m](double other) { return std::abs(other - place) < kNearestShift_m; };
      if (std::any_of(asked.begin(), asked.end(), is_beside)) continue;
      asked.push_back(step_m);
      const ShiftedWalls there = coinciding(along, step_m), looked = looked_at(along, step_m);
      const double facing = share(there.facing_m, looked.facing_m, here.facing_m, looked_here.facing_m);
      const double sliding = share(there.sliding_m(), looked.sliding_m(), here.sliding_m(), looked_here.sliding_m());
      most.repeats =
          std::max(most.repeats, std::min(share(there.all_m, looked.all_m, here.all_m, looked_here.all_m), facing));
      if (looked.facing_m >= kEnoughLooked * looked_here.facing_m)
        most.distinctive_m = std::min(most.distinctive_m, std::max(0.0, 1.0 - facing) * here.facing_m +
                                                              std::max(0.0, 1.0 - sliding) * here.sliding_m());
    }
    return most;
  }

  std::vector<const CommonWalls*> common_;
  std::vector<const SidesOfRegion*> sides_;
};

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
  double coinciding_m = 0.0;
  Shifts whole;
  for (const std::size_t place : informative) {
    const CommonWalls& here = common.at(place);
    const SidesOfRegion& sides_here = sides_of.at(place);
    const Eigen::Matrix2d axes = directions_of({&here});
    double elsewhere_m = most_when_shifted(sides_here, here.known, axes);
    if (with_mirror)
      elsewhere_m =
          std::max(elsewhere_m, most_when_mirrored(sides_here, here.known, axes, comparison.places()[place].region));
    result.distinctive_m += std::max(0.0, here.coinciding_m - elsewhere_m);
    coinciding_m += here.coinciding_m;
    whole.add(here, sides_here);
  }
  const Shifts::Fit next = whole.at_next_rooms();
  result.repeats = next.repeats >= kRepeats;
  result.unique_m = std::min(result.distinctive_m, next.distinctive_m);
  if (result.repeats) result.unique_m = std::min(result.unique_m, std::max(0.0, 1.0 - next.repeats) * coinciding_m);
  return result;
}

}  // namespace mapweave::fusion
