#pragma once
// What a camera saw at a keyframe, packed: 40 bytes a feature here, 37 on a wire.

#include <mapweave/core/geometry.h>
#include <mapweave/core/pinhole.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

namespace mapweave {

// What all keyframes of one camera share: a rectified pinhole. Frame `camera`: x right, y down, z forward. Pixels: the
// centre of the upper left one is (0, 0).
struct CameraGeometry {
  std::int32_t width = 0, height = 0;  // pixels, 1 to 4096
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;
  double baseline_m = 0.0;   // of a stereo pair; 0: none
  double level_scale = 1.2;  // between two levels of the features' pyramid
  Pose3 robot_from_camera;

  Pinhole pinhole() const { return {width, height, fx, fy, cx, cy}; }
};
bool operator==(const CameraGeometry&, const CameraGeometry&);

// 256 bits, as ORB makes them: byte i of OpenCV's row is bits 8 (i % 8) .. 8 (i % 8) + 7 of word i / 8.
using BinaryDescriptor = std::array<std::uint64_t, 4>;

struct KeyframePoint {
  std::uint16_t u = 0, v = 0;       // in the full picture; pixels_of()
  std::uint16_t inverse_depth = 0;  // along the optical axis, as the sensor measured it; depth_m_of(); 0: unknown
  std::uint8_t level = 0;           // of the features' pyramid
  std::uint8_t angle = 0;           // of the patch, in 256ths of a turn
};
static_assert(sizeof(KeyframePoint) == 8);

// Immutable once shared.
struct KeyframeFeatures {
  std::shared_ptr<const CameraGeometry> geometry;
  std::vector<KeyframePoint> points;
  std::vector<BinaryDescriptor> descriptors;  // of the points, as many
};

// Pixels are kept in sixteenths: 0 to 4095.9.
inline constexpr double kPixelUnit_px = 1.0 / 16.0;
inline double pixels_of(std::uint16_t units) { return units * kPixelUnit_px; }
inline std::uint16_t pixel_units(double pixels) {  // what lies outside goes to the border
  return static_cast<std::uint16_t>(std::lround(std::clamp(pixels / kPixelUnit_px, 0.0, 65535.0)));
}

// Depths are kept as their inverse, which is what cameras measure evenly: steps of 0.24 mm at 1 m, 24 mm at 10 m, 10 m
// at 200 m.
inline constexpr double kInverseDepthUnit_per_m = 1.0 / 4096.0;
inline constexpr double kLeastDepth_m = 1.0 / (65535.5 * kInverseDepthUnit_per_m),
                        kMostDepth_m = 2.0 / kInverseDepthUnit_per_m;
inline double depth_m_of(std::uint16_t inverse_depth) {
  return inverse_depth == 0 ? 0.0 : 1.0 / (inverse_depth * kInverseDepthUnit_per_m);
}
inline std::uint16_t inverse_depth_units(
    double depth_m) {  // 0, unknown, outside of 62 mm to 8 km, and for what is no number
  if (!(depth_m > kLeastDepth_m && depth_m < kMostDepth_m)) return 0;
  return static_cast<std::uint16_t>(std::lround(1.0 / (depth_m * kInverseDepthUnit_per_m)));
}

inline double angle_deg_of(std::uint8_t angle) { return angle * (360.0 / 256.0); }
inline std::uint8_t angle_units(double angle_deg) {
  return static_cast<std::uint8_t>(std::lround(angle_deg * (256.0 / 360.0)) & 0xff);
}

}  // namespace mapweave
