#pragma once
// Finds the wall face nearest to a place among those that look the same way.

#include <mapweave/matching/wall_point.h>

#include <optional>
#include <vector>

namespace mapweave::fusion {

class FaceIndex {
 public:
  explicit FaceIndex(const std::vector<matching::WallPoint>& faces);
  struct Match {
    matching::WallPoint face;
    double distance_m;
  };
  // Normals differ by no more than acos(least_cosine).
  std::optional<Match> nearest(const matching::WallPoint& face, double within_m, double least_cosine) const;

 private:
  double x0_m_ = 0.0, y0_m_ = 0.0;
  int columns_ = 0, rows_ = 0;
  std::vector<std::uint32_t> first_;  // of each bin, in faces_; one more at the end
  std::vector<matching::WallPoint> faces_;
};

}  // namespace mapweave::fusion
