#pragma once
// How two pictures of one camera lie to each other, from points that both show, without knowing how far any is (Hartley
// and Zisserman: Multiple View Geometry, 2004, chapters 9, 11 and 13).

#include "geometry/pose_from_points.h"

#include <optional>

namespace mapweave::visual {

struct PixelPair {
  Eigen::Vector2d first, second;
  double sigma_px = 1.0;  // in either
};

struct TwoViewOptions {
  double gate_sigmas = 3.0;
  double least_share = 0.75;         // of the pairs, that agree
  int least_pairs = 40;              // that agree
  double least_parallax_rad = 0.02;  // middle angle between the two rays to a point
  double distinct = 0.85;            // another way to lie must leave fewer pairs than this share
};

struct TwoViews {
  View second_from_first;               // its translation has length 1
  std::vector<Eigen::Vector3d> points;  // of each pair, in the first camera's frame; where it fits
  std::vector<char> fits;
  int count = 0;  // of those that fit
  double parallax_rad = 0.0;
};

// Motions are proposed by an essential matrix, which planes deceive, and by a homography, which depth does (both by
// OpenCV: MAGSAC++, Barath et al., CVPR 2020; decompositions of Nister 2004, Malis and Vargas 2007); all of them are
// then refined by bundle adjustment and judged alike, by pairs that fit and lie in front of both cameras. nullopt where
// parallax is too small or where two of them explain the pairs: a plane may be seen in two ways. The same input gives
// the same answer, to the bit.
std::optional<TwoViews> relate_views(const std::vector<PixelPair>& pairs, const Pinhole& camera,
                                     const TwoViewOptions& options);

// What two rays (any length; the second's frame is reached by second_from_first) meet in, in the first's frame, by
// least squares of angles' sines. nullopt where they run apart, or together without parallax.
std::optional<Eigen::Vector3d> meet(const Eigen::Vector3d& ray_in_first, const Eigen::Vector3d& ray_in_second,
                                    const View& second_from_first);

}  // namespace mapweave::visual
