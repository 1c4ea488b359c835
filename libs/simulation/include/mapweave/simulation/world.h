#pragma once
// A world that has been built: plans, everyone's motion, and for each robot the stream of what its sensors say, with
// the truth.

#include <mapweave/core/ids.h>
#include <mapweave/core/stamp.h>
#include <mapweave/core/worker_pool.h>
#include <mapweave/simulation/world_options.h>

#include <memory>
#include <optional>
#include <vector>

namespace mapweave::simulation {

// One odometry reading and, at every steps_per_scan-th of them, the scan taken at the same moment.
struct SimulatedStep {
  Stamp stamp;
  Pose2 world_from_robot;     // the truth
  Pose2 odometry_from_robot;  // what the wheels say; (0, 0, 0) at the robot's first step
  std::vector<float>
      ranges;  // metres, ray by ray from LaserOptions::first_angle_rad(); 0: no return; empty: no scan at this step
};

// Immutable once built; may be used by many threads. A pure function of its options: the order in which robots are
// listed changes nothing but their numbers.
class World {
 public:
  // Throws Error kBadInput, naming the key, for worlds that cannot be: no robots, two with one id, a room that is not
  // there, a point that cannot be reached.
  World(WorldOptions options, WorkerPool& pool);
  ~World();
  World(World&&) noexcept;

  const WorldOptions& options() const;
  const std::vector<FloorPlan>& buildings() const;  // in the world's frame
  std::size_t robot_count() const;
  RobotId robot_id(std::size_t robot) const;
  std::size_t building_of(std::size_t robot) const;
  const SimulatedTrajectory& trajectory(std::size_t robot) const;  // seconds since the robot's own start
  std::size_t step_count(std::size_t robot) const;
  std::size_t scan_count(std::size_t robot) const;

  // Of cameras. Times are seconds since the robot's own start.
  const std::vector<CameraOptions>& cameras(std::size_t robot) const;
  const Scene& scene(std::size_t building) const;  // painted when first asked for, which takes a second or two
  Stamp first_stamp(std::size_t robot) const;
  Pose3 world_from_robot(std::size_t robot, double seconds) const;  // on the floor as it is, waves and all
  std::vector<Body> bodies_around(std::size_t robot,
                                  double seconds) const;  // robots and people in its building, but for itself
  bool is_carried(std::size_t robot, double seconds, double within_s = 0.0) const;  // at any time within these of it

 private:
  friend class Recording;
  struct State;
  std::unique_ptr<const State> state_;
};

// One robot's recording, step by step, in constant memory. The world must outlive it. Not thread-safe; many may run at
// once.
class Recording {
 public:
  Recording(const World& world, std::size_t robot);
  std::optional<SimulatedStep> next();  // none: the end

 private:
  const World* world_;
  std::size_t robot_, step_ = 0;
  WheelOdometry odometry_;
};

}  // namespace mapweave::simulation
