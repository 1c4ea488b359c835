#include "topic_recorder.h"

#include "ros_node.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <ros/serialization.h>

#include <algorithm>
#include <utility>

namespace mapweave::ros_nodes {
namespace {

using namespace std::chrono_literals;

constexpr auto kBetweenLooks = 500ms;
constexpr auto kSettled = 2s;
constexpr auto kPatience = 15s;
constexpr auto kLongestLate = 30s;        // all messages of a topic: then something is wrong with its stamps
constexpr std::uint32_t kQueue = 10'000;  // messages of a topic, while the disk is slow

}  // namespace

TopicRecorder::TopicRecorder(ros::NodeHandle node, const runtime::PlannedRobot& robot,
                             const runtime::RunConfiguration& configuration)
    : node_(std::move(node)),
      robot_(robot.id),
      log_(robot.log),
      unsent_(robot.log),
      window_ns_(static_cast<std::int64_t>(configuration_of(configuration, robot).reading.reorder_window_s * 1e9)),
      robot_topics_(robot, configuration) {
  std::error_code ignored;
  if (!std::filesystem::exists(log_, ignored)) return;
  recorder_ = std::make_unique<rawlog::RosRecorder>(log_);
  if (recorder_->is_finished()) {
    if (!unsent_.is_set())
      throw Error(ErrorCode::kBadInput, "is the finished recording of an earlier drive, all of which was sent",
                  log_.string(), "move it away, or name another file as the robot's `log`");
    log(LogLevel::info, "robot " + robot_.str() + " has ended its drive; what was not sent of " + log_.string() +
                            " is sent now, and nothing is recorded any more");
    return;
  }
  log(LogLevel::info, "robot " + robot_.str() + " goes on with the recording " + log_.string());
  expect_topics();
  subscribe();
}

bool TopicRecorder::is_recording() const {
  const std::lock_guard lock(mutex_);
  return recorder_ != nullptr;
}

void TopicRecorder::look() {
  const std::lock_guard lock(mutex_);
  if (trouble_) throw Error(*trouble_);
  if (Clock::now() < next_look_) return;
  next_look_ = Clock::now() + kBetweenLooks;
  if (recorder_) return;
  if (auto topics = found_topics()) begin(std::move(*topics));
}

// Those to be recorded, once something that maps is there and nothing new has come for a while.
std::optional<std::vector<rawlog::RecordedTopic>> TopicRecorder::found_topics() {
  const auto seen = robot_topics_.look();
  if (!seen) return std::nullopt;
  std::vector<std::string> names;
  for (const rawlog::RecordedTopic& topic : seen->topics) names.push_back(topic.name);
  const auto now = Clock::now();
  if (names != last_seen_) seen_since_ = now;
  last_seen_ = std::move(names);
  if (!seen->can_map && now - warned_ > kPatience) {
    if (warned_ != Clock::time_point())
      log(LogLevel::warning, "robot " + robot_.str() + " waits for a laser, a lidar or a camera below " + seen->prefix +
                                 "; the ROS master knows " + std::to_string(seen->topics.size()) +
                                 " topics of sensors and transforms");
    warned_ = now;
  }
  if (!seen->can_map || now - seen_since_ < kSettled) return std::nullopt;
  return robot_topics_.chosen(*seen);
}

void TopicRecorder::begin(std::vector<rawlog::RecordedTopic> topics) {
  std::string names;
  for (const rawlog::RecordedTopic& topic : topics) names += (names.empty() ? "" : ", ") + topic.name;
  unsent_.set();
  recorder_ = std::make_unique<rawlog::RosRecorder>(log_, std::move(topics));
  expect_topics();
  log(LogLevel::info, "robot " + robot_.str() + " records " + names + " into " + log_.string());
  subscribe();
}

void TopicRecorder::expect_topics() {
  is_repeated_.assign(recorder_->topics().size(), false);
  late_since_.assign(recorder_->topics().size(), std::nullopt);
}

void TopicRecorder::subscribe() {
  subscribers_.clear();
  for (std::size_t i = 0; i < recorder_->topics().size(); ++i) {
    ros::SubscribeOptions options;
    options.initByFullCallbackType<const Message&>(recorder_->topics()[i].name, kQueue,
                                                   [this, i](const Message& message) { take(i, message); });
    options.transport_hints.tcpNoDelay();
    subscribers_.push_back(node_.subscribe(options));
  }
}

// What these send is of maps, not of sensors.
bool TopicRecorder::is_of_mapweave(const std::string& publisher) {
  const auto known = publishers_.find(publisher);
  if (known != publishers_.end()) return known->second;
  return publishers_.emplace(publisher, is_node_of_mapweave(publisher)).first->second;
}

void TopicRecorder::take(std::size_t topic, const Message& message) {
  const std::lock_guard lock(mutex_);
  if (trouble_ || !recorder_ || recorder_->is_finished()) return;
  const rawlog::RecordedTopic& of = recorder_->topics()[topic];
  const topic_tools::ShapeShifter& shape = *message.getConstMessage();
  if (is_of_transforms(of.type) && is_of_mapweave(message.getPublisherName())) return;
  std::string bytes(shape.size(), '\0');
  ros::serialization::OStream stream(reinterpret_cast<std::uint8_t*>(bytes.data()),
                                     static_cast<std::uint32_t>(bytes.size()));
  shape.write(stream);
  if (const auto stamp_ns = rawlog::stamp_of_message(of.type, bytes)) {
    const std::int64_t newest_ns = recorder_->newest_ns(topic).value_or(0);
    is_repeated_[topic] = *stamp_ns <= newest_ns && (is_repeated_[topic] || *stamp_ns < newest_ns - window_ns_);
    if (is_repeated_[topic]) {
      if (repeated_++ == 0)
        log(LogLevel::warning, "robot " + robot_.str() + ": the stamps of " + of.name +
                                   " jumped back; what comes is left out until they are newer again (a bag that is "
                                   "played in a loop is mapped once)");
      return;
    }
    if (is_late(topic, *stamp_ns)) return;
  }
  try {
    recorder_->add(topic, static_cast<std::int64_t>(message.getReceiptTime().toNSec()), bytes);
  } catch (const Error& error) {
    trouble_ = error;
  }
}

// Whether it comes so long after newer messages of other topics that no window puts it in order. It is left out then.
bool TopicRecorder::is_late(std::size_t topic, std::int64_t stamp_ns) {
  const std::vector<rawlog::RecordedTopic>& topics = recorder_->topics();
  std::int64_t newest_ns = stamp_ns;
  for (std::size_t other = 0; other < topics.size(); ++other)
    if (topics[other].type != "sensor_msgs/CameraInfo")
      newest_ns = std::max(newest_ns, recorder_->newest_ns(other).value_or(stamp_ns));
  std::optional<Clock::time_point>& since = late_since_[topic];
  if (topics[topic].type == "sensor_msgs/CameraInfo" || newest_ns - stamp_ns <= window_ns_) {
    since.reset();
    return false;
  }
  const std::string by = std::to_string(static_cast<double>(newest_ns - stamp_ns) * 1e-9) + " s";
  if (late_++ == 0)
    log(LogLevel::warning, "robot " + robot_.str() + ": a message of " + topics[topic].name + " came " + by +
                               " after newer ones of other topics, later than reading.reorder_window_s allows; it is "
                               "left out, as all that come so late");
  if (!since) since = Clock::now();
  if (Clock::now() - *since > kLongestLate)
    trouble_ =
        Error(ErrorCode::kBadInput,
              "the stamps of " + topics[topic].name + " stay " + by + " behind those of the robot's other topics",
              "robot " + robot_.str(),
              "let its driver stamp when it sensed, or set reading.reorder_window_s "
              "to more than that");
  return true;
}

// Not under mutex_: roscpp waits for a message that is being taken, which waits for mutex_.
void TopicRecorder::unsubscribe() {
  std::vector<ros::Subscriber> subscribers;
  {
    const std::lock_guard lock(mutex_);
    subscribers.swap(subscribers_);
  }
  for (ros::Subscriber& subscriber : subscribers) subscriber.shutdown();
}

void TopicRecorder::finish() {
  unsubscribe();
  const std::lock_guard lock(mutex_);
  if (late_ > 0)
    log(LogLevel::warning,
        "robot " + robot_.str() + ": " + std::to_string(late_) + " messages came too late and were left out");
  if (recorder_) recorder_->finish();
}

void TopicRecorder::sent() { unsent_.clear(); }

void TopicRecorder::leave() {
  unsubscribe();
  const std::lock_guard lock(mutex_);
  recorder_.reset();
}

}  // namespace mapweave::ros_nodes
