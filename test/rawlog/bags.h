#pragma once
// Small ROS 1 bags for tests: messages as ROS 1 serializes them, and the container around them.

#include "logs.h"

#include <bzlib.h>
#include <lz4frame.h>

#include <cstdint>
#include <cstring>
#include <iterator>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace mapweave::rawlog {

// The bytes of a message.
class MessageBytes {
 public:
  template <class T>
  MessageBytes& number(T value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    return *this;
  }
  MessageBytes& text(const std::string& value) {
    number(static_cast<std::uint32_t>(value.size()));
    bytes_ += value;
    return *this;
  }
  MessageBytes& time(double seconds) {
    const std::int64_t ns = stamp_from_seconds(seconds).ns;
    return number(static_cast<std::uint32_t>(ns / 1'000'000'000))
        .number(static_cast<std::uint32_t>(ns % 1'000'000'000));
  }
  MessageBytes& header(double stamp_s, const std::string& frame) {
    return number(std::uint32_t{0}).time(stamp_s).text(frame);
  }
  MessageBytes& doubles(const std::vector<double>& values) {
    for (const double value : values) number(value);
    return *this;
  }
  MessageBytes& floats(const std::vector<float>& values) {
    for (const float value : values) number(value);
    return *this;
  }
  MessageBytes& pose(const Pose3& pose) {
    return doubles({pose.t.x(), pose.t.y(), pose.t.z(), pose.q.x(), pose.q.y(), pose.q.z(), pose.q.w()});
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

struct BagEntry {
  std::string topic, type;
  double received_s = 0.0;
  std::string data;
};

struct ScanFields {
  float angle_min = -1.0f, angle_max = 1.0f, angle_increment = 0.5f, time_increment = 0.0f, scan_time = 0.0f,
        range_min = 0.1f, range_max = 10.0f;
  std::string frame = "laser", topic = "/scan";
};

inline BagEntry bag_scan(double stamp_s, const std::vector<float>& ranges = {1, 2, 3, 4, 5},
                         const ScanFields& fields = {}) {
  MessageBytes bytes;
  bytes.header(stamp_s, fields.frame)
      .floats({fields.angle_min, fields.angle_max, fields.angle_increment, fields.time_increment, fields.scan_time,
               fields.range_min, fields.range_max});
  bytes.number(static_cast<std::uint32_t>(ranges.size())).floats(ranges).number(std::uint32_t{0});
  return {fields.topic, "sensor_msgs/LaserScan", stamp_s, bytes.bytes()};
}

inline BagEntry bag_odometry(double stamp_s, double x, double y, double heading, const std::string& topic = "/odom",
                             const std::string& child = "base_link") {
  MessageBytes bytes;
  bytes.header(stamp_s, "odom").text(child).pose(spatial(Pose2(x, y, heading)));
  bytes.doubles(std::vector<double>(36 + 6 + 36, 0.0));
  return {topic, "nav_msgs/Odometry", stamp_s, bytes.bytes()};
}

struct CloudForm {
  std::uint32_t width = 1, height = 1;
  std::vector<std::pair<std::string, std::uint8_t>> fields = {{"x", 7}, {"y", 7}, {"z", 7}};  // datatypes
  bool is_big_endian = false;
  std::string frame = "laser", topic = "/points";
};

// `points`: the fields of each, one after the other, without gaps.
inline BagEntry bag_cloud(double stamp_s, const CloudForm& form, const std::string& points) {
  constexpr std::uint32_t kSizes[] = {0, 1, 1, 2, 2, 4, 4, 4, 8};
  MessageBytes bytes;
  bytes.header(stamp_s, form.frame).number(form.height).number(form.width);
  bytes.number(static_cast<std::uint32_t>(form.fields.size()));
  std::uint32_t step = 0;
  for (const auto& [name, type] : form.fields) {
    bytes.text(name).number(step).number(type).number(std::uint32_t{1});
    step += type < std::size(kSizes) ? kSizes[type] : 4;
  }
  bytes.number(static_cast<std::uint8_t>(form.is_big_endian)).number(step).number(step * form.width).text(points);
  return {form.topic, "sensor_msgs/PointCloud2", stamp_s, bytes.number(std::uint8_t{0}).bytes()};
}

struct BagLink {
  std::string parent, child;
  Pose3 pose;
};
inline BagEntry bag_transforms(double stamp_s, const std::vector<BagLink>& links,
                               const std::string& topic = "/tf_static") {
  MessageBytes bytes;
  bytes.number(static_cast<std::uint32_t>(links.size()));
  for (const BagLink& link : links) bytes.header(stamp_s, link.parent).text(link.child).pose(link.pose);
  return {topic, "tf2_msgs/TFMessage", stamp_s, bytes.bytes()};
}

struct BagForm {
  std::string compression = "none";
  std::size_t messages_per_chunk = 4;
  bool is_closed = true;  // else as after a crash: without index
};

namespace bag_form {

inline std::string field(const std::string& name, const std::string& value) {
  return MessageBytes().text(name + "=" + value).bytes();
}
template <class T>
std::string number(const std::string& name, T value) {
  return field(name, MessageBytes().number(value).bytes());
}
inline std::string op(char code) { return field("op", std::string(1, code)); }
inline std::string record(const std::string& header, const std::string& data) {
  return MessageBytes().text(header).text(data).bytes();
}

inline std::string packed(const std::string& compression, const std::string& plain) {
  if (compression == "bz2") {
    std::string out(plain.size() + plain.size() / 50 + 700, '\0');
    auto size = static_cast<unsigned>(out.size());
    EXPECT_EQ(::BZ2_bzBuffToBuffCompress(out.data(), &size, const_cast<char*>(plain.data()),
                                         static_cast<unsigned>(plain.size()), 9, 0, 0),
              BZ_OK);
    out.resize(size);
    return out;
  }
  if (compression == "lz4") {
    std::string out(::LZ4F_compressFrameBound(plain.size(), nullptr), '\0');
    out.resize(::LZ4F_compressFrame(out.data(), out.size(), plain.data(), plain.size(), nullptr));
    return out;
  }
  return plain;
}

inline std::string connection(std::uint32_t id, const BagEntry& entry) {
  const std::string data = field("topic", entry.topic) + field("type", entry.type) + field("md5sum", "*") +
                           field("message_definition", "Header header\n");
  return record(op('\x07') + number("conn", id) + field("topic", entry.topic), data);
}

inline std::string bag_header(std::uint64_t index_position, std::uint32_t connections, std::uint32_t chunks) {
  const std::string header = op('\x03') + number("index_pos", index_position) + number("conn_count", connections) +
                             number("chunk_count", chunks);
  return "#ROSBAG V2.0\n" + record(header, std::string(4096 - 8 - header.size(), ' '));
}

}  // namespace bag_form

inline std::string bag_bytes(const std::vector<BagEntry>& entries, const BagForm& form = {}) {
  using namespace bag_form;
  std::map<std::pair<std::string, std::string>, std::uint32_t> ids;
  std::string chunks, index, infos;
  std::uint32_t chunk_count = 0;
  const std::size_t start = bag_header(0, 0, 0).size();
  for (std::size_t begin = 0; begin < entries.size(); begin += form.messages_per_chunk, ++chunk_count) {
    std::string plain;
    std::map<std::uint32_t, std::uint32_t> counts;
    const std::size_t end = std::min(entries.size(), begin + form.messages_per_chunk);
    for (std::size_t i = begin; i < end; ++i) {
      const BagEntry& entry = entries[i];
      const auto [known, is_new] =
          ids.emplace(std::pair(entry.topic, entry.type), static_cast<std::uint32_t>(ids.size()));
      if (is_new) {
        plain += connection(known->second, entry);
        index += connection(known->second, entry);
      }
      plain += record(
          op('\x02') + number("conn", known->second) + field("time", MessageBytes().time(entry.received_s).bytes()),
          entry.data);
      ++counts[known->second];
    }
    const std::uint64_t position = start + chunks.size();
    chunks += record(
        op('\x05') + field("compression", form.compression) + number("size", static_cast<std::uint32_t>(plain.size())),
        packed(form.compression, plain));
    std::string counted;
    for (const auto& [id, count] : counts) {
      chunks += record(
          op('\x04') + number("ver", std::uint32_t{1}) + number("conn", id) + number("count", std::uint32_t{0}), "");
      counted += MessageBytes().number(id).number(count).bytes();
    }
    infos += record(op('\x06') + number("ver", std::uint32_t{1}) + number("chunk_pos", position) +
                        number("count", static_cast<std::uint32_t>(counts.size())),
                    counted);
  }
  if (!form.is_closed) return bag_header(0, 0, 0) + chunks;
  return bag_header(start + chunks.size(), static_cast<std::uint32_t>(ids.size()), chunk_count) + chunks + index +
         infos;
}

inline std::filesystem::path write_bag(const std::filesystem::path& path, const std::vector<BagEntry>& entries,
                                       const BagForm& form = {}) {
  return write_bytes(path, bag_bytes(entries, form));
}

// Odometry and a scan each 0.1 s, from 100 s on, and where the laser stands.
inline std::vector<BagEntry> small_drive(int scans = 10) {
  std::vector<BagEntry> entries = {bag_transforms(100.0, {{"base_link", "laser", spatial(Pose2(0.2, 0.1, 0.0))}})};
  for (int i = 0; i < scans; ++i) {
    const double stamp_s = 100.0 + 0.1 * i;
    entries.push_back(bag_odometry(stamp_s, 0.05 * i, 0.0, 0.0));
    entries.push_back(bag_scan(stamp_s, {1.0f + static_cast<float>(i), 2, 3, 4, 5}));
  }
  return entries;
}

}  // namespace mapweave::rawlog
