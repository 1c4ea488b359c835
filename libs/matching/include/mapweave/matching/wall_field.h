#pragma once
// Where the walls of a submap are, for matching scans against it: a likelihood raster for searching and local normal
// distributions for refining (as NDT: Biber and Strasser, IROS 2003; here a distribution is of 3 x 3 cells, so that
// neighbours overlap).

#include <mapweave/core/geometry.h>
#include <mapweave/matching/raster.h>
#include <mapweave/matching/wall_point.h>

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

namespace mapweave::matching {

// One local distribution of wall points: residual = whitening * (point - mean).
struct LocalNormal {
  float mean_x = 0, mean_y = 0;
  float w00 = 0, w10 = 0, w11 = 0;   // lower triangular square root of the information, 1/m
  float normal_x = 0, normal_y = 0;  // unit; across the wall, to the side it was seen from
  float flatness = 0;                // 1: a straight line, 0: round
};

// The two faces of a wall are two walls: a distribution holds points seen from one side only, so that a scan from the
// other room is not pulled by the wall's thickness.
class WallField {
 public:
  static constexpr double kResolution = 0.05;  // of the likelihood
  static constexpr double kCellSide = 0.10;    // of the distributions

  // Adds points given in the field's frame. The likelihood holds them at once, the distributions after settle().
  void add(const std::vector<WallPoint>& points_in_field);
  // Room for points up to there at once; what is added beyond makes its own.
  void reserve(double low_x, double low_y, double high_x, double high_y);
  void settle();

  // 0..255: how near a wall is, whichever its side; 255 on one.
  const Raster<std::uint8_t>& likelihood() const { return likelihood_; }
  // The distribution around a place of walls that face as the given normal does (within 45 degrees at least, 135 at
  // most), or nullptr where there are too few points. Valid until the next settle().
  const LocalNormal* normal_at(double x, double y, double normal_x, double normal_y) const;
  // Mean wall points with at least `min_count` hits, at most two a cell (faces), in a canonical order.
  std::vector<WallPoint> walls(float min_count) const;

 private:
  friend class SparseWallField;
  struct Sums {
    float n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;  // relative to the cell's centre
    void add(const Sums& s, float offset_x, float offset_y);
  };
  // By the quadrant that the points' normals lie in. Two neighbouring quadrants make a side.
  struct Cell {
    std::array<Sums, 4> quadrants;
    bool touched = false;  // since the last settle()
  };
  struct Sides {
    std::array<std::int32_t, 4> normals{-1, -1, -1, -1};  // indices
    std::uint32_t settled = 0;                            // the call of settle() that last changed it
  };
  void update(int cell_x, int cell_y, Sides& sides);
  Raster<std::uint8_t> likelihood_;
  Raster<std::int32_t> cell_index_;  // -1: none
  std::vector<Cell> cells_;
  Raster<std::int32_t> sides_index_;  // -1: none
  std::vector<Sides> sides_;
  std::vector<LocalNormal> normals_;
  std::vector<std::pair<int, int>> touched_;
  std::uint32_t settlings_ = 0;
};

// A field to which nothing is added any more, in about a third of the room.
class SparseWallField {
 public:
  SparseWallField() = default;
  explicit SparseWallField(const WallField& settled);

  const SparseRaster<std::uint8_t>& likelihood() const { return likelihood_; }  // as WallField::likelihood()
  // As WallField::normal_at(); valid as long as the field.
  const LocalNormal* normal_at(double x, double y, double normal_x, double normal_y) const;
  std::size_t bytes() const;

 private:
  SparseRaster<std::uint8_t> likelihood_;
  SparseRaster<std::int32_t> sides_;  // of a cell: its first normal * 16 + a bit for each side that has one
  std::vector<LocalNormal> normals_;
};

}  // namespace mapweave::matching
