#pragma once
// Lenses of Kannala and Brandt's model, which ROS calls equidistant: everything above this library knows pictures of
// straight lines, with little distortion. J. Kannala, S. Brandt: A generic camera model and calibration method for
// conventional, wide-angle, and fish-eye lenses. PAMI 2006.

#include <mrpt/img/CImage.h>
#include <mrpt/img/TCamera.h>

#include <array>
#include <memory>

namespace mapweave::rawlog::ros {

class FisheyeLens {
 public:
  // camera: focal lengths, centre and size; its distortion is not used. k: of the angle's powers 3, 5, 7, 9.
  // Throws Error kBadInput where the numbers make no sense.
  FisheyeLens(const mrpt::img::TCamera& camera, const std::array<double, 4>& k);

  bool is_of(const mrpt::img::TCamera& camera, const std::array<double, 4>& k) const;
  // The picture that a lens without distortion would have taken, of the same focal lengths, centre and size: less of
  // the view. A picture of another size than the camera's is left as it is.
  void rectify(mrpt::img::CImage& image);
  // Across and down, of what remains.
  std::array<double, 2> view_deg() const;

 private:
  struct Maps;
  mrpt::img::TCamera camera_;
  std::array<double, 4> k_;
  std::shared_ptr<const Maps> maps_;  // null before the first picture
};

}  // namespace mapweave::rawlog::ros
