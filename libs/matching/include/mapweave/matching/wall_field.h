#pragma once
// Where the walls of a submap are, for matching scans against it: a likelihood raster for searching and local normal
// distributions for refining (as NDT: Biber and Strasser, IROS 2003; here a distribution is of 3 x 3 cells, so that neighbours overlap).

#include <mapweave/core/geometry.h>
#include <mapweave/matching/raster.h>

#include <cstdint>
#include <vector>

namespace mapweave::matching {

struct Point2f {
  float x, y;  // metres
};

// One local distribution of wall points: residual = whitening * (point - mean).
struct LocalNormal {
  float mean_x = 0, mean_y = 0;
  float w00 = 0, w10 = 0, w11 = 0;  // lower triangular square root of the information, 1/m
  float normal_x = 0, normal_y = 0; // unit; across the wall, sign arbitrary
  float flatness = 0;               // 1: a straight line, 0: round
};

class WallField {
 public:
  static constexpr double kResolution = 0.05;      // of the likelihood
  static constexpr double kCellSide = 0.10;        // of the distributions

  // Adds points given in the field's frame.
  void add(const std::vector<Point2f>& points_in_field);

  // 0..255: how near a wall is; 255 on one.
  const Raster<std::uint8_t>& likelihood() const { return likelihood_; }
  // The distribution around a point, or nullptr where there are too few wall points. Valid until the next add().
  const LocalNormal* normal_at(double x, double y) const;
  // Mean wall points, one a cell with at least `min_count` hits, in a canonical order.
  struct WallCell {
    Point2f mean;
    LocalNormal normal;
    float count;
  };
  std::vector<WallCell> wall_cells(float min_count) const;
  std::size_t bytes() const;

 private:
  struct Sums {
    float n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;  // relative to the cell's centre
  };
  struct Distribution {
    LocalNormal normal;
    std::uint32_t addition = 0;  // the call of add() that last changed it
    bool valid = false;          // enough points
  };
  void update(int cell_x, int cell_y, Distribution& distribution) const;
  Raster<std::uint8_t> likelihood_;
  Raster<std::int32_t> sums_index_;    // -1: none
  std::vector<Sums> sums_;
  Raster<std::int32_t> normal_index_;  // -1: none
  std::vector<Distribution> normals_;
  std::uint32_t additions_ = 0;
};

}  // namespace mapweave::matching
