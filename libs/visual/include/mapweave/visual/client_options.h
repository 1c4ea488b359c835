#pragma once
// Options of a camera client.

#include <cstdint>

namespace mapweave::visual {

struct TrackingOptions {
  double sigma_px = 0.5;
  double reach_px = 5.0;
  double min_correlation = 0.85;
  int cell_px = 20;
  int near_keyframes = 20;
  int least_landmarks = 30;
  double gate_sigmas = 4.0;
  int features = 500;
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("sigma_px", sigma_px, "error of a landmark's place in the full picture");
    v.positive("reach_px", reach_px, "a landmark is looked for this far from where it is expected, pixels of its pyramid level");
    v.fraction("min_correlation", min_correlation, "of a landmark's patch with the picture, to be taken for seen");
    v.integer("cell_px", cell_px, 8, 200, "side of the cells of the picture that hold one landmark each");
    v.integer("near_keyframes", near_keyframes, 1, 1000, "keyframes whose landmarks are looked for");
    v.integer("least_landmarks", least_landmarks, 8, 1000, "with fewer the camera is lost");
    v.positive("gate_sigmas", gate_sigmas, "sightings farther off than this are wrong");
    v.integer("features", features, 50, 10000, "of a keyframe, to be known again by");
  }
};

struct KeyframeOptions {
  double kept_share = 0.7;
  double turn_rad = 0.3;
  double parallax = 0.1;
  template <class Visitor>
  void describe(Visitor& v) {
    v.fraction("kept_share", kept_share, "a keyframe is made when fewer of the last one's landmarks are left");
    v.positive("turn_rad", turn_rad, "or after turning so far");
    v.positive("parallax", parallax, "or after moving so far, in units of the landmarks' middle distance");
  }
};

struct DepthOptions {
  double inverse_depth_sigma = 0.004;
  double max_depth_m = 8.0;
  double min_depth_m = 0.2;
  double max_disparity = 0.25;
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("inverse_depth_sigma", inverse_depth_sigma,
               "error of a depth camera, in inverse metres: its error grows with the square of the depth");
    v.positive("max_depth_m", max_depth_m, "farther readings of a depth camera are left out");
    v.positive("min_depth_m", min_depth_m, "nearer ones too");
    v.fraction("max_disparity", max_disparity, "of a stereo pair, in widths of the picture");
  }
};

struct WindowOptions {
  int keyframes = 8;
  int fixed_keyframes = 12;
  int steps = 5;
  bool learn_readout = true;
  bool learn_depth_offset = true;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("keyframes", keyframes, 2, 100, "that local bundle adjustment moves");
    v.integer("fixed_keyframes", fixed_keyframes, 0, 100, "and that hold them");
    v.integer("steps", steps, 1, 100, "of each local bundle adjustment");
    v.flag("learn_readout", learn_readout,
           "learn how long the sensor takes to read a picture from the first row to the last (rolling shutter)");
    v.flag("learn_depth_offset", learn_depth_offset, "learn a constant error of disparities");
  }
};

struct ClientOptions {
  TrackingOptions tracking;
  KeyframeOptions keyframe;
  DepthOptions depth;
  WindowOptions window;
  template <class Visitor>
  void describe(Visitor& v) {
    v.section("tracking", tracking, "where each frame was taken");
    v.section("keyframe", keyframe, "which frames are kept");
    v.section("depth", depth, "depth cameras and stereo pairs");
    v.section("window", window, "local bundle adjustment");
  }
};

}  // namespace mapweave::visual
