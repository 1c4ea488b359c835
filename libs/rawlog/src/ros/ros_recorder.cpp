#include "mcap_records.h"
#include "topic_choice.h"

#include <mapweave/core/error.h>
#include <mapweave/rawlog/ros_recorder.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

namespace mapweave::rawlog {
namespace {

using mcap::append_record;
using mcap::Opcode;

constexpr std::size_t kMostHeadBytes = std::size_t{1} << 20;        // of all that stands before the first message
constexpr std::size_t kStampAt = 4, kStampBytes = 8;                // in a message that begins with a header
constexpr std::size_t kMessageStart = 22 + kStampAt + kStampBytes;  // fields of a record up to the message's stamp

// All that stands before the first message; a schema for each topic.
std::string beginning_of(const std::vector<RecordedTopic>& topics) {
  std::string bytes(mcap::kMagic);
  mcap::append_header(bytes, "ros1", ros::kRecorderLibrary);
  for (std::uint16_t i = 0; i < topics.size(); ++i) {
    const auto schema = static_cast<std::uint16_t>(i + 1);
    mcap::append_schema(bytes, schema, topics[i].type, "ros1msg", topics[i].definition);
    mcap::append_channel(bytes, i, schema, topics[i].name, "ros1", "");
  }
  return bytes;
}

std::string end_of_recording() {
  std::string bytes, footer;
  mcap::append_data_end(bytes);
  append_number(footer, std::uint64_t{0});  // no summary
  append_number(footer, std::uint64_t{0});
  append_number(footer, std::uint32_t{0});
  append_record(bytes, Opcode::kFooter, footer);
  return bytes + std::string(mcap::kMagic);
}

void raise(std::optional<std::int64_t>& newest_ns, std::optional<std::int64_t> stamp_ns) {
  if (stamp_ns) newest_ns = std::max(newest_ns.value_or(*stamp_ns), *stamp_ns);
}

// Goes over the records of a recording.
class WholeRecords {
 public:
  explicit WholeRecords(const GrowingLog& file) : file_(file) {}

  // Where the last whole record ends, before those of the recording's end.
  std::uint64_t walk() {
    if (read(0, mcap::kMagic.size()) != mcap::kMagic) refuse("is no MCAP recording");
    std::uint64_t at = mcap::kMagic.size();
    for (bool is_first = true; file_.bytes() - at >= ros::kRecordHeadBytes; is_first = false) {
      const ros::RecordHead head = ros::parse_head(read(at, ros::kRecordHeadBytes).c_str());
      is_finished_ = head.opcode == Opcode::kDataEnd || head.opcode == Opcode::kFooter;
      if (is_finished_) break;
      if (head.bytes > file_.bytes() - at - ros::kRecordHeadBytes) break;
      take(head, at + ros::kRecordHeadBytes, is_first);
      at += ros::kRecordHeadBytes + head.bytes;
    }
    if (channels_.topics().empty()) refuse("has no topics");
    return at;
  }

  std::vector<RecordedTopic> topics() const {
    std::vector<RecordedTopic> topics;
    for (const ros::BagTopic& topic : channels_.topics()) topics.push_back({topic.name, topic.type, {}});
    return topics;
  }
  bool is_finished() const { return is_finished_; }
  std::vector<std::optional<std::int64_t>> newest_ns() const {
    std::vector<std::optional<std::int64_t>> newest = newest_ns_;
    newest.resize(channels_.topics().size());
    return newest;
  }

 private:
  void take(const ros::RecordHead& head, std::uint64_t at, bool is_first) {
    if (head.opcode == Opcode::kMessage) return take_stamp(head, at);
    if (head.bytes > kMostHeadBytes) refuse("has a record that is too long");
    const std::string fields = read(at, static_cast<std::size_t>(head.bytes));
    if (is_first != (head.opcode == Opcode::kHeader) ||
        (is_first && fields.find(ros::kRecorderLibrary) == std::string::npos))
      refuse("was written by another program");
    if (head.opcode == Opcode::kSchema) channels_.add_schema(fields);
    if (head.opcode == Opcode::kChannel) channels_.add_channel(fields);
  }

  void take_stamp(const ros::RecordHead& head, std::uint64_t at) {
    const std::string fields = read(at, static_cast<std::size_t>(std::min<std::uint64_t>(head.bytes, kMessageStart)));
    const ros::McapMessage message = ros::parse_message(fields);
    const auto topic = channels_.topic_of(message.channel);
    if (!topic) return;
    newest_ns_.resize(channels_.topics().size());
    raise(newest_ns_[*topic], stamp_of_message(channels_.topics()[*topic].type, message.data));
  }

  std::string read(std::uint64_t at, std::size_t count) const {
    std::string bytes(count, '\0');
    bytes.resize(file_.read_at(at, bytes.data(), count));
    return bytes;
  }

  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(ErrorCode::kBadInput, what + "; one that can be gone on with was expected", file_.path().string(),
                "move it away, or name another file");
  }

  const GrowingLog& file_;
  ros::McapChannels channels_;
  std::vector<std::optional<std::int64_t>> newest_ns_;  // by topic
  bool is_finished_ = false;
};

bool is_of_camera(const std::string& type) {
  return type == "sensor_msgs/Image" || type == "sensor_msgs/CompressedImage" || type == "sensor_msgs/CameraInfo";
}

}  // namespace

std::optional<std::int64_t> stamp_of_message(const std::string& type, std::string_view message) {
  if (type == "tf2_msgs/TFMessage" || type == "tf/tfMessage" || message.size() < kStampAt + kStampBytes)
    return std::nullopt;
  std::uint32_t parts[2];  // seconds, nanoseconds
  std::memcpy(parts, message.data() + kStampAt, sizeof parts);
  const std::int64_t stamp_ns = std::int64_t{parts[0]} * 1'000'000'000 + parts[1];
  return stamp_ns == 0 ? std::nullopt : std::optional(stamp_ns);
}

bool is_odometry_frame(const std::string& frame) { return frame.substr(frame.rfind('/') + 1).rfind("odom", 0) == 0; }

std::vector<RecordedTopic> topics_to_record(const std::vector<RecordedTopic>& there, const ReadOptions& reading,
                                            bool with_cameras, const std::string& where) {
  std::vector<RecordedTopic> offered;
  std::vector<ros::BagTopic> topics;
  for (const RecordedTopic& topic : there) {
    if (is_of_camera(topic.type) && !with_cameras && reading.topics.empty()) continue;
    offered.push_back(topic);
    topics.push_back({topic.name, topic.type});
  }
  std::vector<RecordedTopic> chosen;
  for (const ros::ChosenTopic& topic : ros::choose_topics(topics, reading, where).topics)
    chosen.push_back(offered[topic.topic]);
  return chosen;
}

RosRecorder::RosRecorder(std::filesystem::path path, std::vector<RecordedTopic> topics)
    : topics_(std::move(topics)), file_(std::move(path), GrowingLog::Begin::new_file), newest_ns_(topics_.size()) {
  MAPWEAVE_EXPECT(!topics_.empty() && topics_.size() < std::numeric_limits<std::uint16_t>::max(),
                  "a recording has topics");
  file_.add(beginning_of(topics_));
}

RosRecorder::RosRecorder(std::filesystem::path path) : file_(std::move(path), GrowingLog::Begin::existing_file) {
  WholeRecords records(file_);
  const std::uint64_t end = records.walk();
  topics_ = records.topics();
  newest_ns_ = records.newest_ns();
  if (records.is_finished())
    file_.finish();
  else
    file_.cut(end);
}

void RosRecorder::add(std::size_t topic, std::int64_t received_ns, std::string_view message) {
  MAPWEAVE_EXPECT(topic < topics_.size(), "a topic of the recording");
  const std::lock_guard lock(mutex_);
  if (file_.is_finished()) return;
  std::string fields, record;
  append_number(fields, static_cast<std::uint16_t>(topic));
  append_number(fields, static_cast<std::uint32_t>(messages_));
  append_number(fields, static_cast<std::uint64_t>(received_ns));
  append_number(fields, static_cast<std::uint64_t>(received_ns));
  fields += message;
  append_record(record, Opcode::kMessage, fields);
  file_.add(record);
  ++messages_;
  raise(newest_ns_[topic], stamp_of_message(topics_[topic].type, message));
}

void RosRecorder::finish() {
  const std::lock_guard lock(mutex_);
  if (file_.is_finished()) return;
  file_.add(end_of_recording());
  file_.finish();
}

bool RosRecorder::is_finished() const {
  const std::lock_guard lock(mutex_);
  return file_.is_finished();
}

std::uint64_t RosRecorder::messages() const {
  const std::lock_guard lock(mutex_);
  return messages_;
}

std::optional<std::int64_t> RosRecorder::newest_ns(std::size_t topic) const {
  const std::lock_guard lock(mutex_);
  return newest_ns_.at(topic);
}

}  // namespace mapweave::rawlog
