#pragma once
// What a robot's camera records: every frame is a pure function of the world and its number, so that frames may be made
// in any order by any number of threads.

#include <mapweave/simulation/renderer.h>
#include <mapweave/simulation/world.h>

#include <memory>

namespace mapweave::simulation {

struct Picture {
  int width = 0, height = 0, channels = 0;  // 1: grey; 3: red, green, blue
  std::vector<std::uint8_t> values;         // row by row
};

constexpr double kDepthUnit = 1.0 / 5000.0;  // metres, as in the TUM RGB-D benchmark

struct CameraFrame {
  Stamp stamp, depth_stamp;          // the latter differs where the depth's offset is not 0
  Pose3 world_from_camera;           // the truth at `stamp`; the left camera's; z ahead, y down
  Picture left, right;               // right: stereo only
  std::vector<std::uint16_t> depth;  // rgbd only: kDepthUnit; 0: none; row by row
};

// Immutable; may be used by many threads. The world must outlive it.
class CameraRecording {
 public:
  // Memory that frames share when they are made one after the other.
  struct Workspace {
    RenderedView view, depth_view;
    std::vector<float> blurred;
  };
  // Contract: the world has this robot, and the robot this camera.
  CameraRecording(const World& world, std::size_t robot, std::size_t camera);
  const CameraOptions& options() const { return options_; }
  const CameraModel& model() const { return model_; }
  std::size_t frame_count() const { return frame_count_; }
  Stamp stamp(std::size_t frame) const;
  CameraFrame frame(std::size_t frame, Workspace&) const;
  // The left camera at a time since the robot's start.
  Pose3 world_from_camera(double seconds) const;

 private:
  double seconds(std::size_t frame) const;
  Picture take(double seconds, const Pose3& left_from_camera, double gain, const RandomStream&, std::uint64_t frame,
               Workspace&) const;

  const World* world_;
  std::size_t robot_;
  CameraOptions options_;
  CameraModel model_;
  Pose3 robot_from_camera_;
  std::size_t frame_count_;
  std::vector<float> vignette_;
  std::uint64_t seed_;
  std::string owner_;  // of the random numbers
};

}  // namespace mapweave::simulation
