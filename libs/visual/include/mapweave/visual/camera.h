#pragma once
// What a picture differs by from one of a pinhole camera.

#include <mapweave/core/pinhole.h>

namespace mapweave::visual {

// Radial-tangential, on the plane z = 1: Brown's model in the order of OpenCV.
struct Distortion {
  double k1 = 0.0, k2 = 0.0, p1 = 0.0, p2 = 0.0, k3 = 0.0;
  bool is_none() const { return k1 == 0.0 && k2 == 0.0 && p1 == 0.0 && p2 == 0.0 && k3 == 0.0; }
  Eigen::Vector2d distorted(const Eigen::Vector2d& ideal) const {
    const double x = ideal.x(), y = ideal.y(), r2 = x * x + y * y;
    const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    return {x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y};
  }
};

}  // namespace mapweave::visual
