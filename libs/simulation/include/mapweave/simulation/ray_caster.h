#pragma once
// How far a ray goes before it meets a wall. Walls are kept in a grid, so that a ray looks at the few on its way.

#include <mapweave/core/geometry.h>
#include <mapweave/simulation/floor_plan.h>

#include <cstdint>
#include <limits>
#include <vector>

namespace mapweave::simulation {

constexpr double kNoHit = std::numeric_limits<double>::infinity();

// Distances along a ray from `origin` in the unit direction (dx, dy); kNoHit where it misses.
double distance_along_ray(Point2 origin, double dx, double dy, const Wall&);
double distance_along_ray(Point2 origin, double dx, double dy, Point2 disc_centre,
                          double disc_radius_m);  // 0 inside the disc

// Immutable; may be used by many threads.
class RayCaster {
 public:
  explicit RayCaster(const std::vector<Wall>& walls);
  // The nearest wall within max_range_m, or kNoHit.
  double distance(Point2 origin, double dx, double dy, double max_range_m) const;
  // Whether no wall stands between two points, at the heights where the line of sight passes it.
  bool is_in_sight(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const;

 private:
  // Calls visit(first wall, last wall, distance at which the ray leaves the cell) until that says true.
  template <class Visit>
  void walk(Point2 origin, double dx, double dy, double max_range_m, Visit&& visit) const;
  double low_x_ = 0.0, low_y_ = 0.0, cell_m_ = 0.5;
  int columns_ = 0, rows_ = 0;
  std::vector<std::uint32_t> first_;  // per cell, into walls_; one more at the end
  std::vector<Wall> walls_;           // cell by cell; a wall stands in every cell that it touches
};

}  // namespace mapweave::simulation
