#pragma once
// The neighbourhood of a landmark as a keyframe saw it, found again in other pictures to a fraction of a pixel (inverse
// compositional alignment: Baker and Matthews, IJCV 2004; warped to the new view as in Forster et al., SVO, ICRA 2014).

#include "pyramid.h"

#include <Eigen/Core>
#include <array>
#include <optional>

namespace mapweave::visual {

inline constexpr int kPatchHalf = 14;  // of what is kept
inline constexpr int kPatchSize = 2 * kPatchHalf + 1;
inline constexpr int kAlignHalf = 4;  // of what is compared: 8 x 8
inline constexpr int kAlignSize = 2 * kAlignHalf;

struct Patch {
  std::array<std::uint8_t, kPatchSize * kPatchSize> pixels;
  int level = 0;
  Eigen::Vector2f offset =
      Eigen::Vector2f::Zero();  // of the landmark from the patch's middle pixel, pixels of its level
};

// nullopt too near to the border. `pixel` of level 0.
std::optional<Patch> cut_patch(const Pyramid& pyramid, const Eigen::Vector2d& pixel, int level);

// A patch as it would look at `level` of another view.
struct WarpedPatch {
  std::array<float, (kAlignSize + 2) * (kAlignSize + 2)> values;  // with a border of one pixel
  int level = 0;
};

// new_from_patch: derivative of level-0 pixels of the new view by level-0 pixels of the patch's. nullopt where the
// patch is too small for that.
std::optional<WarpedPatch> warp_patch(const Patch& patch, const Eigen::Matrix2d& new_from_patch);

struct PatchMatch {
  Eigen::Vector2d pixel;  // level 0
  float correlation = 0;  // zero-mean normalised, -1 to 1
};

// From `start` (level-0 pixels), at most `reach` pixels of its level away. nullopt where it does not come to rest
// inside the picture.
std::optional<PatchMatch> align_patch(const WarpedPatch& patch, const GreyImage& image, const Eigen::Vector2d& start,
                                      float reach);

// A patch as its own picture shows it.
WarpedPatch plain_patch(const Patch& patch);

// Along the row of `left` in the right picture of a rectified pair, for disparities within [low, high] (pixels of level
// 0): the disparity, to a fraction of a pixel. nullopt where nothing is alike, or two places are.
std::optional<double> find_disparity(const Patch& patch, const Eigen::Vector2d& left, const Pyramid& right, double low,
                                     double high);

}  // namespace mapweave::visual
