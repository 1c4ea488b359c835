#pragma once
// The walls of several sides, by the regions that at least two of them reach, and what others saw of them.

#include "wall_agreement.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <utility>
#include <vector>

namespace mapweave::fusion {

constexpr double kWallCell_m = 0.1;  // a wall counts once in each
// Walls are compared so far beyond a region: what is like them within this counts as chance (distinctive_walls.h).
constexpr double kFarthestShift_m = 6.0;

struct Region {
  static constexpr double kSide_m = RegionAgreement::kSide_m;
  double x_m, y_m;  // lower corner
  bool has(double x, double y) const { return x >= x_m && x < x_m + kSide_m && y >= y_m && y < y_m + kSide_m; }
  // Whether the submap reaches into it, or so far beyond as walls are shifted.
  bool is_reached_by(const PlacedSubmap& submap) const {
    const double x = std::clamp(submap.x_m, x_m - kFarthestShift_m, x_m + kSide_m + kFarthestShift_m),
                 y = std::clamp(submap.y_m, y_m - kFarthestShift_m, y_m + kSide_m + kFarthestShift_m);
    return std::hypot(x - submap.x_m, y - submap.y_m) <= submap.radius_m;
  }
};

// Walls of one side in the team's frame, one a cell and direction.
std::vector<matching::WallPoint> walls_of(const std::vector<PlacedSubmap>& side);

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
class RegionComparison {
 public:
  struct Place {
    Region region;
    std::vector<std::pair<std::size_t, std::vector<matching::WallPoint>>>
        walls;  // of each side that has some, in their order
  };

  RegionComparison(const std::vector<std::vector<PlacedSubmap>>& sides, const SightOf& sight_of);

  const std::vector<Place>& places() const { return places_; }

  // What the side saw of another's walls, of every region that it reaches.
  using Visit = std::function<void(std::size_t place, std::size_t owner, const std::vector<matching::WallPoint>& walls,
                                   const std::vector<Seen>& seen)>;
  void see(std::size_t seer, const Visit& visit) const;

  std::vector<std::size_t> places_near(const PlacedSubmap& submap) const;

 private:
  const std::vector<std::vector<PlacedSubmap>>& sides_;
  const SightOf& sight_of_;
  std::vector<Place> places_;
  std::map<std::pair<int, int>, std::size_t> place_of_;
};

}  // namespace mapweave::fusion
