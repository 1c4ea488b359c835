#include "bag_source.h"

#include "../say_once.h"
#include "camera_conversion.h"
#include "scan_conversion.h"
#include "sensor_mounts.h"
#include "topic_choice.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mrpt/obs/CObservationOdometry.h>

#include <cstdio>
#include <deque>
#include <map>
#include <optional>
#include <utility>

namespace mapweave::rawlog::ros {
namespace {

bool is_same_place(const Pose3& one, const Pose3& other) {
  constexpr double kMetres = 0.005, kRadians = 0.005;
  const Pose3 apart = compose(inverse(one), other);
  return apart.t.norm() < kMetres && Eigen::AngleAxisd(apart.q).angle() < kRadians;
}

// Transforms and calibrations may come after what they are needed for; so long, and with so many bytes waiting.
constexpr std::int64_t kPatience_ns = 5'000'000'000;
constexpr std::size_t kMostWaiting_bytes = 200'000'000;
constexpr std::int64_t kLatest_ns = 3'900'000'000'000'000'000;  // what a Stamp may be, with room to spare

// A message that waits for what it needs, behind those that came before it.
struct Waiting {
  BagMessage message;
  std::size_t topic = 0;  // of ChosenTopics
  std::int64_t stamp_ns = 0;
  std::string frame;
  std::optional<PlacedRecord> ready;  // odometry of a transform
};

PlacedRecord odometry_record(const Pose3& odometry_from_robot, std::int64_t stamp_ns, const std::string& label,
                             std::uint64_t place) {
  auto odometry = std::make_shared<mrpt::obs::CObservationOdometry>();
  odometry->timestamp = to_mrpt_time(Stamp{stamp_ns});
  odometry->sensorLabel = label;
  odometry->odometry = mrpt::poses::CPose2D(planar(odometry_from_robot));
  const Stamp stamp = to_stamp(odometry->timestamp);
  return {{stamp, std::move(odometry)}, place};
}

// Two lasers on one topic differ by their frames, unless transforms put both frames in one place.
class LasersOfTopic {
 public:
  // The label of the laser of a frame, and what is to be said of a frame that is new. `label`: of the first one.
  // robot_from_laser: none without transforms.
  std::pair<std::string, std::string> named(const std::string& label, const std::string& frame,
                                            const std::optional<Pose3>& robot_from_laser) {
    for (const Frame& known : frames_)
      if (known.name == frame) return {known.label, {}};
    if (frames_.empty()) {
      frames_.push_back({frame, robot_from_laser, label});
      return {label, {}};
    }
    const std::string both = "the frames '" + frames_.front().name + "' and '" + frame + "'";
    for (const Frame& known : frames_) {
      if (!robot_from_laser || !known.robot_from_laser || !is_same_place(*known.robot_from_laser, *robot_from_laser))
        continue;
      frames_.push_back({frame, robot_from_laser, known.label});
      return {frames_.back().label, both + ", which stand in one place: taken for one laser"};
    }
    frames_.push_back({frame, robot_from_laser, label + "@" + frame});
    return {frames_.back().label, both + ": taken for two lasers, '" + label + "' and '" + frames_.back().label +
                                      "', of which laser.scan.label chooses one"};
  }

 private:
  struct Frame {
    std::string name;
    std::optional<Pose3> robot_from_laser;
    std::string label;
  };
  std::vector<Frame> frames_;
};

class BagSource final : public RecordSource {
 public:
  BagSource(std::unique_ptr<BagReader> bag, const std::filesystem::path& path, const ReadOptions& options)
      : bag_(std::move(bag)),
        path_(path.string()),
        options_(options),
        chosen_(choose_topics(bag_->topics(), options_, path_)),
        mounts_(chosen_, options_, path_),
        rings_(chosen_.topics.size()) {
    std::vector<std::size_t> wanted;
    for (std::size_t i = 0; i < chosen_.topics.size(); ++i) {
      wanted.push_back(chosen_.topics[i].topic);
      by_topic_[chosen_.topics[i].topic] = i;
    }
    for (const BagCamera& camera : chosen_.cameras) cameras_.emplace_back(camera, options_.max_pair_s, path_);
    bag_->select(wanted);
  }

  bool read(std::vector<PlacedRecord>& records) override {
    if (ended_) return false;
    try {
      BagMessage message;
      if (bag_->next(message)) {
        newest_ns_ = std::max(newest_ns_, message.received_ns);
        at_message(message, [&] { take(std::move(message)); });
      } else {
        ended_ = true;
      }
    } catch (const Error&) {
      ended_ = true;
      finish(records);  // what came before is good
      throw;
    }
    release(records);
    if (ended_) finish(records);
    return true;
  }

  std::string place_name(std::uint64_t place) const override { return bag_->place_name(place); }
  std::string path() const override { return path_; }
  std::string nothing_found() const override { return "its topics have no message that can be used"; }
  std::uint64_t bytes_read() const override { return bag_->bytes_read(); }
  std::uint64_t bytes_total() const override { return bag_->bytes_total(); }

 private:
  const ChosenTopic& chosen(const Waiting& waiting) const { return chosen_.topics[waiting.topic]; }
  const std::string& name_of(std::size_t topic) const { return bag_->topics()[chosen_.topics[topic].topic].name; }

  // An Error of what a message holds becomes one that says where the message is.
  template <class Work>
  void at_message(const BagMessage& message, const Work& work) const {
    const std::uint64_t place = message.place;
    const std::size_t topic = message.topic;
    try {
      work();
    } catch (const Error& error) {
      const std::string where = bag_->place_name(place) + ", topic " + bag_->topics()[topic].name;
      const std::string doubt = bag_->doubt();
      throw Error(error.code(), error.problem() + (doubt.empty() ? "" : "; " + doubt),
                  where + (error.where().empty() ? "" : ", " + error.where()),
                  error.remedy().empty() ? "map what precedes it with --keep-going" : error.remedy());
    }
  }

  MessageReader reader_of(const BagMessage& message) const {
    return {message.data, bag_->topics()[message.topic].encoding};
  }

  void take(BagMessage message) {
    const auto found = by_topic_.find(message.topic);
    if (found == by_topic_.end()) return;
    const ChosenTopic& topic = chosen_.topics[found->second];
    MessageReader reader = reader_of(message);
    switch (topic.role) {
      case TopicRole::transforms:
      case TopicRole::static_transforms:
        for (const TransformedOdometry& odometry : mounts_.add(reader, topic.role == TopicRole::static_transforms)) {
          Waiting waiting;
          waiting.ready =
              odometry_record(odometry.odometry_from_robot,
                              stamp_of(odometry.stamp_ns, message.received_ns, found->second), "odom", message.place);
          waiting_.push_back(std::move(waiting));
        }
        return;
      case TopicRole::calibration: cameras_[topic.camera].calibrate(found->second, read_camera_info(reader)); return;
      default: enqueue(std::move(message), found->second);
    }
  }

  void enqueue(BagMessage message, std::size_t topic) {
    Waiting waiting;
    MessageReader reader = reader_of(message);
    const MessageHeader header = reader.header();
    waiting.topic = topic;
    waiting.stamp_ns = stamp_of(header.stamp_ns, message.received_ns, topic);
    waiting.frame = frame_name(header.frame_id);
    if (chosen_.topics[topic].role == TopicRole::odometry) {
      waiting.frame = frame_name(reader.string());  // the child, which stands on the robot
      mounts_.note_odometry_child(waiting.frame);
    }
    waiting_bytes_ += message.data.size();
    waiting.message = std::move(message);
    waiting_.push_back(std::move(waiting));
  }

  std::int64_t stamp_of(std::int64_t stamp_ns, std::int64_t received_ns, std::size_t topic) const {
    if (stamp_ns == 0 && received_ns != 0) {
      say_once(path_ + ": messages of " + name_of(topic) +
               " have stamps of zero; the times when they were received are used");
      stamp_ns = received_ns;
    }
    if (stamp_ns > kLatest_ns || stamp_ns < -kLatest_ns)
      throw Error(ErrorCode::kBadInput, "the stamp " + seconds_text(stamp_ns) + " makes no sense");
    return stamp_ns;
  }

  // In the order in which they came; the first one that must wait holds all others back.
  void release(std::vector<PlacedRecord>& records) {
    while (!waiting_.empty()) {
      Waiting& front = waiting_.front();
      if (front.ready) {
        records.push_back(std::move(*front.ready));
      } else {
        const bool is_final = ended_ || chosen(front).role == TopicRole::position ||
                              newest_ns_ - front.message.received_ns > kPatience_ns ||
                              waiting_bytes_ > kMostWaiting_bytes;
        bool is_done = true;
        at_message(front.message, [&] { is_done = convert(front, is_final, records); });
        if (!is_done) return;
        waiting_bytes_ -= front.message.data.size();
      }
      waiting_.pop_front();
    }
  }

  // False where it must wait.
  bool convert(const Waiting& waiting, bool is_final, std::vector<PlacedRecord>& records) {
    const TopicRole role = chosen(waiting).role;
    const bool is_picture = role == TopicRole::image || role == TopicRole::depth_image;
    if (is_picture && !is_final && cameras_[chosen(waiting).camera].awaits_calibration(waiting.topic)) return false;
    Mount mount = mounts_.find(role, waiting.frame, waiting.stamp_ns, false);
    if (!mount.robot_from_sensor) {
      if (!is_final) return false;
      mount = mounts_.find(role, waiting.frame, waiting.stamp_ns, true);
    }
    if (!mount.robot_from_sensor && mount.is_before_first) {
      ++too_early_[waiting.topic];
      return true;
    }
    if (!mount.robot_from_sensor) mount.robot_from_sensor = stand_in(waiting, mount.why_not);
    add(waiting, *mount.robot_from_sensor, records);
    return true;
  }

  // Where no transform will come. A laser or odometry that is placed wrongly makes a wrong map.
  Pose3 stand_in(const Waiting& waiting, const std::string& why_not) const {
    const TopicRole role = chosen(waiting).role;
    const std::string remedy =
        "record /tf and /tf_static with it, name the robot's frame with reading.robot_frame, or say where the laser "
        "stands: --set reading.use_tf=false --set reading.laser_x_m=...";
    const std::string frames = mounts_.frames();
    const std::string what = why_not + ", since " + seconds_text(waiting.stamp_ns) + "; there are " +
                             (frames.empty() ? "no transforms" : frames);
    const bool is_picture = role == TopicRole::image || role == TopicRole::depth_image;
    if (!is_picture && role != TopicRole::imu && role != TopicRole::position)
      throw Error(ErrorCode::kMissing, what, {}, remedy);
    say_once(path_ + ": " + name_of(waiting.topic) + ": " + why_not + "; it is taken to stand at the robot's origin" +
             (is_picture ? ", looking ahead" : ""));
    return mounts_.without_transforms(role);
  }

  void add(const Waiting& waiting, const Pose3& robot_from_sensor, std::vector<PlacedRecord>& records) {
    MessageReader reader = reader_of(waiting.message);
    switch (chosen(waiting).role) {
      case TopicRole::scan:
        return add_scan(waiting, robot_from_sensor, to_scan(read_laser_scan(reader), robot_from_sensor), records);
      case TopicRole::multi_echo_scan:
        return add_scan(waiting, robot_from_sensor, to_scan(read_multi_echo_scan(reader), robot_from_sensor), records);
      case TopicRole::cloud:
        return add_scan(waiting, robot_from_sensor,
                        to_scan(read_point_cloud(reader), robot_from_sensor, options_, rings_[waiting.topic]), records);
      case TopicRole::odometry: {
        const Pose3 odometry_from_child = read_odometry(reader).pose;
        records.push_back(odometry_record(compose(odometry_from_child, inverse(robot_from_sensor)), waiting.stamp_ns,
                                          chosen(waiting).label, waiting.message.place));
        return;
      }
      case TopicRole::imu:
        return add_observation(to_imu(read_imu(reader), robot_from_sensor), waiting, chosen(waiting).label, records);
      case TopicRole::position:
        return add_observation(to_gps(read_position(reader), robot_from_sensor), waiting, chosen(waiting).label,
                               records);
      default: {
        const PictureOrigin origin{Stamp{waiting.stamp_ns}, waiting.frame, robot_from_sensor, waiting.message.place};
        cameras_[chosen(waiting).camera].add(waiting.topic, reader, chosen(waiting).form, origin, records);
      }
    }
  }

  void add_scan(const Waiting& waiting, const Pose3& robot_from_laser, ConvertedScan converted,
                std::vector<PlacedRecord>& records) {
    if (!converted.problem.empty())
      say_once(path_ + ": a scan of " + name_of(waiting.topic) + ": " + converted.problem +
               (converted.scan ? "" : "; it is left out"));
    if (converted.scan)
      add_observation(std::move(converted.scan), waiting, label_of(waiting, robot_from_laser), records);
  }

  std::string label_of(const Waiting& waiting, const Pose3& robot_from_laser) {
    const auto [laser, news] =
        lasers_[waiting.topic].named(chosen(waiting).label, waiting.frame,
                                     mounts_.frames().empty() ? std::nullopt : std::optional(robot_from_laser));
    if (!news.empty()) say_once(path_ + ": " + name_of(waiting.topic) + " holds scans of " + news);
    return laser;
  }

  void add_observation(std::shared_ptr<mrpt::obs::CObservation> observation, const Waiting& waiting,
                       const std::string& label, std::vector<PlacedRecord>& records) const {
    observation->timestamp = to_mrpt_time(Stamp{waiting.stamp_ns});
    observation->sensorLabel = label;
    const Stamp stamp = to_stamp(observation->timestamp);
    records.push_back({{stamp, std::move(observation)}, waiting.message.place});
  }

  void finish(std::vector<PlacedRecord>& records) {
    release(records);
    for (CameraConversion& camera : cameras_) camera.finish(records);
    for (const auto& [topic, count] : too_early_)
      log(LogLevel::warning, path_ + ": " + std::to_string(count) + " messages of " + name_of(topic) +
                                 " are left out: they came before their transforms");
  }

  std::unique_ptr<BagReader> bag_;
  std::string path_;
  ReadOptions options_;
  ChosenTopics chosen_;
  SensorMounts mounts_;
  std::vector<std::optional<int>> rings_;  // by topic
  std::map<std::size_t, std::size_t> by_topic_;
  std::vector<CameraConversion> cameras_;
  std::deque<Waiting> waiting_;
  std::size_t waiting_bytes_ = 0;
  std::int64_t newest_ns_ = 0;
  bool ended_ = false;
  std::map<std::size_t, LasersOfTopic> lasers_;  // of each topic
  std::map<std::size_t, std::uint64_t> too_early_;
};

}  // namespace

std::unique_ptr<RecordSource> open_bag_source(std::unique_ptr<BagReader> bag, const std::filesystem::path& path,
                                              const ReadOptions& options) {
  return std::make_unique<BagSource>(std::move(bag), path, options);
}

}  // namespace mapweave::rawlog::ros
