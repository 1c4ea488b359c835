#pragma once
// One camera's SLAM: tracking and local mapping (CORB-SLAM 2.1; CVS III-A). A frame is first laid over the one before (grey values
// around landmarks), then each landmark is found to a fraction of a pixel by how a keyframe saw it, and the pose follows from all of them.
// Keyframes add landmarks and refine those around them. What is not known of the sensor, its readout time and a constant error of its
// disparities, is learnt on the way.

#include <mapweave/core/geometry.h>
#include <mapweave/matching/binary_vocabulary.h>
#include <mapweave/visual/client_options.h>
#include <mapweave/visual/frame.h>

#include <memory>
#include <optional>
#include <vector>

namespace mapweave::visual {

enum class TrackState { waiting, tracked, lost };  // waiting: for a first frame with depth

struct Tracked {
  TrackState state = TrackState::waiting;
  Pose3 map_from_camera;  // where tracked
  int landmarks = 0;      // seen
  bool keyframe = false;  // became one
};

struct PlacedFrame {
  Stamp stamp;
  Pose3 map_from_camera;
};

struct MappedLandmark {
  Eigen::Vector3d point_in_map;
  int sightings = 0;  // keyframes that see it
};

// In the frame that was tracked last.
struct SeenLandmark {
  int landmark = 0;  // the same number in every frame
  Eigen::Vector2d pixel;
  double depth_m = 0.0;
};

// Not thread-safe; without threads or clocks of its own. The map's frame is the camera's at the first keyframe.
class VisualClient {
 public:
  // baseline_m: of the right camera, for frames that have a right picture. Without a vocabulary a lost camera looks for itself among the
  // keyframes around where it was lost only, and no loops are closed.
  VisualClient(PinholeCamera camera, double baseline_m, ClientOptions options,
               std::optional<matching::BinaryVocabulary> vocabulary = std::nullopt);
  ~VisualClient();
  // In the order of stamps, pictures of the camera's size (contract).
  Tracked add(const Frame& frame);

  std::vector<SeenLandmark> seen() const;
  std::vector<PlacedFrame> trajectory() const;  // of frames that were tracked, as their keyframes stand now
  std::vector<PlacedFrame> keyframes() const;
  std::vector<MappedLandmark> landmarks() const;
  int loops() const;           // closed
  SensorFlaws sensor() const;  // as learnt so far

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::visual
