#pragma once
// Which topics of a ROS master are a robot's: those that would be read of a recording that holds them all.

#include <mapweave/rawlog/ros_recorder.h>
#include <mapweave/runtime/run_configuration.h>

#include <optional>
#include <string>
#include <vector>

namespace mapweave::ros_nodes {

bool is_of_transforms(const std::string& type);

class RobotTopics {
 public:
  RobotTopics(const runtime::PlannedRobot& robot, const runtime::RunConfiguration& configuration);

  // Of a moment. Names are those that this node has for topics: of remapped ones those that they stand for.
  struct Seen {
    std::vector<rawlog::RecordedTopic> topics;  // of sensors and transforms of all robots, by name
    std::string prefix;                         // of this robot's: /tb0/, or / of one without a namespace
    rawlog::ReadOptions reading;
    bool has_range = false;  // a laser or a lidar of this robot
    bool can_map = false;    // that, or a camera
  };
  std::optional<Seen> look() const;  // nullopt: no master answers

  // Throws as rawlog::topics_to_record.
  std::vector<rawlog::RecordedTopic> chosen(const Seen& seen) const;
  // That of its odometry among them. nullopt: there is none, or it is not clear which one.
  std::optional<std::string> odometry() const;

 private:
  const RobotId robot_;
  const rawlog::ReadOptions reading_;
  const std::string sensor_;
  const bool is_alone_;  // its topics may be in no namespace
};

}  // namespace mapweave::ros_nodes
