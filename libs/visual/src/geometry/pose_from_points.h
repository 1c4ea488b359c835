#pragma once
// Where the camera is, given points of the map and where it sees them.

#include <mapweave/core/pinhole.h>
#include <mapweave/core/view.h>

#include <limits>
#include <vector>

namespace mapweave::visual {

struct Sighting {
  Eigen::Vector3d point_in_map = Eigen::Vector3d::Zero();
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Vector2d row_flow = Eigen::Vector2d::Zero();  // how the pixel moved with the camera while rows were read:
                                                       // pixels per second of readout
  double sigma_px = 1.0;
  double inverse_depth = 0.0;  // measured; with sigma 0 there is none
  double inverse_depth_sigma = 0.0;
  Eigen::Vector2d slack_px =
      Eigen::Vector2d::Zero();  // motion of the pixel where the point lies farther by one sigma of its distance
};

struct PoseFromPoints {
  View view;
  std::vector<char> fits;  // of each sighting
  int count = 0;           // of those that fit
  double rms_sigma = 0.0;  // of those that fit
};

// Gauss-Newton from `guess`, robustly; sightings farther off than `gate` sigmas at the end do not fit. Those farther
// off than `first_gate` from the guess have no say at first.
PoseFromPoints pose_from_points(const std::vector<Sighting>& sightings, const Pinhole& camera, const View& guess,
                                const SensorCalibration& calibration, double gate,
                                double first_gate = std::numeric_limits<double>::infinity());

// Residuals of one sighting and their derivative by a small motion of the camera (translation, rotation; from the
// left). Third row: inverse depth.
struct Residual {
  Eigen::Vector3d value;  // in sigmas
  Eigen::Matrix<double, 3, 6> by_motion;
  Eigen::Matrix3d by_point;  // of the point in the camera's frame
};
bool residual_of(const Sighting& sighting, const Eigen::Vector3d& point_in_camera, const Pinhole& camera,
                 const SensorCalibration& calibration, Residual& out);

}  // namespace mapweave::visual
