#pragma once
// What a camera client takes: rectified pictures, and depth where there is some.

#include <mapweave/core/geometry.h>
#include <mapweave/core/stamp.h>
#include <mapweave/matching/orb_features.h>
#include <mapweave/visual/camera.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace mapweave::visual {

template <class Pixel>
struct Image {
  int width = 0, height = 0;
  std::vector<Pixel> pixels;  // row by row
  Image() = default;
  Image(int w, int h) : width(w), height(h), pixels(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {}
  bool empty() const { return pixels.empty(); }
  const Pixel* row(int y) const {
    return pixels.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
  }
  Pixel* row(int y) { return pixels.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width); }
};
using GreyImage = Image<std::uint8_t>;
using DepthImage = Image<std::uint16_t>;

// Depth as the sensor gave it: registered to the picture before rectification. 0 is no reading.
struct DepthPicture {
  DepthImage image;
  double metres_per_unit = 0.001;
  Pinhole camera;
  Distortion distortion;
  double delay_s = 0.0;  // taken so much later than the picture; negative: earlier
};

// The colours of a picture as the sensor gave it, before rectification; the pixels are shared with whoever decoded
// them.
struct ColourPicture {
  std::shared_ptr<const std::uint8_t> blue_green_red;  // 8 bits each, pixel by pixel; null without colours
  int width = 0, height = 0;
  std::size_t row_bytes = 0;
  Pinhole camera;
  Distortion distortion;
  Eigen::Quaterniond raw_from_rectified =
      Eigen::Quaterniond::Identity();  // rectifying a stereo pair turns its pictures
};

// How the camera moved since the frame before by wheels or gyroscopes, before its picture is looked at.
struct ExpectedMotion {
  Eigen::Quaterniond earlier_from_later = Eigen::Quaterniond::Identity();  // optical frames
  std::optional<Eigen::Vector3d> translation;  // of the later camera in the earlier one's frame, metres
};

struct Frame {
  Stamp stamp;
  GreyImage grey;      // rectified
  GreyImage right;     // rectified, of the same camera model, rows aligned; empty without a second camera
  DepthPicture depth;  // image empty without depth
  ColourPicture colour;
  std::optional<ExpectedMotion> expected;
  // Where wheels or an inertial unit say that the camera was, in a frame of their own that drifts: what a camera
  // without depth takes scale from, and by which places that look the same are distinguished.
  std::optional<Pose3> odometry_from_camera;
  bool shows_depth() const { return !right.empty() || !depth.image.empty(); }
};

// Of a sensor that hands over features instead of pictures. Each has a descriptor and an inverse depth (1/m; 0: none).
struct FeatureFrame {
  Stamp stamp;
  matching::OrbFeatures features;  // of the rectified camera
  std::vector<float> inverse_depths;
  double level_factor = 1.2;  // from one level of the features' pyramid to the next
  std::optional<Pose3> odometry_from_camera;
};

}  // namespace mapweave::visual
