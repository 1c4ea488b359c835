#pragma once
// One pose of a robot from its laser, its cameras and its wheels, as it comes (CVS III): at each stamp what a user of
// the robot would have received then. Nothing is smoothed afterwards: loop closures show as jumps.

#include <mapweave/core/stamped_pose.h>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::rig {

// Which sensor speaks where several know where the robot is.
enum class FirstSource { laser, cameras };

struct FusedPoseOptions {
  FirstSource first = FirstSource::laser;
  double silence_s = 0.5;
  double jump_m = 0.1, jump_rad = 0.05;
  double scale_path_m = 2.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.choice("first", first, {{"laser", FirstSource::laser}, {"cameras", FirstSource::cameras}},
             "sensor that gives the robot's pose (robot.tum) where several do; laser: the laser, then cameras with "
             "depth, then single cameras; cameras: the laser last");
    v.positive("silence_s", silence_s,
               "time in seconds without a pose after which a sensor counts as failed and the next one gives the "
               "robot's pose (robot.tum), or the wheels; larger values fail over later");
    v.positive("jump_m", jump_m,
               "a pose in robot.tum farther than this distance in metres from where wheels (without them the motion "
               "before) expected it is marked as a jump; larger values mark fewer");
    v.positive("jump_rad", jump_rad,
               "a pose in robot.tum turned by more than this angle in radians against where wheels (without them the "
               "motion before) expected it is marked as a jump; larger values mark fewer");
    v.positive("scale_path_m", scale_path_m,
               "length in metres of the path by wheels after which a single camera's scale is known and it may give "
               "the robot's pose (robot.tum); larger values are more accurate and let wheels speak longer");
  }
};

struct PoseSensor {
  std::string name;
  bool is_laser = false, is_metric = true;  // not metric: a single camera, in units of its own
  Pose3 robot_from_sensor;                  // matters where it is not metric
};

// What a sensor said when it took a scan or a frame, from what was known then.
struct SensorPose {
  Stamp stamp;
  int session = 0;  // which of the sensor's maps, each with a frame of its own
  Pose3 map_from_robot;
};

struct SpokenPoses {
  PoseSensor sensor;
  std::vector<SensorPose> poses;  // by stamp; none where it did not know where it was
};

enum class PoseEvent { none, begins, fails_over, returns, new_map, jump };
const char* to_text(PoseEvent event);

struct FusedPose {
  Stamp stamp;
  Pose3 map_from_robot;      // in the frame of the first sensor that spoke
  std::size_t source = 0;    // who gave it: number of a sensor; the number of sensors for wheels
  std::size_t leader = 0;    // who is in charge: wheels only where no sensor knew
  double deviation_m = 0.0;  // standard deviation against the map of the sensor that spoke last
  double alone_s = 0.0;      // since a sensor spoke
  PoseEvent event = PoseEvent::none;
  double jump_m = 0.0, jump_rad = 0.0;  // against what was expected; where a sensor speaks
};

// What the policy did, for the summary.
struct FusedPoseReport {
  struct Source {
    std::string name;
    std::size_t poses = 0;
    double led_s = 0.0;
  };
  std::vector<Source> sources;  // by priority; wheels last
  std::size_t failovers = 0, returns = 0, jumps = 0;
  double longest_on_wheels_s = 0.0;  // while no sensor knew
  double longest_gap_s = 0.0;        // between two poses
  double largest_jump_m = 0.0, largest_jump_rad = 0.0;
  std::optional<double> scale;  // of a single camera, once wheels gave it
  bool is_metric = true;        // false: in the units of a single camera
};

struct FusedTrajectory {
  std::vector<FusedPose> poses;  // by stamp, each stamp once (to the microsecond)
  FusedPoseReport report;
  std::vector<StampedPose> stamped() const;
  std::string sources_csv() const;  // a line for each pose
};

// Each pose rests on what came until its stamp. `odometry`: of the robot, by stamp, in a frame of its own; may be
// empty.
FusedTrajectory fused_poses(std::vector<SpokenPoses> sensors, const std::vector<StampedPose>& odometry,
                            const FusedPoseOptions& options = {});

}  // namespace mapweave::rig
