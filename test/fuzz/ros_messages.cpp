// Messages of ROS and what becomes of them, without a container around them, whose checksums would refuse most inputs.

#include "fuzz_target.h"

#include <rawlog/bag_pictures.h>
#include <ros/bag_formats.h>
#include <ros/bag_source.h>

#include <mrpt/obs/CObservation.h>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>

namespace mapweave::fuzz {
namespace {

using namespace rawlog;
using ros::MessageEncoding;

struct Sent {
  std::size_t topic;
  std::string data;
};

// Every kind of message that is read, each in both forms, and a robot in each.
const std::vector<ros::BagTopic>& topics_of(MessageEncoding encoding) {
  const auto made = [](MessageEncoding of) {
    return std::vector<ros::BagTopic>{{"/scan", "sensor_msgs/LaserScan", of, 0},
                                      {"/echoes", "sensor_msgs/MultiEchoLaserScan", of, 0},
                                      {"/points", "sensor_msgs/PointCloud2", of, 0},
                                      {"/odom", "nav_msgs/Odometry", of, 0},
                                      {"/imu", "sensor_msgs/Imu", of, 0},
                                      {"/tf", "tf2_msgs/TFMessage", of, 0},
                                      {"/tf_static", "tf2_msgs/TFMessage", of, 0},
                                      {"/cam/image_raw", "sensor_msgs/Image", of, 0},
                                      {"/cam/camera_info", "sensor_msgs/CameraInfo", of, 0},
                                      {"/eye/image_raw/compressed", "sensor_msgs/CompressedImage", of, 0},
                                      {"/eye/camera_info", "sensor_msgs/CameraInfo", of, 0},
                                      {"/rgbd/rgb/image_raw", "sensor_msgs/Image", of, 0},
                                      {"/rgbd/rgb/camera_info", "sensor_msgs/CameraInfo", of, 0},
                                      {"/rgbd/depth/image_raw", "sensor_msgs/Image", of, 0},
                                      {"/rgbd/depth/image_raw/compressedDepth", "sensor_msgs/CompressedImage", of, 0},
                                      {"/deep/depth/points", "sensor_msgs/PointCloud2", of, 0},
                                      {"/deep/depth/camera_info", "sensor_msgs/CameraInfo", of, 0}};
  };
  static const std::vector<ros::BagTopic> packed = made(MessageEncoding::ros1), cdr = made(MessageEncoding::cdr);
  return encoding == MessageEncoding::ros1 ? packed : cdr;
}

// The input as a bag: of each message its topic (a byte), its length (two) and its bytes.
class InputBag : public ros::BagReader {
 public:
  InputBag(std::string_view input, MessageEncoding encoding) : topics_(topics_of(encoding)), rest_(input) {}
  const std::vector<ros::BagTopic>& topics() const override { return topics_; }
  void select(const std::vector<std::size_t>& topics) override { selected_ = topics; }
  bool next(ros::BagMessage& message) override {
    while (rest_.size() >= 3) {
      const auto byte = [&](std::size_t at) { return static_cast<std::size_t>(static_cast<unsigned char>(rest_[at])); };
      message.topic = byte(0) % topics_.size();
      const std::size_t size = std::min(byte(1) | byte(2) << 8, rest_.size() - 3);
      const auto* data = reinterpret_cast<const std::byte*>(rest_.data()) + 3;
      message.data.assign(data, data + size);
      message.place = ++place_;
      message.received_ns = 100'000'000'000 + static_cast<std::int64_t>(place_) * 1'000'000;
      rest_.remove_prefix(3 + size);
      if (std::find(selected_.begin(), selected_.end(), message.topic) != selected_.end()) return true;
    }
    return false;
  }
  std::string place_name(std::uint64_t place) const override { return "message " + std::to_string(place); }
  std::uint64_t bytes_read() const override { return place_; }
  std::uint64_t bytes_total() const override { return place_; }

 private:
  std::vector<ros::BagTopic> topics_;
  std::vector<std::size_t> selected_;
  std::string_view rest_;
  std::uint64_t place_ = 0;
};

void read(std::string_view input, MessageEncoding encoding, const std::vector<std::string>& chosen) {
  ReadOptions options;
  options.topics = chosen;
  if (encoding == MessageEncoding::cdr) options.robot_frame = "laser";  // of the recording that the seeds are from
  const auto source = ros::open_bag_source(std::make_unique<InputBag>(input, encoding), kWhere, options);
  std::vector<PlacedRecord> records;
  while (source->read(records)) {
    for (const PlacedRecord& one : records) {
      expect(one.record.observation != nullptr, "a record has an observation");
      load_pictures(*one.record.observation);
    }
    records.clear();
  }
}

std::string input_of(const std::vector<Sent>& messages) {
  std::string input;
  for (const Sent& one : messages)
    input += std::string{static_cast<char>(one.topic), static_cast<char>(one.data.size() & 0xff),
                         static_cast<char>(one.data.size() >> 8)} +
             one.data;
  return input;
}

std::string cloud() {
  MessageBytes bytes;
  bytes.header(100.0, "laser").number(std::uint32_t{1}).number(std::uint32_t{3}).number(std::uint32_t{4});
  const char* names[] = {"x", "y", "z", "ring"};
  for (std::uint32_t i = 0; i < 4; ++i)
    bytes.text(names[i]).number(4 * i).number(static_cast<std::uint8_t>(i < 3 ? 7 : 4)).number(std::uint32_t{1});
  bytes.number(std::uint8_t{0}).number(std::uint32_t{16}).number(std::uint32_t{48}).number(std::uint32_t{48});
  for (int point = 0; point < 3; ++point)
    bytes.floats({1.0f + static_cast<float>(point), 2.0f, 0.1f}).number(std::uint32_t{1});
  return bytes.number(std::uint8_t{1}).bytes();
}

std::string echoes() {
  MessageBytes bytes;
  bytes.header(100.1, "laser").floats({-1.0f, 1.0f, 0.5f, 0.0f, 0.0f, 0.1f, 10.0f}).number(std::uint32_t{5});
  for (int ray = 0; ray < 5; ++ray) bytes.number(std::uint32_t{2}).floats({1.0f, 2.0f});
  return bytes.number(std::uint32_t{0}).bytes();
}

std::string inertial() {
  MessageBytes bytes;
  bytes.header(100.2, "base_link").doubles({0, 0, 0, 1}).doubles(std::vector<double>(9, 0.01));
  bytes.doubles({0.1, 0.2, 0.3}).doubles(std::vector<double>(9, 0.01));
  return bytes.doubles({0.1, 9.8, 0.3}).doubles(std::vector<double>(9, 0.01)).bytes();
}

std::string compressed(const std::string& format, const std::string& extension, const cv::Mat& picture,
                       const std::string& head = {}) {
  std::vector<unsigned char> packed;
  cv::imencode(extension, picture, packed);
  return MessageBytes()
      .header(100.3, "optical")
      .text(format)
      .text(head + std::string(packed.begin(), packed.end()))
      .bytes();
}

std::string links() { return bag_transforms(100.0, {{"base_link", "laser", spatial(Pose2(0.2, 0.1, 0.0))}}).data; }

std::vector<std::string> laser_seeds() {
  return {
      input_of({{6, links()}, {3, bag_odometry(100.0, 1, 2, 0.1).data}, {0, bag_scan(100.0).data}, {4, inertial()}}),
      input_of({{5, links()}, {0, bag_scan(100.0).data}, {0, bag_scan(100.1).data}})};
}

std::vector<std::string> camera_seeds() {
  const cv::Mat grey(kHeight, kWidth, CV_8UC1, cv::Scalar(100)), depth(kHeight, kWidth, CV_16UC1, cv::Scalar(2000));
  const std::string head = MessageBytes().number(std::uint32_t{0}).floats({0.0f, 0.0f}).bytes();
  const std::string info = calibration("/cam/camera_info", 100.3).data;
  return {input_of({{8, info}, {7, rawlog::grey("/cam/image_raw", 100.3).data}}),
          input_of({{10, info}, {9, compressed("mono8; jpeg compressed", ".jpg", grey)}}),
          input_of({{10, info}, {9, compressed("mono8; png compressed", ".png", grey)}}),
          input_of({{12, info},
                    {11, picture("/rgbd/rgb/image_raw", 100.3, "rgb8", std::string(3 * kWidth * kHeight, 'x')).data},
                    {13, picture("/rgbd/depth/image_raw", 100.3, "16UC1", depth_pixels(2000)).data}}),
          input_of({{12, info}, {14, compressed("16UC1; compressedDepth", ".png", depth, head)}})};
}

std::string depth_cloud_seed() {
  return input_of({{16, calibration("/deep/depth/camera_info", 100.3).data},
                   {15, depth_cloud("/deep/depth/points", 100.3, std::vector<float>(kWidth * kHeight, 2.0f)).data}});
}

// Scans of a recording of ROS 2, as they stand in it.
std::vector<std::string> cdr_seeds() {
  std::vector<Sent> messages;
  const auto bag = ros::open_bag(test::own_data("ros2/none.mcap"), {});
  ros::BagMessage message;
  while (bag->next(message))
    if (bag->topics().at(message.topic).type == "sensor_msgs/LaserScan")
      messages.push_back({0, {reinterpret_cast<const char*>(message.data.data()), message.data.size()}});
  return {input_of(messages)};
}

Kind kind_of(MessageEncoding encoding, const std::vector<std::string>& chosen, std::vector<std::string> seeds) {
  return {[=](std::string_view bytes) { read(bytes, encoding, chosen); }, std::move(seeds)};
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = {
      kind_of(MessageEncoding::ros1, {"/scan", "/odom", "/imu"}, laser_seeds()),
      kind_of(MessageEncoding::ros1, {"/echoes"}, {input_of({{6, links()}, {1, echoes()}})}),
      kind_of(MessageEncoding::ros1, {"/points"}, {input_of({{6, links()}, {2, cloud()}})}),
      kind_of(MessageEncoding::ros1,
              {"/cam/image_raw", "/eye/image_raw/compressed", "/rgbd/rgb/image_raw", "/rgbd/depth/image_raw"},
              camera_seeds()),
      kind_of(MessageEncoding::ros1, {"/rgbd/rgb/image_raw", "/rgbd/depth/image_raw/compressedDepth"},
              {camera_seeds().back()}),
      kind_of(MessageEncoding::ros1, {"/deep/depth/points"}, {depth_cloud_seed()}),
      kind_of(MessageEncoding::cdr, {"/scan"}, cdr_seeds())};
  return all;
}

}  // namespace

std::vector<std::string> seeds() { return seeds_of(kinds()); }
void decode(std::string_view bytes) { decode_one_of(kinds(), bytes); }

}  // namespace mapweave::fuzz
