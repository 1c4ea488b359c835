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
    v.positive("sigma_px", sigma_px,
               "standard deviation in pixels of where a landmark is seen in the full picture; larger values trust "
               "single sightings less");
    v.positive("reach_px", reach_px,
               "radius in pixels, on the landmark's pyramid level, around its predicted position in which it is "
               "searched for; larger "
               "values follow faster motion and take longer");
    v.fraction("min_correlation", min_correlation,
               "least correlation of a landmark's patch with the picture to count as seen; larger values track fewer "
               "landmarks with "
               "fewer mistakes");
    v.integer("cell_px", cell_px, 8, 200,
              "side in pixels of the cells of the picture that hold one landmark each; larger values track fewer "
              "landmarks and are faster");
    v.integer("near_keyframes", near_keyframes, 1, 1000,
              "number of covisible keyframes whose landmarks are projected into each frame; larger values track more "
              "landmarks and take "
              "longer");
    v.integer("least_landmarks", least_landmarks, 8, 1000,
              "number of tracked landmarks below which the camera counts as lost; half of it suffices while it is "
              "followed from frame to frame; larger values lose it sooner and err less");
    v.positive("gate_sigmas", gate_sigmas,
               "a sighting farther from its prediction than this many standard deviations is rejected as an outlier; "
               "larger values keep more sightings, also wrong ones");
    v.integer("features", features, 50, 10000,
              "number of ORB features extracted from each keyframe, by which its place is recognised later; larger "
              "values recognise more places and need more memory");
  }
};

struct KeyframeOptions {
  double kept_share = 0.7;
  double turn_rad = 0.3;
  double parallax = 0.1;
  template <class Visitor>
  void describe(Visitor& v) {
    v.fraction("kept_share", kept_share,
               "a new keyframe is made when fewer than this share of the last keyframe's landmarks are still tracked; "
               "larger values make "
               "more keyframes");
    v.positive("turn_rad", turn_rad,
               "a new keyframe is made after the camera turned by this angle in radians since the last one; larger "
               "values make fewer keyframes");
    v.positive("parallax", parallax,
               "a new keyframe is made after the camera moved by this share of the landmarks' median distance since "
               "the last one; larger values make fewer keyframes");
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
               "standard deviation of a depth camera's inverse depth in 1/m; constant, because the error of a depth "
               "grows with its square; larger values trust depths less");
    v.positive("max_depth_m", max_depth_m,
               "readings of a depth camera beyond this distance in metres are ignored; larger values use more "
               "readings, which are less accurate far away");
    v.positive(
        "min_depth_m", min_depth_m,
        "readings of a depth camera below this distance in metres are ignored; larger values ignore more readings");
    v.fraction("max_disparity", max_disparity,
               "largest disparity of a stereo pair that is searched, as a share of the picture's width; larger values "
               "see nearer things "
               "and take longer");
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
    v.integer("keyframes", keyframes, 2, 100,
              "number of keyframes that local bundle adjustment moves; larger values are more accurate and slower");
    v.integer("fixed_keyframes", fixed_keyframes, 0, 100,
              "number of keyframes around the window that local bundle adjustment holds fixed, so that the window does "
              "not drift against them; larger values are slower and drift less");
    v.integer("steps", steps, 1, 100,
              "most solver steps of each local bundle adjustment; larger values are more accurate and slower");
    v.flag("learn_readout", learn_readout,
           "estimate how long the camera takes to read a picture from its first row to its last (rolling shutter) and "
           "correct for it");
    v.flag("learn_depth_offset", learn_depth_offset,
           "estimate a constant error of the inverse depths (disparities) of a depth camera or stereo pair and correct "
           "for it");
  }
};

// What keeps the map, and the work for each frame, from growing for ever.
struct MemoryOptions {
  int keyframes = 500;
  double redundant_share = 0.9;
  int redundant_views = 3;
  double found_share = 0.25;
  int frames = 500000;
  int shared_keyframes = 300;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("keyframes", keyframes, 20, 100000,
              "most keyframes in a robot's map; beyond it, those are removed whose landmarks other keyframes see too; "
              "larger values keep more detail and need more memory");
    v.fraction("redundant_share", redundant_share,
               "a keyframe is removed where this share of its landmarks is seen by enough other keyframes; larger "
               "values keep more keyframes");
    v.integer("redundant_views", redundant_views, 1, 100,
              "number of other keyframes that must see a landmark as finely as a keyframe does for the landmark to "
              "count as redundant there; larger values keep more keyframes");
    v.fraction("found_share", found_share,
               "a landmark is removed when it is found in fewer than this share of the frames in which it was searched "
               "for; larger values remove more landmarks");
    v.integer("frames", frames, 1000, 100000000,
              "most frames of the trajectory that are kept, at 40 bytes each; beyond it every second one is dropped; "
              "larger values keep denser trajectories of long runs");
    v.integer("shared_keyframes", shared_keyframes, 1, 100000,
              "most keyframes of other robots that a client keeps where its server shares them (server.share=global); "
              "beyond it, those farthest from the camera are dropped; larger values go on longer without the server "
              "and need more memory, about 40 kB each");
  }
};

struct VisualLoopOptions {
  bool enabled = true;
  int agreeing_keyframes = 3;
  double least_probability = 0.7;
  double drift = 0.03;
  double drift_m = 0.3;
  double delay_s = 0.5;
  bool wait = true;
  template <class Visitor>
  void describe(Visitor& v) {
    v.flag("enabled", enabled,
           "search for loop closures of a camera's map; false: drift stays, and sessions are not joined");
    v.integer(
        "agreeing_keyframes", agreeing_keyframes, 1, 20,
        "number of keyframes that must agree on a loop closure for it to be believed; larger values close fewer loops");
    v.fraction("least_probability", least_probability,
               "least probability that two keyframes show one place to count for a loop closure; larger values close "
               "fewer loops");
    v.positive("drift", drift,
               "drift that a loop closure may correct, in metres per metre of path since the place was seen; larger "
               "values accept loops "
               "after worse drift");
    v.positive("drift_m", drift_m,
               "drift in metres that a loop closure may correct whatever the length of the path; larger values accept "
               "loops after worse drift");
    v.number("delay_s", delay_s, 0.0, 60.0,
             "recorded time in seconds from detecting a loop closure until its correction is applied; fixed, so that "
             "results do not depend on computing time; larger values correct later and leave more time to compute");
    v.flag("wait", wait,
           "apply a loop correction exactly delay_s after its detection, waiting for the computation if needed; "
           "false: as soon as it is "
           "computed, which is not repeatable");
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
    v.positive("patience_s", patience_s,
               "time in seconds for which a lost camera that sees something tries to relocalise before it begins a new "
               "map; larger values begin fewer maps");
    v.integer("least_corners", least_corners, 8, 10000,
              "number of corners below which a picture counts as showing nothing, as in a cupboard or with a covered "
              "lens; larger values make more pictures count as empty");
    v.positive("carried_m_per_s", carried_m_per_s,
               "largest speed in metres per second at which a lost camera without odometry may have been moved; "
               "relocalisation "
               "farther away is refused as a look-alike; larger values relocalise more often, also wrongly");
    v.fraction("odometry_drift", odometry_drift,
               "error of odometry as a share of motion and of turns while the camera is lost; relocalisation outside "
               "what it allows is refused as a look-alike; larger values relocalise more often, also wrongly");
    v.number("alike_m", alike_m, 0.0, 1000.0,
             "distance in metres below which two different places are assumed not to look alike, for cameras without "
             "odometry; larger values relocalise lost cameras more readily, but connect sessions only where places "
             "twice as far apart agree; 0: no two places look alike");
    v.flag("await_place", await_place,
           "a monocular camera begins no map of its own, but waits until the server sends it its pose, and thereby its "
           "scale");
  }
};

struct ClientOptions {
  TrackingOptions tracking;
  KeyframeOptions keyframe;
  DepthOptions depth;
  WindowOptions window;
  MemoryOptions memory;
  VisualLoopOptions loops;
  SessionOptions session;
  std::uint64_t seed = 1;  // of random choices: the run's
  template <class Visitor>
  void describe(Visitor& v) {
    v.section("tracking", tracking, "tracking of the camera's pose from frame to frame");
    v.section("keyframe", keyframe, "when a frame becomes a keyframe");
    v.section("depth", depth, "depths from depth cameras and stereo pairs");
    v.section("window", window, "local bundle adjustment around the newest keyframe");
    v.section("memory", memory, "limits on the size of a camera's map");
    v.section("loops", loops, "loop closures within a camera's map");
    v.section("session", session, "new sessions (maps) after the camera was lost, and relocalisation");
  }
};

}  // namespace mapweave::visual
