#pragma once
// Writes a world as files: what `mapweave simulate` does.

#include <mapweave/core/progress.h>
#include <mapweave/core/worker_pool.h>
#include <mapweave/simulation/world_options.h>

#include <filesystem>
#include <string>
#include <vector>

namespace mapweave::simulation {

struct SimulatedLog {
  std::string robot;
  std::size_t scans = 0, frames = 0;  // of the laser, of all cameras
  double length_m = 0.0, duration_s = 0.0;
};

// Into an existing folder: <robot>.rawlog (all sensors by stamp; of equal stamps odometry, scan, inertial unit,
// cameras), <robot>.truth.tum (the robot's pose in the world at every scan), for each camera <robot>.<camera>.truth.tum
// (its optical frame at every frame) and, as LogOptions say, pictures in <robot>_Images or a folder <robot>_<camera>;
// and run.yaml, a configuration that `mapweave run` takes as it is. Returns a line per robot, in the order of the
// options. Throws Error kBadInput for an impossible world, kCannotWrite; Interrupted.
std::vector<SimulatedLog> simulate(const WorldOptions&, const std::filesystem::path& folder, WorkerPool&, Progress&);

}  // namespace mapweave::simulation
