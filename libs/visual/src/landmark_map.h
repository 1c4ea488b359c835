#pragma once
// What a client has mapped so far: keyframes, and the landmarks that they see.

#include "patch.h"
#include "pose_from_points.h"

#include <mapweave/core/stamp.h>
#include <mapweave/matching/orb_features.h>
#include <mapweave/visual/client_options.h>

namespace mapweave::visual {

// A landmark in one keyframe.
struct Observation {
  int keyframe = 0;
  Sighting sighting;  // its point is the landmark's
};

// How a landmark looked in a keyframe.
struct Appearance {
  Patch patch;
  Eigen::Vector2d pixel;
  int keyframe = 0;
};

struct Landmark {
  Eigen::Vector3d point;  // in the map
  std::vector<Observation> seen;
  std::vector<Appearance> appearances;
  int tried = 0, found = 0;  // looked for in frames
  bool gone = false;
};

struct Keyframe {
  Stamp stamp;
  View view;
  std::vector<int> landmarks;
  // What it is known again by, and how deep that lies (metres along the optical axis; 0 unknown).
  matching::OrbFeatures features;
  std::vector<float> depths;
};

// A landmark found in a frame.
struct Match {
  int landmark = 0;
  Eigen::Vector2d pixel;
  Eigen::Vector2d row_flow;
  int level = 0;
};

struct LandmarkMap {
  PinholeCamera camera;
  double baseline_m = 0.0;  // to the right camera; 0 without one
  SensorFlaws flaws;
  std::vector<Keyframe> keyframes;
  std::vector<Landmark> landmarks;

  Keyframe& keyframe(int number) { return keyframes[static_cast<std::size_t>(number)]; }
  const Keyframe& keyframe(int number) const { return keyframes[static_cast<std::size_t>(number)]; }
  Landmark& landmark(int number) { return landmarks[static_cast<std::size_t>(number)]; }
  const Landmark& landmark(int number) const { return landmarks[static_cast<std::size_t>(number)]; }
  Sighting sighting_of(const Match& match, double sigma_px) const {
    Sighting sighting;
    sighting.point_in_map = landmark(match.landmark).point;
    sighting.pixel = match.pixel, sighting.row_flow = match.row_flow, sighting.sigma_px = sigma_px * (1 << match.level);
    return sighting;
  }
};

}  // namespace mapweave::visual
