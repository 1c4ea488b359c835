#include "ros_messages.h"

#include <mapweave/core/error.h>
#include <mapweave/exporters/map_server.h>

#include <boost/endian/conversion.hpp>

#include <algorithm>
#include <cstring>
#include <limits>

namespace mapweave::ros_nodes {
namespace {

constexpr std::int64_t kNanoseconds = 1'000'000'000;

template <class Vector>
std::optional<Pose3> checked_pose(const Vector& position, const geometry_msgs::Quaternion& orientation) {
  constexpr double kLengthTolerance = 0.1;
  const Eigen::Quaterniond q(orientation.w, orientation.x, orientation.y, orientation.z);
  const Pose3 pose{{position.x, position.y, position.z}, q.normalized()};
  const bool is_rotation = std::abs(q.norm() - 1.0) < kLengthTolerance;  // false for what is not finite, too
  return is_rotation && is_finite(pose) ? std::optional(pose) : std::nullopt;
}

geometry_msgs::Quaternion quaternion_message(const Eigen::Quaterniond& q) {
  geometry_msgs::Quaternion message;
  message.x = q.x();
  message.y = q.y();
  message.z = q.z();
  message.w = q.w();
  return message;
}

bool has_equal_geometry(const nav_msgs::OccupancyGrid& one, const nav_msgs::OccupancyGrid& other) {
  return one.header.frame_id == other.header.frame_id && one.info.width == other.info.width &&
         one.info.height == other.info.height && one.info.resolution == other.info.resolution &&
         one.info.origin == other.info.origin && one.data.size() == other.data.size();
}

}  // namespace

ros::Time ros_time(Stamp stamp) {
  if (stamp.ns < 0 || stamp.ns / kNanoseconds > std::numeric_limits<std::uint32_t>::max())
    throw Error(ErrorCode::kBadInput,
                "the map has a stamp of " + std::to_string(stamp.ns / kNanoseconds) +
                    " s; messages of ROS 1 hold 0 to " + std::to_string(std::numeric_limits<std::uint32_t>::max()) +
                    " s after 1970",
                {}, "map data with stamps of that time");
  return {static_cast<std::uint32_t>(stamp.ns / kNanoseconds), static_cast<std::uint32_t>(stamp.ns % kNanoseconds)};
}

Stamp stamp_of(const ros::Time& time) { return {static_cast<std::int64_t>(time.sec) * kNanoseconds + time.nsec}; }

geometry_msgs::Pose pose_message(const Pose3& pose) {
  geometry_msgs::Pose message;
  message.position.x = pose.t.x();
  message.position.y = pose.t.y();
  message.position.z = pose.t.z();
  message.orientation = quaternion_message(pose.q);
  return message;
}

geometry_msgs::Transform transform_message(const Pose3& pose) {
  geometry_msgs::Transform message;
  message.translation.x = pose.t.x();
  message.translation.y = pose.t.y();
  message.translation.z = pose.t.z();
  message.rotation = quaternion_message(pose.q);
  return message;
}

geometry_msgs::TransformStamped transform_between(const std::string& parent, const std::string& child,
                                                  const Pose3& parent_from_child) {
  geometry_msgs::TransformStamped message;
  message.header.frame_id = parent;
  message.child_frame_id = child;
  message.transform = transform_message(parent_from_child);
  return message;
}

std::optional<Pose3> pose_of(const geometry_msgs::Pose& message) {
  return checked_pose(message.position, message.orientation);
}

std::optional<Pose3> pose_of(const geometry_msgs::Transform& message) {
  return checked_pose(message.translation, message.rotation);
}

nav_msgs::OccupancyGrid grid_message(const OccupancyGrid& grid, const std::string& frame) {
  nav_msgs::OccupancyGrid message;
  message.header.frame_id = frame;
  message.info.resolution = static_cast<float>(grid.resolution_m);
  message.info.width = static_cast<std::uint32_t>(grid.columns);
  message.info.height = static_cast<std::uint32_t>(grid.rows);
  message.info.origin = pose_message({{grid.origin_x_m, grid.origin_y_m, 0.0}, Eigen::Quaterniond::Identity()});
  message.data.reserve(grid.log_odds.size());
  std::transform(grid.log_odds.begin(), grid.log_odds.end(), std::back_inserter(message.data),
                 exporters::served_occupancy);
  return message;
}

std::optional<map_msgs::OccupancyGridUpdate> grid_update(const nav_msgs::OccupancyGrid& before,
                                                         const nav_msgs::OccupancyGrid& now) {
  if (!has_equal_geometry(before, now)) return std::nullopt;
  const std::size_t columns = now.info.width, rows = now.info.height;
  std::size_t low_column = columns, low_row = rows, end_column = 0, end_row = 0;
  for (std::size_t row = 0; row < rows; ++row) {
    const auto begin = now.data.begin() + static_cast<std::ptrdiff_t>(row * columns),
               end = begin + static_cast<std::ptrdiff_t>(columns);
    const auto old_begin = before.data.begin() + static_cast<std::ptrdiff_t>(row * columns);
    const auto first = std::mismatch(begin, end, old_begin).first;
    if (first == end) continue;
    const auto last = std::mismatch(std::make_reverse_iterator(end), std::make_reverse_iterator(begin),
                                    std::make_reverse_iterator(old_begin + static_cast<std::ptrdiff_t>(columns)))
                          .first.base();
    low_column = std::min(low_column, static_cast<std::size_t>(first - begin));
    end_column = std::max(end_column, static_cast<std::size_t>(last - begin));
    low_row = std::min(low_row, row);
    end_row = row + 1;
  }
  map_msgs::OccupancyGridUpdate update;
  update.header.frame_id = now.header.frame_id;
  if (end_row == 0) return update;
  update.x = static_cast<std::int32_t>(low_column);
  update.y = static_cast<std::int32_t>(low_row);
  update.width = static_cast<std::uint32_t>(end_column - low_column);
  update.height = static_cast<std::uint32_t>(end_row - low_row);
  update.data.reserve((end_column - low_column) * (end_row - low_row));
  for (std::size_t row = low_row; row < end_row; ++row) {
    const auto begin = now.data.begin() + static_cast<std::ptrdiff_t>(row * columns + low_column);
    update.data.insert(update.data.end(), begin, begin + static_cast<std::ptrdiff_t>(update.width));
  }
  return update;
}

nav_msgs::Path path_message(const std::vector<StampedPose>& poses, const std::string& frame) {
  nav_msgs::Path path;
  path.header.frame_id = frame;
  path.poses.reserve(poses.size());
  for (const StampedPose& pose : poses) {
    geometry_msgs::PoseStamped& message = path.poses.emplace_back();
    message.header.frame_id = frame;
    message.header.stamp = ros_time(pose.stamp);
    message.pose = pose_message(pose.map_from_robot);
  }
  return path;
}

sensor_msgs::PointCloud2 cloud_message(const std::vector<exporters::ColouredPoint>& points, const std::string& frame) {
  sensor_msgs::PointCloud2 cloud;
  cloud.header.frame_id = frame;
  for (const char* name : {"x", "y", "z", "rgb"}) {
    sensor_msgs::PointField field;
    field.name = name;
    field.offset = static_cast<std::uint32_t>(cloud.fields.size() * sizeof(float));
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
    cloud.fields.push_back(field);
  }
  cloud.is_bigendian = boost::endian::order::native == boost::endian::order::big ? 1 : 0;
  cloud.is_dense = 1;
  cloud.point_step = static_cast<std::uint32_t>(cloud.fields.size() * sizeof(float));
  cloud.height = 1;
  cloud.width = static_cast<std::uint32_t>(points.size());
  cloud.row_step = cloud.point_step * cloud.width;
  cloud.data.resize(cloud.row_step);
  std::uint8_t* place = cloud.data.data();
  for (const auto& [point, rgb] : points) {
    std::memcpy(place, point.data(), 3 * sizeof(float));
    std::memcpy(place + 3 * sizeof(float), &rgb, sizeof rgb);
    place += cloud.point_step;
  }
  return cloud;
}

}  // namespace mapweave::ros_nodes
