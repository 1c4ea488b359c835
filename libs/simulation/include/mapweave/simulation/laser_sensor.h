#pragma once
// A planar laser scanner: exact ranges from the plan, then noise, outliers and dropouts.

#include <mapweave/simulation/random.h>
#include <mapweave/simulation/ray_caster.h>

#include <cmath>
#include <functional>
#include <vector>

namespace mapweave::simulation {

struct SimulatedLaserOptions {
  int rays = 181;
  double field_of_view_deg = 180.0;
  double max_range_m = 20.0;
  double scans_per_second = 5.0;
  double x_m = 0.0, y_m = 0.0, yaw_deg = 0.0;
  double noise_m = 0.01;
  double noise_per_m = 0.001;
  double sweep_s = 0.0;
  bool clockwise = false;
  double sweep_stamp = 0.0;
  double outliers = 0.001;
  double dropouts = 0.002;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("rays", rays, 2, 4000, "number of rays of a scan; larger values give denser scans");
    v.number("field_of_view_deg", field_of_view_deg, 1.0, 360.0,
             "angle in degrees from the first ray of a scan to its last, straight ahead in the middle; larger values "
             "see more");
    v.number("max_range_m", max_range_m, 0.5, 200.0,
             "distance in metres beyond which the laser sees nothing; larger values see more");
    v.number("scans_per_second", scans_per_second, 0.1, 100.0,
             "scans of the laser per second; larger values give more scans");
    v.number("x_m", x_m, -2.0, 2.0, "distance in metres of the laser ahead of the robot's origin");
    v.number("y_m", y_m, -2.0, 2.0, "distance in metres of the laser to the left of the robot's origin");
    v.number("yaw_deg", yaw_deg, -180.0, 180.0,
             "angle in degrees by which the laser is turned counter-clockwise from straight ahead");
    v.number("noise_m", noise_m, 0.0, 1.0,
             "constant part, in metres, of a range's standard deviation; larger values give noisier scans");
    v.number("noise_per_m", noise_per_m, 0.0, 0.2,
             "growth of a range's standard deviation in metres per metre of range; larger values give noisier scans "
             "far away");
    v.number("sweep_s", sweep_s, 0.0, 5.0,
             "time in seconds from the first measured ray of a scan to its last; larger values bend scans of a moving "
             "robot more; 0: all rays at once");
    v.flag("clockwise", clockwise, "measure the leftmost ray of a scan first; false: the rightmost one");
    v.fraction("sweep_stamp", sweep_stamp,
               "part of the sweep that is over at a scan's stamp; 0: it is stamped at the first measured ray, 1: at "
               "the last one");
    v.fraction("outliers", outliers,
               "share of rays that end at random before the wall; larger values give worse scans");
    v.fraction("dropouts", dropouts, "share of rays that return nothing; larger values give emptier scans");
  }
  double first_angle_rad() const { return -0.5 * field_of_view_deg * (M_PI / 180.0); }  // in the laser's frame
  double angle_step_rad() const { return field_of_view_deg * (M_PI / 180.0) / (rays - 1); }
  double first_ray_s() const { return sweep_s * ((clockwise ? 1.0 : 0.0) - sweep_stamp); }  // of ray 0, after the stamp
  double ray_step_s() const { return (clockwise ? -sweep_s : sweep_s) / (rays - 1); }
  Pose2 robot_from_laser() const { return {x_m, y_m, yaw_deg * (M_PI / 180.0)}; }
};

// Something round that moves: a person's legs, another robot.
struct Disc {
  Point2 centre_in_world;
  double radius_m = 0.2;
};

// Immutable; may be used by many threads. The caster must outlive it.
class LaserSensor {
 public:
  LaserSensor(const RayCaster& building, const SimulatedLaserOptions& options);
  // Ranges in metres, ray by ray counter-clockwise; 0: no return. A disc that covers the laser itself is not seen.
  std::vector<float> scan(const Pose2& world_from_robot, const std::vector<Disc>& moving, RandomNumbers noise) const;
  // The same of a robot on its way, ray by ray from where it is at that time; `world_from_robot`: by seconds after the
  // stamp. What moves besides stands still meanwhile.
  std::vector<float> swept_scan(const std::function<Pose2(double)>& world_from_robot, const std::vector<Disc>& moving,
                                RandomNumbers noise) const;
  const SimulatedLaserOptions& options() const { return options_; }

 private:
  const RayCaster* building_;
  SimulatedLaserOptions options_;
  float range(const Pose2& world_from_robot, std::size_t ray, const std::vector<Disc>& in_view,
              RandomNumbers& noise) const;
  std::vector<Disc> in_view(const Pose2& world_from_robot, const std::vector<Disc>& moving) const;
  std::vector<Point2> directions_;  // of the rays, in the robot's frame
};

}  // namespace mapweave::simulation
