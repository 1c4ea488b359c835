#pragma once
// The ROS messages that become observations, decoded: http://docs.ros.org/en/api/sensor_msgs, nav_msgs, tf2_msgs. Both
// generations of ROS have the same fields. Views point into the message's bytes.

#include "message_reader.h"

#include <mapweave/core/geometry.h>

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

namespace mapweave::rawlog::ros {

// sensor_msgs/LaserScan, and of sensor_msgs/MultiEchoLaserScan the first echo of each ray, which is the nearest.
struct LaserScanMessage {
  MessageHeader header;
  float angle_min_rad = 0, angle_max_rad = 0, angle_increment_rad = 0, time_increment_s = 0, scan_time_s = 0;
  float range_min_m = 0, range_max_m = 0;
  std::vector<float> ranges_m;
};
LaserScanMessage read_laser_scan(MessageReader& reader);
LaserScanMessage read_multi_echo_scan(MessageReader& reader);

// nav_msgs/Odometry; its twist and covariances are not used.
struct OdometryMessage {
  MessageHeader header;
  std::string_view child_frame_id;
  Pose3 pose;  // of the child frame in the header's
};
OdometryMessage read_odometry(MessageReader& reader);

// sensor_msgs/Imu. A quantity whose covariance begins with -1 is not measured.
struct ImuMessage {
  MessageHeader header;
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d turn_rate_rad_s = Eigen::Vector3d::Zero(), acceleration_m_s2 = Eigen::Vector3d::Zero();
  bool has_orientation = false, has_turn_rate = false, has_acceleration = false;
};
ImuMessage read_imu(MessageReader& reader);

// sensor_msgs/NavSatFix, without its covariance.
struct PositionMessage {
  MessageHeader header;
  int status = -1;  // -1: no fix, 0: one, 1: with satellites that augment it, 2: with stations on the ground
  double latitude_deg = 0.0, longitude_deg = 0.0, altitude_m = 0.0;  // not finite: not known
};
PositionMessage read_position(MessageReader& reader);

// tf2_msgs/TFMessage, tf/tfMessage.
struct TransformMessage {
  MessageHeader header;  // its frame is the parent
  std::string_view child_frame_id;
  Pose3 parent_from_child;
  bool is_rotation = true;  // the quaternion has about unit length
};
std::vector<TransformMessage> read_transforms(MessageReader& reader);

// sensor_msgs/Image.
struct ImageMessage {
  MessageHeader header;
  std::uint32_t height = 0, width = 0, step_bytes = 0;
  std::string_view encoding, data;
  bool is_big_endian = false;
};
ImageMessage read_image(MessageReader& reader);

// sensor_msgs/CompressedImage.
struct CompressedImageMessage {
  MessageHeader header;
  std::string_view format, data;
};
CompressedImageMessage read_compressed_image(MessageReader& reader);

// sensor_msgs/CameraInfo.
struct CameraInfoMessage {
  MessageHeader header;
  std::uint32_t height = 0, width = 0, binning_x = 0, binning_y = 0;
  std::string_view distortion_model;
  std::vector<double> distortion;
  std::array<double, 9> camera_matrix{}, rectification{};
  std::array<double, 12> projection{};
  std::uint32_t roi_x = 0, roi_y = 0, roi_height = 0, roi_width = 0;
};
CameraInfoMessage read_camera_info(MessageReader& reader);

// sensor_msgs/PointCloud2.
struct PointField {
  std::string_view name;
  std::uint32_t offset = 0, count = 0;
  std::uint8_t type = 0;  // sensor_msgs/PointField: 1 int8 ... 7 float32, 8 float64
};
struct PointCloudMessage {
  MessageHeader header;
  std::uint32_t height = 0, width = 0, point_step_bytes = 0, row_step_bytes = 0;
  std::vector<PointField> fields;
  bool is_big_endian = false, is_dense = false;
  std::string_view data;
};
PointCloudMessage read_point_cloud(MessageReader& reader);

// A quaternion of about unit length, made exactly so; `is_rotation` false, and no turn, for what is none.
Eigen::Quaterniond unit_quaternion(const std::array<double, 4>& x_y_z_w, bool& is_rotation);

}  // namespace mapweave::rawlog::ros
