#pragma once
// How do two sides (two keyframes with their neighbours, or a map and one picture) lie, given features that may be the
// same thing, many of them wrongly? Hypotheses from the fewest matches, counted by reprojection in the pictures of both
// sides (RANSAC: Fischler, Bolles, CACM 24(6), 1981), then nonlinear least squares.

#include <mapweave/core/geometry.h>
#include <mapweave/core/pinhole.h>
#include <mapweave/matching/rigid_from_points.h>

#include <optional>
#include <vector>

namespace mapweave::matching {

struct CameraPlace {
  Pinhole pinhole;
  Pose3 side_from_camera;
};

// A feature of side a and one of side b that may be the same thing. A point that a knows counts in b's picture, and the
// other way round.
struct FeaturePair {
  std::uint32_t camera_a = 0, camera_b = 0;  // index into the cameras of the side
  Eigen::Vector2d pixel_a, pixel_b;
  double sigma_a_px = 1.0, sigma_b_px = 1.0;
  std::optional<Eigen::Vector3d> point_in_a, point_in_b;  // frames of the sides
};

struct AlignmentProblem {
  std::vector<CameraPlace> cameras_a, cameras_b;
  std::vector<FeaturePair> pairs;
  Freedom freedom = Freedom::rigid;  // similarity where a side does not know its scale
};

struct AlignmentOptions {
  int iterations = 400;
  double confidence = 0.9999;
  int refinements = 10;
  std::uint64_t seed = 1;
  int least_inliers = 8;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("iterations", iterations, 1, 1000000,
              "most samples that RANSAC draws for one alignment of two keyframes; larger values align more pairs and "
              "take longer");
    v.fraction("confidence", confidence,
               "RANSAC ends early once it has drawn a sample without outliers with this probability; larger values "
               "draw more samples");
    v.integer("refinements", refinements, 1, 1000,
              "most least-squares steps that refine an alignment found by RANSAC; larger values are slower and change "
              "nothing once it has converged");
    v.integer("seed", seed, 0, 4294967295,
              "seed of the random samples that RANSAC draws; the same seed gives the same alignment");
    v.integer("least_inliers", least_inliers, 4, 100000,
              "least number of matches that must agree for RANSAC to return an alignment at all; larger values return "
              "fewer alignments");
  }
};

struct AlignmentFit {
  Sim3 a_from_b;
  // Of a small motion of b in b's frame: x, y, z, roll, pitch, yaw, logarithm of the scale (zero for a rigid one). From
  // the spread of the residuals where that is wider than the sigmas.
  Eigen::Matrix<double, 7, 7> covariance = Eigen::Matrix<double, 7, 7>::Zero();
  std::vector<std::uint32_t> inliers;  // rising; each within 95 % of its sigmas in every picture that tests it
  double rms_sigma = 0.0;              // of the inliers' residuals, in sigmas; 1 as expected
  int iterations = 0;                  // samples drawn
};

// The alignment that most pairs agree with. The same input gives the same answer, to the bit. nullopt where fewer than
// `least_inliers` agree or where they leave a direction open.
std::optional<AlignmentFit> search_alignment(const AlignmentProblem&, const AlignmentOptions& = {});

// From a guess: least squares over the pairs that agree with it (Geman-McClure's weights), and these are found anew
// after each step. nullopt as above.
std::optional<AlignmentFit> refine_alignment(const AlignmentProblem&, const Sim3& a_from_b,
                                             const AlignmentOptions& = {});

}  // namespace mapweave::matching
