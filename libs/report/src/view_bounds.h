#pragma once
// What a page shows of a map at first.

#include "encoding.h"
#include "grid_levels.h"

#include <algorithm>
#include <limits>

namespace mapweave::report {

struct ViewBounds {  // metres
  double low_x = std::numeric_limits<double>::infinity(), low_y = low_x, high_x = -low_x, high_y = -low_x;
  void add(double x, double y) {
    low_x = std::min(low_x, x);
    low_y = std::min(low_y, y);
    high_x = std::max(high_x, x);
    high_y = std::max(high_y, y);
  }
  void add(const DrawnGrid& grid) {
    add(grid.low_x, grid.low_y);
    add(grid.high_x, grid.high_y);
  }
  // [x0, y0, x1, y1]; around the origin where nothing is known.
  Json json() const {
    if (low_x > high_x) return {-1, -1, 1, 1};
    return {rounded(low_x, 2), rounded(low_y, 2), rounded(high_x, 2), rounded(high_y, 2)};
  }
};

}  // namespace mapweave::report
