#pragma once
// Bundle adjustment: cameras' poses and points that agree best with where the cameras saw them, of the window around a
// camera, a rig, or a team's maps. Levenberg-Marquardt, the points eliminated (Schur complement; Triggs et al., Bundle
// Adjustment: A Modern Synthesis, 2000), what is left sparse. Cold start, one thread, iteration budgets: the same input
// gives the same bytes.

#include <mapweave/core/pinhole.h>
#include <mapweave/core/view.h>

#include <cstdint>
#include <vector>

namespace mapweave::graph {

struct BundleView {
  View view;
  std::uint32_t camera = 0;
  bool fixed = false;
};

struct BundleSighting {
  std::uint32_t view = 0, point = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  // How the pixel moved with the camera while rows were read: pixels per second of readout.
  Eigen::Vector2d row_flow = Eigen::Vector2d::Zero();
  double sigma_px = 1.0;
  double inverse_depth = 0.0, inverse_depth_sigma = 0.0;  // 1/m, along the optical axis; with sigma 0 there is none
  bool fits = true;                                       // those that do not are left out
};

// What is known of two views beside what they see: a rigid rig, or how they lay before.
struct RelativePoseConstraint {
  std::uint32_t from = 0, to = 0;
  Pose3 from_from_to;
  double sigma_m = 0.01, sigma_rad = 0.01;
};

struct Bundle {
  std::vector<Pinhole> cameras;   // of any width and height: pixels may lie outside
  SensorCalibration calibration;  // of all of them
  std::vector<BundleView> views;
  std::vector<Eigen::Vector3d> points;
  std::vector<char> fixed_points;         // of each point; empty: none is
  std::vector<BundleSighting> sightings;  // by rising point
  std::vector<RelativePoseConstraint> relative_poses;
};

// Standard deviations of the calibration's change in one adjustment (step), and of its value. A step of 0: not
// estimated.
struct CalibrationPrior {
  double readout_step_s = 0.0, readout_s = 0.02;
  double inverse_depth_step = 0.0, inverse_depth = 0.0;  // 1/m
};

struct BundleOptions {
  int iterations = 15;
  double least_gain = 1e-5;         // share of the cost; an iteration that gains less is the last
  double soft_sigmas = 2.0;         // farther off, an error counts linearly (Huber)
  double gate_sigmas = 5.0;         // farther off at the end, a sighting does not fit
  bool gates_inverse_depth = true;  // or pixels alone
  CalibrationPrior prior;
};

struct BundleReport {
  double cost_before = 0.0, cost_after = 0.0;
  int iterations = 0;
};

// In place. Views that no fitting sighting or constraint connects to the others stay about where they are. Throws
// ContractViolation for sightings and constraints that name no view, camera or point, or are out of order.
BundleReport adjust(Bundle& bundle, const BundleOptions& options = {});

}  // namespace mapweave::graph
