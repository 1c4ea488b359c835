#pragma once
// How far one robot's own map and its sightings may be off, for libraries that must agree on it: each of these numbers
// stands here alone.

#include <Eigen/Core>

namespace mapweave {

// A laser map, from one submap to the next. Scans are matched to walls in cells of 5 cm, which leaves half a cell and a
// little more however short the step is; what comes on top grows with the path. The search for loops and the merging of
// several robots' maps weigh the same chain of submaps, and so take it for equally stiff.
inline constexpr double kSubmapStep_m = 0.03;
inline constexpr double kPathDrift_per_m =
    0.02;  // of a path that bends one way all along; from one submap to the next: half of it
inline constexpr double kSubmapTurn_rad = 0.008;

// Standard deviation of where one submap lies to another, from which a loop between them may have been missed: there
// places that look alike are compared farther away than drift explains.
inline constexpr double kLittleKnown_m = 2.0;

inline Eigen::Matrix3d planar_information(double sigma_m, double sigma_rad) {
  return Eigen::Vector3d(1.0 / (sigma_m * sigma_m), 1.0 / (sigma_m * sigma_m), 1.0 / (sigma_rad * sigma_rad))
      .asDiagonal();
}

inline Eigen::Matrix3d submap_step_information(double length_m, double drift_per_m = kPathDrift_per_m,
                                               double turn_rad = kSubmapTurn_rad) {
  const double sigma_m = kSubmapStep_m + 0.5 * drift_per_m * length_m;
  return planar_information(sigma_m, turn_rad);
}

// How far a match of two submaps is off at least, however sharp their walls: added to the covariance of the match. Each
// stands for what is moved by the match.
// Submaps bend a little when the nodes in them move on their own. Where whole submaps are moved, each as one piece, no
// match of two of them, within a robot's map or between robots', is stiffer than 5 cm and 5 mrad.
inline Eigen::Matrix3d submap_bend_covariance() { return Eigen::Vector3d(2.5e-3, 2.5e-3, 2.5e-5).asDiagonal(); }
// Where every node moves on its own, and the match holds the anchors of the submaps, what bends is in the graph itself:
// these are stiffer. A robot's own loop: 2 cm and 3 mrad, what the anchors of two submaps are known to at best. Between
// two robots' maps, each of which was optimised before by itself: 3 cm and 3 mrad.
inline Eigen::Matrix3d own_anchors_covariance() { return Eigen::Vector3d(4e-4, 4e-4, 9e-6).asDiagonal(); }
inline Eigen::Matrix3d team_anchors_covariance() { return Eigen::Vector3d(9e-4, 9e-4, 9e-6).asDiagonal(); }
// Where matches all over two maps together say how one whole map lies in the other, they share the errors of the maps,
// however many agree: 2 cm and 1.7 mrad.
inline Eigen::Matrix3d alignment_covariance() { return Eigen::Vector3d(4e-4, 4e-4, 3e-6).asDiagonal(); }

// A camera's map, from one keyframe to a covisible one: millimetres that each keyframe is off by itself, and a share of
// the motion. The graph of one robot's cameras and that of a team move the same keyframes against each other.
struct CovisibleMotionNoise {
  double sigma_m = 0.006, sigma_per_m = 0.015, sigma_rad = 0.003;
  int least_shared = 15;  // landmarks: fewer hold two keyframes badly
};
inline constexpr CovisibleMotionNoise kCovisibleMotion{};

// Sightings of landmarks, in the bundle adjustment of one camera's map and in that of merged maps.
inline constexpr double kLandmarkSigma_px = 0.5;
inline constexpr double kInverseDepthSigma_per_m =
    0.004;  // a sixth of a pixel of a structured light camera (580 px, baseline 7.5 cm)

}  // namespace mapweave
