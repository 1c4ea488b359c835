#include "messages.h"

#include <mapweave/core/error.h>

#include <cmath>

namespace mapweave::rawlog::ros {
namespace {

constexpr double kQuaternionTolerance = 0.01;

void read_fan(MessageReader& reader, LaserScanMessage& scan) {
  scan.header = reader.header();
  for (float* field : {&scan.angle_min_rad, &scan.angle_max_rad, &scan.angle_increment_rad, &scan.time_increment_s,
                       &scan.scan_time_s, &scan.range_min_m, &scan.range_max_m})
    *field = reader.read<float>();
}

Eigen::Vector3d read_vector(MessageReader& reader) {
  const auto numbers = reader.array<double, 3>();
  return {numbers[0], numbers[1], numbers[2]};
}

// True where the quantity is measured.
bool read_covariance(MessageReader& reader) { return reader.array<double, 9>()[0] != -1.0; }

}  // namespace

Eigen::Quaterniond unit_quaternion(const std::array<double, 4>& x_y_z_w, bool& is_rotation) {
  const Eigen::Quaterniond q(x_y_z_w[3], x_y_z_w[0], x_y_z_w[1], x_y_z_w[2]);
  is_rotation = std::abs(q.norm() - 1.0) < kQuaternionTolerance;
  return is_rotation ? q.normalized() : Eigen::Quaterniond::Identity();
}

LaserScanMessage read_laser_scan(MessageReader& reader) {
  LaserScanMessage scan;
  read_fan(reader, scan);
  reader.sequence(scan.ranges_m);
  return scan;
}

LaserScanMessage read_multi_echo_scan(MessageReader& reader) {
  LaserScanMessage scan;
  read_fan(reader, scan);
  const std::size_t rays = reader.count(4);
  scan.ranges_m.reserve(rays);
  std::vector<float> echoes;
  for (std::size_t ray = 0; ray < rays; ++ray) {
    reader.sequence(echoes);
    scan.ranges_m.push_back(echoes.empty() ? std::numeric_limits<float>::infinity() : echoes.front());
  }
  return scan;
}

OdometryMessage read_odometry(MessageReader& reader) {
  OdometryMessage odometry;
  odometry.header = reader.header();
  odometry.child_frame_id = reader.string();
  odometry.pose.t = read_vector(reader);
  bool is_rotation = false;
  odometry.pose.q = unit_quaternion(reader.array<double, 4>(), is_rotation);
  if (!is_rotation)
    throw Error(ErrorCode::kBadInput,
                "the orientation of an odometry pose is no rotation (a quaternion of length 1 was expected)");
  return odometry;
}

ImuMessage read_imu(MessageReader& reader) {
  ImuMessage imu;
  imu.header = reader.header();
  imu.orientation = unit_quaternion(reader.array<double, 4>(), imu.has_orientation);
  imu.has_orientation = read_covariance(reader) && imu.has_orientation;
  imu.turn_rate_rad_s = read_vector(reader);
  imu.has_turn_rate = read_covariance(reader) && imu.turn_rate_rad_s.allFinite();
  imu.acceleration_m_s2 = read_vector(reader);
  imu.has_acceleration = read_covariance(reader) && imu.acceleration_m_s2.allFinite();
  return imu;
}

PositionMessage read_position(MessageReader& reader) {
  PositionMessage position;
  position.header = reader.header();
  position.status = reader.read<std::int8_t>();
  reader.read<std::uint16_t>();  // which satellites
  for (double* field : {&position.latitude_deg, &position.longitude_deg, &position.altitude_m})
    *field = reader.read<double>();
  return position;
}

std::vector<TransformMessage> read_transforms(MessageReader& reader) {
  constexpr std::size_t kLeastBytes = 72;  // a header, a child's name, seven numbers
  std::vector<TransformMessage> transforms(reader.count(kLeastBytes));
  for (TransformMessage& transform : transforms) {
    transform.header = reader.header();
    transform.child_frame_id = reader.string();
    transform.parent_from_child.t = read_vector(reader);
    transform.parent_from_child.q = unit_quaternion(reader.array<double, 4>(), transform.is_rotation);
  }
  return transforms;
}

ImageMessage read_image(MessageReader& reader) {
  ImageMessage image;
  image.header = reader.header();
  image.height = reader.read<std::uint32_t>();
  image.width = reader.read<std::uint32_t>();
  image.encoding = reader.string();
  image.is_big_endian = reader.read<bool>();
  image.step_bytes = reader.read<std::uint32_t>();
  image.data = reader.bytes();
  return image;
}

CompressedImageMessage read_compressed_image(MessageReader& reader) {
  CompressedImageMessage image;
  image.header = reader.header();
  image.format = reader.string();
  image.data = reader.bytes();
  return image;
}

CameraInfoMessage read_camera_info(MessageReader& reader) {
  CameraInfoMessage info;
  info.header = reader.header();
  info.height = reader.read<std::uint32_t>();
  info.width = reader.read<std::uint32_t>();
  info.distortion_model = reader.string();
  reader.sequence(info.distortion);
  info.camera_matrix = reader.array<double, 9>();
  info.rectification = reader.array<double, 9>();
  info.projection = reader.array<double, 12>();
  for (std::uint32_t* field :
       {&info.binning_x, &info.binning_y, &info.roi_x, &info.roi_y, &info.roi_height, &info.roi_width})
    *field = reader.read<std::uint32_t>();
  return info;
}

PointCloudMessage read_point_cloud(MessageReader& reader) {
  PointCloudMessage cloud;
  cloud.header = reader.header();
  cloud.height = reader.read<std::uint32_t>();
  cloud.width = reader.read<std::uint32_t>();
  constexpr std::size_t kLeastBytes = 13;
  cloud.fields.resize(reader.count(kLeastBytes));
  for (PointField& field : cloud.fields) {
    field.name = reader.string();
    field.offset = reader.read<std::uint32_t>();
    field.type = reader.read<std::uint8_t>();
    field.count = reader.read<std::uint32_t>();
  }
  cloud.is_big_endian = reader.read<bool>();
  cloud.point_step_bytes = reader.read<std::uint32_t>();
  cloud.row_step_bytes = reader.read<std::uint32_t>();
  cloud.data = reader.bytes();
  cloud.is_dense = reader.read<bool>();
  return cloud;
}

}  // namespace mapweave::rawlog::ros
