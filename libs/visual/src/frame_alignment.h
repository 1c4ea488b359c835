#pragma once
// How the camera moved between two pictures, from the grey values around points of known depth (sparse image alignment:
// Forster et al., SVO, ICRA 2014, section IV-A; here coarse to fine, with gain and bias between the pictures).

#include "pyramid.h"

#include <mapweave/core/view.h>

namespace mapweave::visual {

struct FrameAlignment {
  View to_from_from;
  int points = 0;         // in both pictures, at the finest level
  float residual = 0.0F;  // root mean square, grey values
};

// points_in_from: in the camera frame of `from`, which shows them at pixels (level 0).
FrameAlignment align_frames(const Pyramid& from, const std::vector<Eigen::Vector2d>& pixels,
                            const std::vector<Eigen::Vector3d>& points_in_from, const Pyramid& to,
                            const Pinhole& camera, const View& guess, int coarsest, int finest);

}  // namespace mapweave::visual
