#pragma once
// Recorded observations become frames: here MRPT's observations end.

#include <mapweave/core/geometry.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/visual/frame.h>

#include <map>
#include <memory>
#include <optional>
#include <string>

namespace mapweave::visual {

enum class CameraKind { automatic, mono, stereo, rgbd };

// The most that the observation of a camera gives; nullopt for what is no camera's.
std::optional<CameraKind> camera_kind(const mrpt::obs::CObservation&);

struct FrameInputOptions {
  std::string label;
  CameraKind kind = CameraKind::automatic;
  template <class Visitor>
  void describe(Visitor& v) {
    v.text("label", label, "sensor label of the camera to use where a log has several; empty: the first one seen");
    v.choice("kind", kind,
             {{"auto", CameraKind::automatic},
              {"mono", CameraKind::mono},
              {"stereo", CameraKind::stereo},
              {"rgbd", CameraKind::rgbd}},
             "what of its pictures is used; mono leaves depth and right pictures aside");
  }
};

// What all frames of a camera share.
struct CameraRig {
  Pinhole camera;           // of the rectified pictures
  double baseline_m = 0.0;  // to the right camera; 0 without one
  bool has_depth = false;
  Pose3 robot_from_camera;   // the rectified left camera on the robot; identity where the log does not say
  Pose3 robot_from_optical;  // its optical frame as it is mounted, which the rectified one is turned against
};

class MotionPrior;

// Of one robot's log, one call per record in order. Frames of the chosen camera are answered, all else is nullopt;
// odometry and inertial units predict the motion. Throws Error kBadInput, naming the camera, where it has no
// calibration, where a picture has another size than that, or where it has no depth or right picture and `kind` asks
// for them; kMissing and kCorrupt where a picture beside the log cannot be read.
class FramePacker {
 public:
  explicit FramePacker(FrameInputOptions options = {});
  ~FramePacker();
  std::optional<Frame> operator()(const rawlog::Record& record);

  const std::optional<CameraRig>& rig() const { return rig_; }  // after the first frame
  const std::string& label() const { return options_.label; }   // in use; empty before the first frame
  const std::map<std::string, std::uint64_t>& ignored_cameras() const {
    return ignored_;
  }  // frames of other cameras, by label

 private:
  FrameInputOptions options_;
  std::optional<CameraRig> rig_;
  std::map<std::string, std::uint64_t> ignored_;
  struct Lens;
  std::unique_ptr<Lens> lens_;
  std::unique_ptr<MotionPrior> motion_;
};

}  // namespace mapweave::visual
