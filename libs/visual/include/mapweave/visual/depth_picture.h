#pragma once
// How far away is what each pixel shows: for clouds and 3D grids. Tracking asks for the depth of single corners
// instead.

#include <mapweave/visual/client_options.h>
#include <mapweave/visual/frame_input.h>

#include <array>

namespace mapweave::visual {

struct DepthPictureOptions {
  DepthOptions depth;
  double disparity_sigma_px = 0.5;  // of a stereo pair
  double most_error_m = 0.1;        // farther readings, whose deviation is larger, are left out
  SensorCalibration calibration;    // the offset is taken out
};

// Along z, in metres, of each pixel of the rectified picture; 0: not known. A depth camera's own, moved to where the
// picture was taken, or that of a stereo pair by semi-global matching of blocks (Hirschmueller 2008, OpenCV's), checked
// from right to left. Readings beside steps and holes are left out: they lie between what is near and what is far.
// Empty for a frame without either. depth_from_picture: how the camera moved from the picture to the depth
// (DepthPicture::delay_s).
Image<float> depth_picture_of(const Frame&, const CameraRig&, const DepthPictureOptions& = {},
                              const Pose3& depth_from_picture = {});

// Red, green, blue at a pixel of the rectified picture; its grey where it has no colours.
std::array<std::uint8_t, 3> colour_at(const Frame&, const Pinhole&, const Eigen::Vector2d& pixel);

}  // namespace mapweave::visual
