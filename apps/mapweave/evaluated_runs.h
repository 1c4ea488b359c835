#pragma once
// What evaluate is given: files of trajectories, or folders of results that hold one for each robot.

#include <mapweave/evaluation/relations.h>
#include <mapweave/evaluation/trajectory_file.h>

#include <filesystem>
#include <string>
#include <vector>

namespace mapweave::app {

struct EvaluatedRobot {
  std::string robot;  // empty for a single file
  std::filesystem::path file;
  evaluation::TrajectoryFile estimate;
};

// One estimate of the command line. Robots of one map share a frame, and so an alignment.
struct EvaluatedRun {
  std::string name;  // as it was given
  std::vector<std::vector<EvaluatedRobot>> maps;
  bool is_team() const { return !maps.front().front().robot.empty(); }
};

// A trajectory, or a folder: of `slam` (trajectory.tum), of `run` and `merge` (team*/trajectories/ROBOT.tum), or of
// files ROBOT.tum. Throws Error(kMissing) for a folder that holds none of these, and what reading throws.
EvaluatedRun read_run(const std::filesystem::path&, const std::filesystem::path& times);

// The reference of a robot: `given`, or what stands for it in that folder. Throws Error(kMissing), saying what was
// looked for.
std::filesystem::path reference_of(const std::filesystem::path& given, const std::string& robot);
std::filesystem::path relations_of(const std::filesystem::path& given, const std::string& robot);

// What of the run a reference is about. One file is that of a whole team where one robot drove after the other, as of a
// log that was cut. Where robots of a map were at different places at the same time, it is that of the robot after
// which it is called (alpha.relations, alpha.truth.tum); throws Error(kBadInput) where there is no such robot.
EvaluatedRun meant_by(const EvaluatedRun&, const std::filesystem::path& reference);

}  // namespace mapweave::app
