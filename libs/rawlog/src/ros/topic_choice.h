#pragma once
// Which topics of a bag become observations.

#include "bag_reader.h"

#include <mapweave/rawlog/observation_stream.h>

#include <optional>
#include <string>
#include <vector>

namespace mapweave::rawlog::ros {

enum class TopicRole {
  scan,
  multi_echo_scan,
  cloud,
  odometry,
  imu,
  position,
  transforms,
  static_transforms,
  image,
  depth_image,
  calibration
};

// How the pictures of a camera's topic are sent: as sensor_msgs/Image, CompressedImage, or (depth) organised
// PointCloud2.
enum class PictureForm { raw, compressed, cloud };

struct ChosenTopic {
  std::size_t topic = 0;  // index into BagReader::topics()
  TopicRole role = TopicRole::scan;
  std::string label;  // of the observations: the topic without its robot's namespace and the first slash
  PictureForm form = PictureForm::raw;  // of images and depth images
  // Of images, depth images and calibrations: index into ChosenTopics::cameras.
  std::size_t camera = 0;
};

// Topics of one camera, a stereo pair or a depth camera; see camera_conversion.h.
enum class BagCameraKind { mono, stereo, depth };
struct BagCamera {
  BagCameraKind kind = BagCameraKind::mono;
  std::string label;
  // Indices into ChosenTopics::topics: the (left, or colour) picture, and the right or depth picture.
  std::optional<std::size_t> first, second;
  std::optional<std::size_t> first_calibration, second_calibration;
  bool first_is_rectified = false, second_is_rectified = false;
  // Topics at which their calibrations are expected, below the robot's namespace.
  std::string first_camera_info, second_camera_info;
};

struct ChosenTopics {
  std::vector<ChosenTopic> topics;
  std::vector<BagCamera> cameras;
  bool has_odometry = false, has_transforms = false;
};

// Throws Error: kBadInput where nothing can be mapped, where several topics of one kind are there and none is chosen,
// where there are several robots and none is chosen, for topics and namespaces that are not there. Each lists what is.
ChosenTopics choose_topics(const std::vector<BagTopic>& topics, const ReadOptions& options, const std::string& bag);

// The namespaces that are taken for robots': those that share a topic of odometry; where no two do, those that hold a
// laser, else those that hold a camera. In order; none where the sensors are in no namespace.
std::vector<std::string> robot_namespaces(const std::vector<BagTopic>& topics);

}  // namespace mapweave::rawlog::ros
