#pragma once
// Options of a camera client.

#include <mapweave/maps/map_noise.h>

#include <cstdint>

namespace mapweave::visual {

struct TrackingOptions {
  double sigma_px = kLandmarkSigma_px;
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
  double inverse_depth_sigma = kInverseDepthSigma_per_m;
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

// What keeps the map, and the work for each frame, from growing for ever.
struct MemoryOptions {
  int keyframes = 500;
  double redundant_share = 0.9;
  int redundant_views = 3;
  double found_share = 0.25;
  int frames = 500000;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("keyframes", keyframes, 20, 100000, "kept at most: those go first whose landmarks others see too");
    v.fraction("redundant_share", redundant_share, "a keyframe goes where others see so many of its landmarks");
    v.integer("redundant_views", redundant_views, 1, 100, "so many others, as finely as it does");
    v.fraction("found_share", found_share, "a landmark goes that is found less often than this where it is looked for");
    v.integer("frames", frames, 1000, 100000000, "of the trajectory, kept at most (40 bytes each): of more, every second one goes");
  }
};

struct LoopOptions {
  bool enabled = true;
  int witnesses = 3;
  double least_probability = 0.7;
  double drift = 0.03;
  double drift_m = 0.3;
  double delay_s = 0.5;
  bool wait = true;
  template <class Visitor>
  void describe(Visitor& v) {
    v.flag("enabled", enabled, "look for places that were seen before");
    v.integer("witnesses", witnesses, 1, 20, "keyframes that must say the same");
    v.fraction("least_probability", least_probability, "of a judgement that two keyframes show one place");
    v.positive("drift", drift, "share of the way from one to the other that they may be apart");
    v.positive("drift_m", drift_m, "and this much besides");
    v.number("delay_s", delay_s, 0.0, 60.0, "of data, from finding a loop until the map is straightened");
    v.flag("wait", wait, "straighten it then, whether or not that is computed yet; off: when it is, as live cameras do");
  }
};

struct SessionOptions {
  double patience_s = 5.0;
  int least_corners = 60;
  double carried_m_per_s = 1.0;
  double odometry_drift = 0.05;
  double alike_m = 4.0;
  bool await_place = false;
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("patience_s", patience_s, "of seeing something, lost, before a new map is begun");
    v.integer("least_corners", least_corners, 8, 10000, "a picture with fewer shows nothing");
    v.positive("carried_m_per_s", carried_m_per_s,
               "a lost camera may have come so far where there is no odometry: farther places look alike, no more");
    v.fraction("odometry_drift", odometry_drift, "share of the way, and of turns, that odometry may be wrong by; places beyond look alike");
    v.number(
        "alike_m", alike_m, 0.0, 1000.0,
        "between rooms that may look the same, at least: without odometry a lost camera is found again only where it cannot have come so "
        "far, and sessions are joined where places twice as far apart say the same; 0: no two places look the same");
    v.flag("await_place", await_place,
           "a camera alone begins no map by itself: it waits until it is told where it is, and its scale with that");
  }
};

struct ClientOptions {
  TrackingOptions tracking;
  KeyframeOptions keyframe;
  DepthOptions depth;
  WindowOptions window;
  MemoryOptions memory;
  LoopOptions loops;
  SessionOptions session;
  std::uint64_t seed = 1;  // of random choices: the run's
  template <class Visitor>
  void describe(Visitor& v) {
    v.section("tracking", tracking, "where each frame was taken");
    v.section("keyframe", keyframe, "which frames are kept");
    v.section("depth", depth, "depth cameras and stereo pairs");
    v.section("window", window, "local bundle adjustment");
    v.section("memory", memory, "what is kept of the map");
    v.section("loops", loops, "places seen before");
    v.section("session", session, "maps that begin anew where the camera is lost");
  }
};

}  // namespace mapweave::visual
