#include <mapweave/runtime/stored_depth.h>

#include "dense_map.h"

#include <mapweave/core/error.h>
#include <mapweave/core/options.h>
#include <mapweave/core/worker_pool.h>
#include <mapweave/runtime/sensor_choice.h>

#include <algorithm>
#include <set>

namespace mapweave::runtime {
namespace {

bool shows_depth(const KeyframeFeatures& keyframe) {
  return keyframe.geometry->baseline_m > 0.0 ||
         std::any_of(keyframe.points.begin(), keyframe.points.end(),
                     [](const KeyframePoint& point) { return point.inverse_depth != 0; });
}

std::vector<DepthTrajectory> trajectories_of(const Map& map, const PlannedRobot& robot) {
  if (robot.trouble) throw Error(*robot.trouble);
  std::vector<DepthTrajectory> result;
  for (const ChosenCamera& camera : robot.sensors.cameras) {
    DepthTrajectory depth{robot, camera, {}, {}, {}};
    for (const auto& [id, node] : map.nodes) {
      const KeyframeFeatures* keyframe = keyframe_of(node);
      if (keyframe == nullptr || id.session.client.robot != robot.id || !shows_depth(*keyframe) ||
          id.session.client.sensor.str() != sensor_name(camera.label))
        continue;
      depth.frames.push_back({node.stamp, node.map_from_node});
      depth.keyframes.push_back(node.stamp);
    }
    if (camera.kind->camera == visual::CameraKind::mono || depth.frames.empty()) continue;
    std::sort(depth.keyframes.begin(), depth.keyframes.end());
    std::stable_sort(depth.frames.begin(), depth.frames.end(),
                     [](const StampedPose& a, const StampedPose& b) { return a.stamp < b.stamp; });
    result.push_back(std::move(depth));
  }
  if (result.empty())
    throw Error(ErrorCode::kBadInput, "has none of the cameras with depth of robot '" + robot.id.str() + "'",
                robot.log.string(), "give the log that the map was made of");
  return result;
}

}  // namespace

std::map<RobotId, std::filesystem::path> logs_of_results(const std::filesystem::path& map_file) {
  constexpr int kFoldersAbove = 4;
  std::error_code problem;
  std::filesystem::path folder = std::filesystem::absolute(map_file, problem).parent_path();
  for (int i = 0; i < kFoldersAbove && folder.has_relative_path(); ++i, folder = folder.parent_path()) {
    if (!std::filesystem::is_regular_file(folder / "config.yaml", problem)) continue;
    RunConfiguration configuration;
    try {
      load(configuration, {{folder / "config.yaml"}, {}, {}});
    } catch (const Error&) {
      return {};  // of something else
    }
    std::map<RobotId, std::filesystem::path> logs;
    for (const RobotEntry& robot : configuration.robots)
      if (std::filesystem::exists(robot.log, problem)) logs[RobotId(robot.id)] = robot.log;
    return logs;
  }
  return {};
}

std::vector<RobotId> robots_with_depth(const Map& map) {
  std::set<RobotId> robots;
  for (const auto& [id, node] : map.nodes)
    if (const KeyframeFeatures* keyframe = keyframe_of(node); keyframe != nullptr && shows_depth(*keyframe))
      robots.insert(id.session.client.robot);
  return {robots.begin(), robots.end()};
}

std::vector<std::string> write_stored_depth(const std::filesystem::path& folder, const Map& map,
                                            const std::map<RobotId, std::filesystem::path>& logs,
                                            std::vector<exporters::MapSlab> slabs, const RunConfiguration& given,
                                            Progress& progress) {
  RunConfiguration configuration = given;
  configuration.sensor = "cameras";
  RunPlan plan;
  for (const RobotId& robot : robots_with_depth(map)) {
    const auto log = logs.find(robot);
    if (log != logs.end()) plan.robots.push_back({robot, TierId("export"), log->second});
  }
  WorkerPool pool(1);
  choose_sensors(plan, configuration, pool);
  DenseContent content{{}, std::move(slabs), configuration.output.ply, configuration.output.octomap};
  for (const PlannedRobot& robot : plan.robots)
    for (DepthTrajectory& trajectory : trajectories_of(map, robot))
      content.trajectories.push_back(std::move(trajectory));
  std::vector<std::string> notes;
  if (content.is_any()) notes = write_dense_map(folder, content, configuration, progress);
  std::error_code ignored;
  if (!std::filesystem::exists(folder / (configuration.output.ply ? "map.ply" : "map.bt"), ignored))
    throw Error(ErrorCode::kBadInput, notes.empty() ? "nothing was seen" : notes.front(), map.id.str(),
                "give the log that the map was made of, or raise output.dense.most_error_m");
  return notes;
}

}  // namespace mapweave::runtime
