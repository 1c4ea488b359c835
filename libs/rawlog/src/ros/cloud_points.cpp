#include "cloud_points.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <cstring>

namespace mapweave::rawlog::ros {
namespace {

// sensor_msgs/PointField
constexpr std::uint8_t kInt8 = 1, kUint8 = 2, kUint16 = 4, kUint32 = 6, kFloat32 = 7, kFloat64 = 8;

std::uint32_t size_of(std::uint8_t type) { return type <= kUint8 ? 1 : type <= kUint16 ? 2 : type <= kFloat32 ? 4 : 8; }

[[noreturn]] void refuse(const std::string& what) {
  throw Error(ErrorCode::kBadInput, "a point cloud cannot be used: " + what);
}

std::string names_of(const std::vector<PointField>& fields) {
  constexpr std::size_t kMostShown = 20, kMostLetters = 32;
  std::string names;
  for (std::size_t i = 0; i < fields.size() && i < kMostShown; ++i)
    names += (names.empty() ? "" : ", ") + std::string(fields[i].name.substr(0, kMostLetters));
  return names.empty() ? "none" : names;
}

template <class Number>
Number loaded(const char* place) {
  Number number;
  std::memcpy(&number, place, sizeof number);
  return number;
}

}  // namespace

CloudPoints::CloudPoints(const PointCloudMessage& cloud) : cloud_(cloud) {
  if (cloud.is_big_endian) refuse("it is big-endian; little-endian was expected");
  const std::uint64_t row = std::uint64_t{cloud.width} * cloud.point_step_bytes;
  if (cloud.row_step_bytes < row || cloud.data.size() < std::uint64_t{cloud.height} * cloud.row_step_bytes)
    refuse("its data have " + std::to_string(cloud.data.size()) + " bytes; " + std::to_string(cloud.height) +
           " rows of " + std::to_string(row) + " bytes were expected");
  for (std::size_t axis = 0; axis < xyz_.size(); ++axis) {
    const std::string_view name = std::string_view("xyz").substr(axis, 1);
    xyz_[axis] = find({name});
    if (xyz_[axis] == nullptr)
      refuse("its points have no field '" + std::string(name) + "'; their fields: " + names_of(cloud.fields));
    if (xyz_[axis]->type != kFloat32 && xyz_[axis]->type != kFloat64)
      refuse("its field '" + std::string(name) + "' is of datatype " + std::to_string(xyz_[axis]->type) +
             "; 7 (float32) or 8 (float64) was expected");
  }
  ring_ = find({"ring", "channel", "line"});
  if (ring_ != nullptr && ring_->type > kUint16) ring_ = nullptr;
  colour_ = find({"rgb", "rgba"});
  if (colour_ != nullptr && colour_->type != kFloat32 && colour_->type != kUint32) colour_ = nullptr;
}

const PointField* CloudPoints::find(std::initializer_list<std::string_view> names) const {
  for (const PointField& field : cloud_.fields)
    if (std::find(names.begin(), names.end(), field.name) != names.end()) {
      if (field.type < kInt8 || field.type > kFloat64)
        refuse("its field '" + std::string(field.name) + "' is of datatype " + std::to_string(field.type) +
               "; 1 to 8 are known");
      if (std::uint64_t{field.offset} + size_of(field.type) > cloud_.point_step_bytes)
        refuse("its field '" + std::string(field.name) + "' lies outside of a point");
      return &field;
    }
  return nullptr;
}

double CloudPoints::coordinate(const char* point, std::size_t axis) const {
  const PointField& field = *xyz_[axis];
  return field.type == kFloat32 ? loaded<float>(point + field.offset) : loaded<double>(point + field.offset);
}

int CloudPoints::ring_of(const char* point) const {
  if (ring_->type <= kUint8) return static_cast<unsigned char>(point[ring_->offset]);
  return loaded<std::uint16_t>(point + ring_->offset);
}

std::array<std::uint8_t, 3> CloudPoints::blue_green_red(std::uint32_t row, std::uint32_t column) const {
  return loaded<std::array<std::uint8_t, 3>>(bytes_of(row, column) + colour_->offset);
}

std::optional<bool> are_at_their_pixels(const CloudPoints& points, const mrpt::img::TCamera& camera) {
  // So wide that neither a lens nor another camera beside this one is refused; other axes are far beyond.
  const double near_px = std::max(2.0, 0.1 * points.columns());
  std::uint64_t measured = 0, near = 0;
  for (std::uint32_t row = 0; row < points.rows(); ++row)
    for (std::uint32_t column = 0; column < points.columns(); ++column) {
      const Eigen::Vector3d point = points.at(row, column);
      if (!point.allFinite() || point.isZero()) continue;
      ++measured;
      if (!(point.z() > 0.0)) continue;
      const double x_px = camera.fx() * point.x() / point.z() + camera.cx();
      const double y_px = camera.fy() * point.y() / point.z() + camera.cy();
      if (std::abs(x_px - column) < near_px && std::abs(y_px - row) < near_px) ++near;
    }
  if (measured == 0) return std::nullopt;
  return 2 * near >= measured;
}

}  // namespace mapweave::rawlog::ros
