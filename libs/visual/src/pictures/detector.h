#pragma once
// Corners spread evenly over a picture: the best of each cell, over several levels.

#include "pyramid.h"

#include <Eigen/Core>

namespace mapweave::visual {

struct Corner {
  Eigen::Vector2d pixel;  // of level 0
  int level = 0;
  double strength = 0.0;  // smaller eigenvalue of the gradients' covariance, grey^2 per pixel
};

struct DetectorOptions {
  int cell_px = 20;
  int threshold = 8;  // of the segment test, grey values
  double min_strength = 25;
  int levels = 3;
};

// One corner at most in each cell that `occupied` (of level-0 pixels) leaves free, in the order of cells.
std::vector<Corner> detect_corners(const Pyramid& pyramid, const std::vector<Eigen::Vector2d>& occupied,
                                   const DetectorOptions& options);

}  // namespace mapweave::visual
