#pragma once
// Records a robot's sensor topics while they come, for a robot of a deployment that reads the recording as it grows.

#include "robot_topics.h"

#include <ros/ros.h>
#include <topic_tools/shape_shifter.h>

#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::ros_nodes {

// Calls are thread-safe; messages are taken by whoever spins.
class TopicRecorder {
 public:
  // Into the robot's log. Goes on with a recording; one that was finished, but not sent, is that of a drive that has
  // ended: nothing is added to it. Throws as RosRecorder, and Error(kBadInput) where all of it was sent.
  TopicRecorder(ros::NodeHandle node, const runtime::PlannedRobot& robot,
                const runtime::RunConfiguration& configuration);

  // Now and then: looks for the robot's topics, and begins once they are there and no new ones come. Throws Error:
  // kBadInput where it is not clear which topics it should take or where the stamps of one stay behind, kCannotWrite
  // where the disk is full.
  void look();
  bool is_recording() const;
  void finish();  // what comes later is left out
  void leave();   // the program ends: another one goes on with the recording
  void sent();    // the robot's edge has it all, or the map is written: nobody goes on with it

 private:
  using Clock = std::chrono::steady_clock;
  using Message = ros::MessageEvent<topic_tools::ShapeShifter const>;
  std::optional<std::vector<rawlog::RecordedTopic>> found_topics();
  void begin(std::vector<rawlog::RecordedTopic> topics);
  void expect_topics();
  void subscribe();
  void unsubscribe();
  void take(std::size_t topic, const Message& message);
  bool is_late(std::size_t topic, std::int64_t stamp_ns);
  bool is_of_mapweave(const std::string& publisher);

  ros::NodeHandle node_;
  const RobotId robot_;
  const std::filesystem::path log_;
  const rawlog::UnsentMark unsent_;
  const std::int64_t window_ns_;
  const RobotTopics robot_topics_;

  mutable std::mutex mutex_;
  std::unique_ptr<rawlog::RosRecorder> recorder_;  // null: it waits for topics
  std::vector<ros::Subscriber> subscribers_;
  std::vector<std::string> last_seen_;  // topics, while they still come
  Clock::time_point seen_since_{}, next_look_{}, warned_{};
  std::vector<bool> is_repeated_;                             // by topic: its stamps jumped back
  std::vector<std::optional<Clock::time_point>> late_since_;  // by topic: all of its messages have been late
  std::map<std::string, bool> publishers_;                    // whether they are programs of mapweave
  std::uint64_t repeated_ = 0, late_ = 0;
  std::optional<Error> trouble_;
};

}  // namespace mapweave::ros_nodes
