#pragma once
// How a robot drives: smooth paths through free space, with limits of speed and turn rate.

#include <mapweave/simulation/floor_plan.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace mapweave::simulation {

struct MotionOptions {
  double speed_min_m_per_s = 0.2;
  double speed_max_m_per_s = 0.8;
  double acceleration_m_per_s2 = 0.5;
  double turn_rate_deg_per_s = 50.0;
  double clearance_m = 0.3;
  double floor_tilt_deg = 0.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("speed_min_m_per_s", speed_min_m_per_s, 0.02, 10.0,
             "slowest cruising speed of a robot in metres per second; each leg of a tour has its own speed; larger "
             "values drive faster");
    v.number("speed_max_m_per_s", speed_max_m_per_s, 0.02, 10.0,
             "fastest cruising speed of a robot in metres per second; each leg of a tour has its own speed; larger "
             "values drive faster");
    v.number("acceleration_m_per_s2", acceleration_m_per_s2, 0.05, 20.0,
             "acceleration of a robot that speeds up or brakes, in metres per second squared; larger values speed up "
             "sooner");
    v.number("turn_rate_deg_per_s", turn_rate_deg_per_s, 5.0, 720.0,
             "largest turn rate of a robot in degrees per second; larger values turn faster");
    v.number("clearance_m", clearance_m, 0.05, 5.0,
             "least distance in metres from a robot's centre to any wall; larger values close narrow passages to it");
    v.number("floor_tilt_deg", floor_tilt_deg, 0.0, 10.0,
             "standard deviation in degrees of the floor's tilt, in waves of 0.4 m to 3 m, which cameras and the "
             "inertial unit feel; larger values tilt them more");
  }
};

// Where a robot's centre may be. Immutable; may be used by many threads.
class FreeSpace {
 public:
  FreeSpace(const FloorPlan& plan, double clearance_m);
  // The nearest free point within 2 m, if any: `wanted` itself where it is free.
  std::optional<Point2> nearest_free(Point2 wanted) const;
  // A path with few corners that keeps the clearance all the way and prefers the middle of passages. Both ends must be
  // free. A*.
  std::optional<std::vector<Point2>> path(Point2 from, Point2 to) const;
  // True where every point between keeps at least this distance from walls (known up to 1 m; conservative to within a
  // cell).
  bool is_straight_path_free(Point2 from, Point2 to, double distance_m) const;
  // A lower bound, to within 8 cm, of the distance to the nearest wall, or 1 m where it is farther; 0 outside of the
  // building.
  double distance_to_walls(Point2) const;
  double clearance_m() const { return clearance_m_; }

 private:
  std::size_t cell_of(Point2) const;  // cells_ when outside
  Point2 centre_of(std::size_t cell) const;
  double clearance_m_;
  double low_x_ = 0.0, low_y_ = 0.0;
  int columns_ = 0, rows_ = 0;
  std::size_t cells_ = 0;
  std::vector<float> distance_m_;  // of each cell's points, at least; row by row; 0 where no room can be reached
};

// A motion along a path, as poses of the robot at seconds since its start. Immutable.
class SimulatedTrajectory {
 public:
  struct Knot {
    double seconds;
    Pose2 world_from_robot;
    double speed_m_per_s = 0.0;  // it changes evenly to the next knot's
  };
  explicit SimulatedTrajectory(std::vector<Knot> knots);  // at least one, seconds rising
  Pose2 at(double seconds) const;                         // before the start and after the end it stands still
  double duration_s() const { return knots_.back().seconds; }
  double length_m() const;
  const std::vector<Knot>& knots() const { return knots_; }  // straight pieces between them, at most 10 cm long

 private:
  std::vector<Knot> knots_;
};

struct Leg {
  std::vector<Point2> path;  // at least two points
  double speed_m_per_s;
};

// Drives the legs one after the other, each starting where the last one ended: corners are rounded as far as the free
// space allows, and turned on the spot where it does not. Stops after `length_m` where that is positive. Starts heading
// along the first leg.
SimulatedTrajectory drive(const std::vector<Leg>& legs, const FreeSpace&, const MotionOptions&, double length_m);

}  // namespace mapweave::simulation
