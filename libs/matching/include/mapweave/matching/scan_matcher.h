#pragma once
// Aligns one scan to a wall field near a guess: correlative search in a window (Olson, ICRA 2009), then Gauss-Newton on
// the local normal distributions with the guess as a prior.

#include <mapweave/core/geometry.h>
#include <mapweave/matching/wall_field.h>

#include <optional>
#include <vector>

namespace mapweave::matching {

struct SearchWindow {
  double radius_m = 0.4;
  double yaw_rad = 0.21;  // either way
  double yaw_step_rad = 0.00873;
};

// How far the guess is trusted: standard deviations, in the scan's frame.
struct PriorWeight {
  double sigma_m = 0.1;
  double sigma_yaw_rad = 0.05;
  double gate = 9.0;  // squared sigmas from which the prior gives way (refine only)
};

struct ScanMatch {
  Pose2 field_from_scan;
  double score = 0.0;    // mean likelihood under the points, 0..1
  double inliers = 0.0;  // share of points that found a wall's distribution and lie within 3 sigma of it
  Eigen::Matrix3d information =
      Eigen::Matrix3d::Zero();  // of the points alone, without the prior: x, y, yaw in the scan's frame
  bool at_border = false;       // the search ended at the rim of its window
};

// The best pose of the window; nullopt when the field or the scan is empty. `weight` pulls ties towards the guess.
struct Correlation {
  Pose2 field_from_scan;
  double score = 0.0;
  bool at_border = false;
};
// `likelihood`: of a wall field.
std::optional<Correlation> correlate(const Raster<std::uint8_t>& likelihood,
                                     const std::vector<WallPoint>& points_in_scan, const Pose2& field_from_scan_guess,
                                     const SearchWindow&, const PriorWeight& weight);

// Refines a pose that is within about 0.15 m and 2 degrees of the answer. `prior` (may be null) pulls towards
// `field_from_scan_prior`.
ScanMatch refine(const WallField&, const std::vector<WallPoint>& points_in_scan, const Pose2& field_from_scan_start,
                 const Pose2& field_from_scan_prior, const PriorWeight* prior, int iterations = 12);
ScanMatch refine(const SparseWallField&, const std::vector<WallPoint>& points_in_scan,
                 const Pose2& field_from_scan_start, const Pose2& field_from_scan_prior, const PriorWeight* prior,
                 int iterations = 12);

}  // namespace mapweave::matching
