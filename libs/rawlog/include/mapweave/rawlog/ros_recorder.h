#pragma once
// Writes what arrives on ROS 1 topics into an MCAP recording, message by message, so that it can be read while it grows
// (ReadOptions::follow). A recorder that was killed, or let go of, is gone on with where its
// file ends.

#include <mapweave/rawlog/growing_log.h>
#include <mapweave/rawlog/observation_stream.h>

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::rawlog {

struct RecordedTopic {
  std::string name, type;  // "/alpha/scan", "sensor_msgs/LaserScan"
  std::string definition;  // of the type, as ROS has it; other programs need it
};

// Which of the topics that are there are read of a recording that holds them, by the reading options: what maps,
// odometry, inertial units, transforms and calibrations; of cameras those that `reading` names, or all where they are
// wanted. where: of what, for errors. Throws Error(kBadInput) where nothing can be mapped, and where it is not clear
// which one.
std::vector<RecordedTopic> topics_to_record(const std::vector<RecordedTopic>& there, const ReadOptions& reading,
                                            bool with_cameras, const std::string& where);

// Of a message as ROS serialized it, ns since 1970: the stamp of the header with which it begins. nullopt of
// transforms, which come in any order, and of a stamp of 0.
std::optional<std::int64_t> stamp_of_message(const std::string& type, std::string_view message);

// Whether transforms from this frame are odometry, by its name: odom, tb0/odom_combined.
bool is_odometry_frame(const std::string& frame);

// What was written so far is never lost: it is in the file when add() returns. Thread-safe.
class RosRecorder {
 public:
  // Begins a recording. Throws Error: kCannotWrite, also where the file is there already.
  RosRecorder(std::filesystem::path path, std::vector<RecordedTopic> topics);
  // Goes on with one, behind its last whole message; one that is finished stays so. Throws Error: kMissing,
  // kCannotWrite where another program writes it, kBadInput where it was not written by this class.
  explicit RosRecorder(std::filesystem::path path);

  const std::filesystem::path& path() const { return file_.path(); }
  const std::vector<RecordedTopic>& topics() const { return topics_; }
  // message: as ROS serialized it. received_ns: since 1970. Nothing once it is finished. Throws Error(kCannotWrite).
  void add(std::size_t topic, std::int64_t received_ns, std::string_view message);
  // Who follows it reaches its end. Throws Error(kCannotWrite).
  void finish();
  bool is_finished() const;
  std::uint64_t messages() const;  // of this recorder
  // The newest stamp_of_message() in the recording; nullopt: none has one.
  std::optional<std::int64_t> newest_ns(std::size_t topic) const;

 private:
  std::vector<RecordedTopic> topics_;
  mutable std::mutex mutex_;
  GrowingLog file_;
  std::uint64_t messages_ = 0;
  std::vector<std::optional<std::int64_t>> newest_ns_;  // by topic
};

}  // namespace mapweave::rawlog
