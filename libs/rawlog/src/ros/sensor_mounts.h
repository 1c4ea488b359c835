#pragma once
// Where the sensors of a bag stand on the robot, by its transforms, and the odometry that is in them.

#include "messages.h"
#include "topic_choice.h"
#include "transforms.h"

#include <mapweave/core/stamp.h>
#include <mapweave/rawlog/observation_stream.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace mapweave::rawlog::ros {

// A pose of the robot in the frame of its odometry.
struct TransformedOdometry {
  std::int64_t stamp_ns = 0;
  Pose3 odometry_from_robot;
};

struct Mount {
  std::optional<Pose3> robot_from_sensor;  // none: not known yet, or not at all
  std::string why_not;
  bool is_before_first = false;  // it is known from a later stamp on
};

// For one thread. `bag`: for messages.
class SensorMounts {
 public:
  SensorMounts(const ChosenTopics& topics, const ReadOptions& options, std::string bag);

  // Answers odometry that the transforms hold, where the bag has no topic of it.
  std::vector<TransformedOdometry> add(MessageReader& reader, bool is_static);
  // The child frame of the odometry's first message is the robot's frame unless an option names one.
  void note_odometry_child(const std::string& frame);

  // Where a sensor stands. `is_final`: nothing more will come that could help.
  Mount find(TopicRole role, const std::string& frame, std::int64_t stamp_ns, bool is_final) const;
  // Without any transform: lasers as the options say, cameras ahead, all else at the robot's origin.
  Pose3 without_transforms(TopicRole role) const;
  std::string frames() const { return transforms_.frames(); }

 private:
  std::optional<std::string> robot_frame(bool is_final) const;

  const ReadOptions& options_;
  std::string bag_;
  bool uses_transforms_, has_odometry_topic_, awaits_odometry_;
  TransformBuffer transforms_;
  std::string odometry_parent_, odometry_child_;
  std::int64_t last_odometry_ns_ = 0;
};

}  // namespace mapweave::rawlog::ros
