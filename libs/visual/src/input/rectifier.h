#pragma once
// Pictures of real lenses become pictures of pinhole cameras; those of a stereo pair with rows that meet.

#include <mapweave/core/geometry.h>
#include <mapweave/visual/frame.h>

#include <memory>

namespace mapweave::visual {

struct LensCalibration {
  Pinhole camera;
  Distortion distortion;
};

// Immutable. A picture without distortion that needs no turning is copied as it is.
class Rectifier {
 public:
  explicit Rectifier(const LensCalibration& lens);
  // left_from_right: of the right camera's optical frame. Both pictures of one size (contract).
  Rectifier(const LensCalibration& left, const LensCalibration& right, const Pose3& left_from_right);

  const Pinhole& camera() const { return camera_; }  // of the rectified pictures
  double baseline_m() const { return baseline_m_; }  // 0 of a single camera
  const Pose3& left_from_rectified() const { return left_from_rectified_; }
  GreyImage left(const GreyImage& raw) const { return applied(left_, raw); }
  GreyImage right(const GreyImage& raw) const { return applied(right_, raw); }

 private:
  struct Lookup;
  static GreyImage applied(const std::shared_ptr<const Lookup>& lookup, const GreyImage& raw);
  Pinhole camera_;
  double baseline_m_ = 0.0;
  Pose3 left_from_rectified_;
  std::shared_ptr<const Lookup> left_, right_;  // null: as it is
};

}  // namespace mapweave::visual
