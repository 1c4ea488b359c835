#include "rectifier.h"

#include <mapweave/core/error.h>

#include <opencv2/imgproc.hpp>

namespace mapweave::visual {

struct Rectifier::Lookup {
  cv::Mat whole, fraction;  // fixed point: of each rectified pixel, the place in the raw picture
};

namespace {

cv::Mat view_of_pixels(const GreyImage& image) {
  return {image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels.data())};
}

// rectified_from_raw: rotation of the raw camera's rays.
template <class Lookup>
std::shared_ptr<const Lookup> lookup_of(const LensCalibration& lens, const Pinhole& rectified,
                                        const Eigen::Matrix3d& rectified_from_raw) {
  cv::Mat columns(rectified.height, rectified.width, CV_32F), rows(rectified.height, rectified.width, CV_32F);
  const Eigen::Matrix3d raw_from_rectified = rectified_from_raw.transpose();
  for (int y = 0; y < rectified.height; ++y)
    for (int x = 0; x < rectified.width; ++x) {
      const Eigen::Vector3d ray = raw_from_rectified * rectified.ray({static_cast<double>(x), static_cast<double>(y)});
      const Eigen::Vector2d there = lens.distortion.distorted({ray.x() / ray.z(), ray.y() / ray.z()});
      columns.at<float>(y, x) = static_cast<float>(there.x() * lens.camera.fx + lens.camera.cx);
      rows.at<float>(y, x) = static_cast<float>(there.y() * lens.camera.fy + lens.camera.cy);
    }
  auto lookup = std::make_shared<Lookup>();
  cv::convertMaps(columns, rows, lookup->whole, lookup->fraction, CV_16SC2);
  return lookup;
}

// The ideal place of a pixel, by iteration.
Eigen::Vector2d undistorted(const LensCalibration& lens, double column, double row) {
  const Eigen::Vector2d seen((column - lens.camera.cx) / lens.camera.fx, (row - lens.camera.cy) / lens.camera.fy);
  Eigen::Vector2d ideal = seen;
  for (int i = 0; i < 20; ++i) ideal += seen - lens.distortion.distorted(ideal);
  return ideal;
}

// The half of a rotation, turned forth by one camera and back by the other.
Eigen::Matrix3d half_of(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return Eigen::AngleAxisd(0.5 * turn.angle(), turn.axis()).toRotationMatrix();
}

}  // namespace

Rectifier::Rectifier(const LensCalibration& lens) : camera_(lens.camera) {
  if (!lens.distortion.is_none()) left_ = lookup_of<Lookup>(lens, camera_, Eigen::Matrix3d::Identity());
}

// Both cameras are turned by half of their difference each, then so that the x axis runs along the baseline (Bouguet's
// way).
Rectifier::Rectifier(const LensCalibration& left, const LensCalibration& right, const Pose3& left_from_right) {
  MAPWEAVE_EXPECT(left.camera.width == right.camera.width && left.camera.height == right.camera.height,
                  "both pictures of one size");
  baseline_m_ = left_from_right.t.norm();
  const Eigen::Matrix3d half =
      half_of(left_from_right.q.toRotationMatrix());  // middle_from_right; its inverse: middle_from_left
  Eigen::Vector3d x = half.transpose() * left_from_right.t.normalized();  // in the middle frame
  const Eigen::Vector3d y = Eigen::Vector3d::UnitZ().cross(x).normalized();
  Eigen::Matrix3d rectified_from_middle;
  rectified_from_middle << x.transpose(), y.transpose(), x.cross(y).transpose();
  const Eigen::Matrix3d from_left = rectified_from_middle * half.transpose(), from_right = rectified_from_middle * half;
  left_from_rectified_.q = Eigen::Quaterniond(from_left.transpose()).normalized();

  const auto same = [](const Pinhole& a, const Pinhole& b) {
    return std::abs(a.fx - b.fx) < 1e-6 && std::abs(a.fy - b.fy) < 1e-6 && std::abs(a.cx - b.cx) < 1e-6 &&
           std::abs(a.cy - b.cy) < 1e-6;
  };
  camera_ = left.camera;
  if (left.distortion.is_none() && right.distortion.is_none() && same(left.camera, right.camera) &&
      from_left.isIdentity(1e-9) && from_right.isIdentity(1e-9))
    return;
  // One focal length for all; the middle of what both see stays in the middle.
  const double focal = std::min({left.camera.fx, left.camera.fy, right.camera.fx, right.camera.fy});
  camera_.fx = camera_.fy = focal;
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (int side = 0; side < 2; ++side) {
    const LensCalibration& lens = side == 0 ? left : right;
    for (int corner = 0; corner < 4; ++corner) {
      const Eigen::Vector2d ideal = undistorted(lens, corner % 2 == 0 ? 0.0 : lens.camera.width - 1.0,
                                                corner < 2 ? 0.0 : lens.camera.height - 1.0);
      const Eigen::Vector3d ray = (side == 0 ? from_left : from_right) * Eigen::Vector3d(ideal.x(), ideal.y(), 1.0);
      middle += Eigen::Vector2d(ray.x() / ray.z(), ray.y() / ray.z()) / 8.0;
    }
  }
  camera_.cx = 0.5 * (camera_.width - 1.0) - focal * middle.x();
  camera_.cy = 0.5 * (camera_.height - 1.0) - focal * middle.y();
  left_ = lookup_of<Lookup>(left, camera_, from_left);
  right_ = lookup_of<Lookup>(right, camera_, from_right);
}

GreyImage Rectifier::applied(const std::shared_ptr<const Lookup>& lookup, const GreyImage& raw) {
  if (!lookup) return raw;
  GreyImage result(lookup->whole.cols, lookup->whole.rows);
  cv::Mat out = view_of_pixels(result);
  // What the lens did not see is continued from the rim: no edge where there is none.
  cv::remap(view_of_pixels(raw), out, lookup->whole, lookup->fraction, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return result;
}

}  // namespace mapweave::visual
