#include "bag_contents.h"

#include "bag_formats.h"
#include "messages.h"
#include "transforms.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <tuple>

namespace mapweave::rawlog::ros {
namespace {

constexpr std::size_t kMostFrames = 50;

struct Counted {
  TopicContents contents;
  std::int64_t first_ns = 0, last_ns = 0, longest_gap_ns = 0;
};

bool begins_with_header(const std::string& type) {
  for (const char* known :
       {"sensor_msgs/LaserScan", "sensor_msgs/MultiEchoLaserScan", "sensor_msgs/PointCloud2", "sensor_msgs/Imu",
        "sensor_msgs/Image", "sensor_msgs/CompressedImage", "sensor_msgs/CameraInfo", "sensor_msgs/NavSatFix",
        "sensor_msgs/Range", "sensor_msgs/JointState", "sensor_msgs/MagneticField", "nav_msgs/Odometry",
        "nav_msgs/OccupancyGrid", "nav_msgs/Path", "geometry_msgs/PoseStamped",
        "geometry_msgs/PoseWithCovarianceStamped", "geometry_msgs/TransformStamped", "geometry_msgs/TwistStamped",
        "geometry_msgs/PointStamped"})
    if (type == known) return true;
  return false;
}

std::vector<std::string> frames_of(const BagTopic& topic, const BagMessage& message) {
  MessageReader reader(message.data, topic.encoding);
  std::vector<std::string> frames;
  if (begins_with_header(topic.type)) frames.emplace_back(reader.header().frame_id);
  if (topic.type == "tf2_msgs/TFMessage" || topic.type == "tf/tfMessage")
    for (const TransformMessage& transform : read_transforms(reader))
      frames.push_back(frame_name(transform.header.frame_id) + " -> " + frame_name(transform.child_frame_id));
  return frames;
}

CloudGeometry geometry_of(const BagTopic& topic, const BagMessage& message) {
  constexpr std::size_t kMostFields = 50;
  MessageReader reader(message.data, topic.encoding);
  const PointCloudMessage cloud = read_point_cloud(reader);
  CloudGeometry geometry{cloud.width, cloud.height, {}};
  for (const PointField& field : cloud.fields)
    if (geometry.fields.size() < kMostFields) geometry.fields.emplace_back(field.name);
  return geometry;
}

void count(const BagTopic& topic, const BagMessage& message, Counted& counted) {
  if (counted.contents.count++ == 0)
    counted.first_ns = message.received_ns;
  else
    counted.longest_gap_ns = std::max(counted.longest_gap_ns, message.received_ns - counted.last_ns);
  counted.last_ns = message.received_ns;
  auto& frames = counted.contents.frames;
  try {
    for (const std::string& frame : frames_of(topic, message))
      if (frames.size() < kMostFrames && std::find(frames.begin(), frames.end(), frame) == frames.end())
        frames.push_back(frame);
    if (topic.type == "sensor_msgs/PointCloud2" && !counted.contents.cloud)
      counted.contents.cloud = geometry_of(topic, message);
  } catch (const Error&) {
    // Whoever reads this message says what is wrong with it.
  }
}

}  // namespace

std::vector<TopicContents> topics_of_bag(const std::filesystem::path& path, const ReadOptions& options) {
  const auto bag = open_bag(path, options);
  if (!bag) return {};
  std::vector<Counted> topics(bag->topics().size());
  try {
    for (BagMessage message; bag->next(message);) {
      topics.resize(bag->topics().size());
      count(bag->topics()[message.topic], message, topics[message.topic]);
    }
  } catch (const Error&) {
    // Reading its observations says so.
  }
  topics.resize(bag->topics().size());
  std::vector<TopicContents> contents;
  for (std::size_t i = 0; i < topics.size(); ++i) {
    Counted& counted = topics[i];
    counted.contents.name = bag->topics()[i].name;
    counted.contents.type = bag->topics()[i].type;
    const double seconds = 1e-9 * static_cast<double>(counted.last_ns - counted.first_ns);
    if (seconds > 0.0) counted.contents.rate_hz = static_cast<double>(counted.contents.count - 1) / seconds;
    counted.contents.longest_gap_s = 1e-9 * static_cast<double>(counted.longest_gap_ns);
    contents.push_back(std::move(counted.contents));
  }
  std::sort(contents.begin(), contents.end(), [](const TopicContents& a, const TopicContents& b) {
    return std::tie(a.name, a.type) < std::tie(b.name, b.type);
  });
  return contents;
}

}  // namespace mapweave::rawlog::ros
