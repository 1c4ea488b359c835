#pragma once
// What depth cameras and stereo pairs saw, at the poses that mapping ended with: a second pass through the logs, one
// picture at a time.

#include <mapweave/core/progress.h>
#include <mapweave/runtime/camera_task.h>

namespace mapweave::runtime {

// One camera's part of a map.
struct DepthTrajectory {
  PlannedRobot robot;
  ChosenCamera chosen;
  SensorCalibration calibration;
  std::vector<StampedPose> frames;
  std::vector<Stamp> keyframes;  // sorted
};

// Of the cameras that see depth, in their own map, or in one that holds their keyframes: those of maps that were
// rescaled by one of `scales` are left out, as their depth is of another scale.
std::vector<DepthTrajectory> depth_trajectories(const CameraMap&, const CamerasOutcome&);
std::vector<DepthTrajectory> depth_trajectories(const Map&, const Table<MapId, double>& scales, const CamerasOutcome&);

// What dense files are made of, and which.
struct DenseContent {
  std::vector<DepthTrajectory> trajectories;
  std::vector<exporters::MapSlab> slabs;  // of OctoMaps alone
  bool ply = false, octomap = false;
  bool is_any() const {
    return (ply && !trajectories.empty()) || (octomap && !(trajectories.empty() && slabs.empty()));
  }
};

// map.ply, map.dense.pcd, map.bt, map.ot, as far as asked for, into `folder`, which is there. Contract: there is
// something to write. What was not as expected is answered for people. Memory: that of the options, and one picture.
// Throws Interrupted.
std::vector<std::string> write_dense_map(const std::filesystem::path& folder, const DenseContent&,
                                         const RunConfiguration&, Progress&);

}  // namespace mapweave::runtime
