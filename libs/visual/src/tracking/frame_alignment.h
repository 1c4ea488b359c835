#pragma once
// How the camera moved between two pictures, from the grey values around points of known depth (sparse image alignment:
// Forster et al., SVO, ICRA 2014, section IV-A; here coarse to fine, with gain and bias between the pictures).

#include "pictures/pyramid.h"

#include <mapweave/core/view.h>

namespace mapweave::visual {

struct FrameAlignment {
  View to_from_from;
  int points = 0;         // in both pictures, at the finest level
  float residual = 0.0F;  // root mean square, grey values
};

// What a picture shows, of known depth.
struct ShownPoints {
  std::vector<Eigen::Vector2d> pixels;  // level 0
  std::vector<Eigen::Vector3d> points;  // in the picture's camera frame
};

// `shown` by the picture `from`. finest: the pyramid's level at which it ends.
FrameAlignment align_frames(const Pyramid& from, const ShownPoints& shown, const Pyramid& to, const Pinhole& camera,
                            const View& guess, int finest = 2);

}  // namespace mapweave::visual
