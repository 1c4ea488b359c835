#pragma once
// Bundle adjustment of a few views and many points: Levenberg-Marquardt with the points eliminated (Schur complement;
// Triggs et al., Bundle Adjustment: A Modern Synthesis, 2000). Dense in the views, so for windows.

#include "pose_from_points.h"

namespace mapweave::visual {

struct WindowBundleObservation {
  int view = 0, point = 0;
  Sighting sighting;  // its point_in_map is not used
  bool fits = true;
};

struct WindowBundle {
  SensorCalibration calibration;
  std::vector<View> views;
  std::vector<char> fixed;  // of each view
  std::vector<Eigen::Vector3d> points;
  std::vector<char> fixed_points;                     // of each point; empty: none is
  std::vector<WindowBundleObservation> observations;  // sorted by point
};

// How far the calibration may change from what it was, and from none.
struct CalibrationPrior {
  double readout_step_s = 0.0, readout_s = 0.02;  // a step of 0: not learnt
  double inverse_depth_step = 0.0, inverse_depth = 0.0;
};

struct WindowBundleOptions {
  int most_steps = 6;
  double soft_sigmas = 2.0;
  double gate_sigmas = 4.0;
  CalibrationPrior prior;
};

// In place. Observations farther off than the gate at the end do not fit.
void adjust(WindowBundle& bundle, const Pinhole& camera, const WindowBundleOptions& options);

}  // namespace mapweave::visual
