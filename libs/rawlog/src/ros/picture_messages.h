#pragma once
// Pictures and calibrations of ROS as MRPT has them. All throw Error for what cannot be decoded, without its place:
// kBadInput for sizes that do not fit, kUnsupported for encodings, kCorrupt for compressed pictures.

#include "cloud_points.h"
#include "messages.h"

#include <mrpt/img/CImage.h>
#include <mrpt/img/TCamera.h>
#include <mrpt/math/CMatrixDynamic.h>

#include <array>
#include <optional>
#include <string>

namespace mapweave::rawlog::ros {

constexpr float kDepthUnit_m = 0.001f;  // of depth pictures, as REP 118 has them in 16UC1

// Grey or colour of 8 bits: mono8, mono16, rgb8, bgr8, rgba8, bgra8, Bayer patterns, YUV 4:2:2.
mrpt::img::CImage to_picture(const ImageMessage& message);
// JPEG or PNG.
mrpt::img::CImage to_picture(const CompressedImageMessage& message);

// Millimetres, 0 for no reading, after REP 118: of 16UC1 (millimetres) or 32FC1 (metres; not finite, or beyond 65.5 m:
// no reading).
mrpt::math::CMatrix_u16 to_depth(const ImageMessage& message);
// What compressed_depth_image_transport writes: PNG behind a header, of 32FC1 as inverse depth.
mrpt::math::CMatrix_u16 to_depth(const CompressedImageMessage& message);
// Of an organised cloud, a point for each pixel in optical axes: z, in steps as above.
mrpt::math::CMatrix_u16 to_depth(const CloudPoints& points);
// The colours of an organised cloud that has some.
mrpt::img::CImage to_picture(const CloudPoints& points);

struct ConvertedCalibration {
  mrpt::img::TCamera camera;
  std::string remark;                            // what is not as the message says; empty where it is
  std::optional<std::array<double, 4>> fisheye;  // FisheyeLens; the camera is what remains of it
};

// Of raw pictures the camera matrix and distortion (plumb_bob; rational_polynomial as the radial-tangential model
// nearest to it; none of a fisheye lens, equidistant), of rectified ones the projection. Binning and the region of
// interest are taken into account. A camera without a calibration (all zero) gets focal lengths of 0.
ConvertedCalibration to_calibration(const CameraInfoMessage& message, bool is_rectified);

}  // namespace mapweave::rawlog::ros
