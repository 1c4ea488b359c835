#include <mapweave/visual/depth_picture.h>

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace mapweave::visual {
namespace {

using InverseDepths = Image<float>;  // as measured, 1/m; 0: none

// In the depth camera's frame, along z; 0 where there is no reading.
double reading_at(const DepthPicture& depth, const Eigen::Vector3d& ray_in_depth) {
  if (ray_in_depth.z() < kLeastForward * ray_in_depth.norm()) return 0.0;
  const Eigen::Vector2d there =
      depth.distortion.distorted({ray_in_depth.x() / ray_in_depth.z(), ray_in_depth.y() / ray_in_depth.z()});
  const double column = there.x() * depth.camera.fx + depth.camera.cx,
               row = there.y() * depth.camera.fy + depth.camera.cy;
  if (!(column > -0.5 && row > -0.5 && column < depth.image.width - 0.5 && row < depth.image.height - 0.5)) return 0.0;
  return depth.image.row(static_cast<int>(std::lround(row)))[std::lround(column)] * depth.metres_per_unit;
}

// The depth that the picture's ray has must be that which the depth camera sees in the direction of the point: found by
// iteration.
InverseDepths of_depth_camera(const DepthPicture& depth, const Pinhole& camera, const Pose3& depth_from_picture) {
  const Pose3 picture_from_depth = inverse(depth_from_picture);
  InverseDepths result(camera.width, camera.height);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray = camera.ray({static_cast<double>(x), static_cast<double>(y)});
      Eigen::Vector3d ray_in_depth = depth_from_picture.q * ray;
      double along_z = 0.0;
      for (int pass = 0; pass < 2; ++pass) {
        const double reading = reading_at(depth, ray_in_depth);
        if (!(reading > 0.0)) {
          along_z = 0.0;
          break;
        }
        along_z = transformed(ray_in_depth * (reading / ray_in_depth.z()), picture_from_depth).z();
        ray_in_depth = transformed(ray * along_z, depth_from_picture);
      }
      if (along_z > 0.0) result.row(y)[x] = static_cast<float>(1.0 / along_z);
    }
  return result;
}

cv::Mat padded(const GreyImage& image, int left) {
  cv::Mat result;
  cv::copyMakeBorder(cv::Mat(image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels.data())), result,
                     0, 0, left, 0, cv::BORDER_REPLICATE);
  return result;
}

InverseDepths of_pair(const Frame& frame, const CameraRig& rig, double max_disparity) {
  constexpr int kBlock = 5, kUnits = 16;  // disparities come in sixteenths of a pixel
  constexpr int kSmall = 8,
                kLarge = 32;  // of changes of disparity by 1 and by more: OpenCV's advice, per pixel of the block
  constexpr int kSpeckle = 100, kSameSurface = 2;  // surfaces of fewer pixels are chance; pixels of disparity
  constexpr float kLeastDisparity_px = 1.0F;       // depth beyond it is noise
  // The matcher leaves the first columns out that could lie beyond the right picture's rim: hence the padding.
  const int disparities = 16 * std::max(1, static_cast<int>(std::ceil(max_disparity * frame.grey.width / 16.0)));
  const auto matcher =
      cv::StereoSGBM::create(0, disparities, kBlock, kSmall * kBlock * kBlock, kLarge * kBlock * kBlock, 1, 31, 10,
                             kSpeckle, kSameSurface, cv::StereoSGBM::MODE_SGBM);
  cv::Mat found;
  matcher->compute(padded(frame.grey, disparities), padded(frame.right, disparities), found);
  const auto focal_baseline = static_cast<float>(rig.camera.fx * rig.baseline_m);
  InverseDepths result(frame.grey.width, frame.grey.height);
  for (int y = 0; y < result.height; ++y)
    for (int x = 0; x < result.width; ++x) {
      const float disparity = static_cast<float>(found.at<std::int16_t>(y, x + disparities)) / kUnits;
      if (disparity >= kLeastDisparity_px && disparity <= static_cast<float>(x))
        result.row(y)[x] = disparity / focal_baseline;
    }
  return result;
}

// Planes are linear in inverse depth: what bends sharply is a step.
std::vector<bool> steps_of(const InverseDepths& inverse, double sigma) {
  constexpr float kShare = 0.03F;  // of the depth, between neighbours on one surface
  const auto noise = static_cast<float>(2.0 * sigma);
  std::vector<bool> steps(inverse.pixels.size(), true);
  for (int y = 1; y + 1 < inverse.height; ++y)
    for (int x = 1; x + 1 < inverse.width; ++x) {
      const float *above = inverse.row(y - 1) + x, *here = inverse.row(y) + x, *below = inverse.row(y + 1) + x;
      const float most = kShare * here[0] + noise;
      steps[static_cast<std::size_t>(y) * static_cast<std::size_t>(inverse.width) + static_cast<std::size_t>(x)] =
          here[0] == 0.0F || here[-1] == 0.0F || here[1] == 0.0F || above[0] == 0.0F || below[0] == 0.0F ||
          std::abs(here[-1] + here[1] - 2.0F * here[0]) > most || std::abs(above[0] + below[0] - 2.0F * here[0]) > most;
    }
  return steps;
}

}  // namespace

Image<float> depth_picture_of(const Frame& frame, const CameraRig& rig, const DepthPictureOptions& options,
                              const Pose3& depth_from_picture) {
  MAPWEAVE_EXPECT(is_finite(depth_from_picture), "the motion between picture and depth is finite");
  if (!frame.shows_depth()) return {};
  const bool pair = !frame.right.empty();
  const InverseDepths inverse = pair ? of_pair(frame, rig, options.depth.max_disparity)
                                     : of_depth_camera(frame.depth, rig.camera, depth_from_picture);
  const double sigma =
      pair ? options.disparity_sigma_px / (rig.camera.fx * rig.baseline_m) : options.depth.inverse_depth_sigma;
  const std::vector<bool> steps = steps_of(inverse, sigma);
  double most_m =
      std::sqrt(options.most_error_m / sigma);  // a deviation of depth is that of inverse depth times depth squared
  if (!pair) most_m = std::min(most_m, options.depth.max_depth_m);

  Image<float> result(inverse.width, inverse.height);
  const auto width = static_cast<std::size_t>(inverse.width);
  for (std::size_t y = 1; y + 1 < static_cast<std::size_t>(inverse.height); ++y)
    for (std::size_t x = 1; x + 1 < width; ++x) {
      const std::size_t at = y * width + x;
      if (steps[at] || steps[at - 1] || steps[at + 1] || steps[at - width] || steps[at + width]) continue;
      const double truth = static_cast<double>(inverse.pixels[at]) - options.calibration.inverse_depth_offset;
      if (truth * most_m < 1.0 || truth * options.depth.min_depth_m > 1.0) continue;
      result.pixels[at] = static_cast<float>(1.0 / truth);
    }
  return result;
}

std::array<std::uint8_t, 3> colour_at(const Frame& frame, const Pinhole& camera, const Eigen::Vector2d& pixel) {
  const ColourPicture& colour = frame.colour;
  const Eigen::Vector3d ray = colour.raw_from_rectified * camera.ray(pixel);
  if (colour.blue_green_red && ray.z() > kLeastForward) {
    const Eigen::Vector2d there = colour.distortion.distorted({ray.x() / ray.z(), ray.y() / ray.z()});
    const auto x = std::lround(there.x() * colour.camera.fx + colour.camera.cx),
               y = std::lround(there.y() * colour.camera.fy + colour.camera.cy);
    if (x >= 0 && y >= 0 && x < colour.width && y < colour.height) {
      const std::uint8_t* at = colour.blue_green_red.get() + static_cast<std::size_t>(y) * colour.row_bytes +
                               3 * static_cast<std::size_t>(x);
      return {at[2], at[1], at[0]};
    }
  }
  if (frame.grey.empty()) return {128, 128, 128};  // features without a picture
  const std::uint8_t grey = frame.grey.row(static_cast<int>(std::lround(pixel.y())))[std::lround(pixel.x())];
  return {grey, grey, grey};
}

}  // namespace mapweave::visual
