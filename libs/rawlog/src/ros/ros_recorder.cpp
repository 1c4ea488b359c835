#include "mcap_records.h"
#include "topic_choice.h"

#include <mapweave/core/error.h>
#include <mapweave/rawlog/ros_recorder.h>

#include <limits>
#include <utility>

namespace mapweave::rawlog {
namespace {

using ros::Opcode;

constexpr const char* kLibrary = "mapweave RosRecorder";
constexpr std::size_t kMostHeadBytes = std::size_t{1} << 20;  // of all that stands before the first message

template <class Number>
void append_number(std::string& to, Number number) {
  for (std::size_t i = 0; i < sizeof(Number); ++i) to += static_cast<char>(number >> (8 * i) & 0xff);
}

void append_text(std::string& to, std::string_view text) {
  append_number(to, static_cast<std::uint32_t>(text.size()));
  to += text;
}

void append_record(std::string& to, Opcode opcode, std::string_view fields) {
  to += static_cast<char>(opcode);
  append_number(to, static_cast<std::uint64_t>(fields.size()));
  to += fields;
}

// All that stands before the first message; a schema for each topic.
std::string beginning_of(const std::vector<RecordedTopic>& topics) {
  std::string bytes(ros::kMcapMagic), header;
  append_text(header, "ros1");
  append_text(header, kLibrary);
  append_record(bytes, Opcode::kHeader, header);
  for (std::uint16_t i = 0; i < topics.size(); ++i) {
    std::string schema, channel;
    append_number(schema, static_cast<std::uint16_t>(i + 1));
    append_text(schema, topics[i].type);
    append_text(schema, "ros1msg");
    append_text(schema, topics[i].definition);
    append_record(bytes, Opcode::kSchema, schema);
    append_number(channel, i);
    append_number(channel, static_cast<std::uint16_t>(i + 1));
    append_text(channel, topics[i].name);
    append_text(channel, "ros1");
    append_text(channel, "");
    append_record(bytes, Opcode::kChannel, channel);
  }
  return bytes;
}

std::string end_of_recording() {
  std::string bytes, footer;
  append_record(bytes, Opcode::kDataEnd, std::string(sizeof(std::uint32_t), '\0'));
  append_number(footer, std::uint64_t{0});  // no summary
  append_number(footer, std::uint64_t{0});
  append_number(footer, std::uint32_t{0});
  append_record(bytes, Opcode::kFooter, footer);
  return bytes + std::string(ros::kMcapMagic);
}

// Goes over the records of a recording that was not finished.
class WholeRecords {
 public:
  explicit WholeRecords(const GrowingLog& file) : file_(file) {}

  // Where the last whole record ends.
  std::uint64_t walk() {
    if (read(0, ros::kMcapMagic.size()) != ros::kMcapMagic) refuse("is no MCAP recording");
    std::uint64_t at = ros::kMcapMagic.size();
    for (bool is_first = true; file_.bytes() - at >= ros::kRecordHeadBytes; is_first = false) {
      const ros::RecordHead head = ros::parse_head(read(at, ros::kRecordHeadBytes).c_str());
      if (head.opcode == Opcode::kDataEnd || head.opcode == Opcode::kFooter) refuse("is a finished recording");
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

 private:
  void take(const ros::RecordHead& head, std::uint64_t at, bool is_first) {
    if (head.opcode == Opcode::kMessage) return;
    if (head.bytes > kMostHeadBytes) refuse("has a record that is too long");
    const std::string fields = read(at, static_cast<std::size_t>(head.bytes));
    if (is_first != (head.opcode == Opcode::kHeader) || (is_first && fields.find(kLibrary) == std::string::npos))
      refuse("was written by another program");
    if (head.opcode == Opcode::kSchema) channels_.add_schema(fields);
    if (head.opcode == Opcode::kChannel) channels_.add_channel(fields);
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
};

bool is_of_camera(const std::string& type) {
  return type == "sensor_msgs/Image" || type == "sensor_msgs/CompressedImage" || type == "sensor_msgs/CameraInfo";
}

}  // namespace

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
    : topics_(std::move(topics)), file_(std::move(path), GrowingLog::Begin::new_file) {
  MAPWEAVE_EXPECT(!topics_.empty() && topics_.size() < std::numeric_limits<std::uint16_t>::max(),
                  "a recording has topics");
  file_.add(beginning_of(topics_));
}

RosRecorder::RosRecorder(std::filesystem::path path) : file_(std::move(path), GrowingLog::Begin::existing_file) {
  WholeRecords records(file_);
  file_.cut(records.walk());
  topics_ = records.topics();
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

}  // namespace mapweave::rawlog
