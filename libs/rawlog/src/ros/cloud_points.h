#pragma once
// The points of a sensor_msgs/PointCloud2.

#include "messages.h"

#include <mrpt/img/TCamera.h>
#include <Eigen/Core>

#include <array>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>

namespace mapweave::rawlog::ros {

// The message must outlive it. Throws Error kBadInput for a cloud that is big-endian, without x, y and z as floating
// point numbers, or whose sizes do not fit its data.
class CloudPoints {
 public:
  explicit CloudPoints(const PointCloudMessage& cloud);

  std::uint32_t rows() const { return cloud_.width == 0 ? 0 : cloud_.height; }
  std::uint32_t columns() const { return cloud_.width; }
  bool has_rings() const { return ring_ != nullptr; }
  bool has_colours() const { return colour_ != nullptr; }

  // In the sensor's frame; not finite where nothing was measured.
  Eigen::Vector3d at(std::uint32_t row, std::uint32_t column) const {
    const char* point = bytes_of(row, column);
    return {coordinate(point, 0), coordinate(point, 1), coordinate(point, 2)};
  }
  // Where has_colours(): as PCL packs them, the field "rgb" or "rgba".
  std::array<std::uint8_t, 3> blue_green_red(std::uint32_t row, std::uint32_t column) const;

  template <class Use>  // use(point that is finite, its ring or 0)
  void for_each(const Use& use) const {
    for (std::uint32_t row = 0; row < rows(); ++row)
      for (std::uint32_t column = 0; column < columns(); ++column) {
        const Eigen::Vector3d place = at(row, column);
        if (place.allFinite()) use(place, ring_ == nullptr ? 0 : ring_of(bytes_of(row, column)));
      }
  }

 private:
  const PointField* find(std::initializer_list<std::string_view> names) const;
  const char* bytes_of(std::uint32_t row, std::uint32_t column) const {
    return cloud_.data.data() + std::uint64_t{row} * cloud_.row_step_bytes +
           std::uint64_t{column} * cloud_.point_step_bytes;
  }
  double coordinate(const char* point, std::size_t axis) const;
  int ring_of(const char* point) const;

  const PointCloudMessage& cloud_;
  std::array<const PointField*, 3> xyz_{};
  const PointField *ring_ = nullptr, *colour_ = nullptr;  // null: none
};

// Whether the points of an organised cloud are seen by `camera` at about the pixels in whose places they stand, in
// optical axes (x right, y down, z ahead). Nullopt where that cannot be said.
std::optional<bool> are_at_their_pixels(const CloudPoints& points, const mrpt::img::TCamera& camera);

}  // namespace mapweave::rawlog::ros
