#include "evaluated_runs.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/log.h>
#include <mapweave/core/median.h>

#include <algorithm>
#include <optional>
#include <utility>

namespace mapweave::app {
namespace {

template <class Wanted>
std::vector<std::filesystem::path> sorted_entries(const std::filesystem::path& folder, const Wanted& wanted) {
  std::vector<std::filesystem::path> found;
  std::error_code problem;
  for (const auto& entry : std::filesystem::directory_iterator(folder, problem))
    if (wanted(entry.path())) found.push_back(entry.path());
  if (problem) throw Error(ErrorCode::kMissing, "cannot be listed: " + problem.message(), folder.string());
  std::sort(found.begin(), found.end());
  return found;
}

std::vector<std::filesystem::path> trajectories_in(const std::filesystem::path& folder) {
  return sorted_entries(folder, [](const auto& path) { return path.extension() == ".tum" && is_file(path); });
}

// Folders of files ROBOT.tum, one for each map.
std::vector<std::filesystem::path> maps_in(const std::filesystem::path& results) {
  if (is_folder(results / "trajectories")) return {results / "trajectories"};
  std::vector<std::filesystem::path> found;
  for (const auto& team : sorted_entries(results, [](const std::filesystem::path& path) {
         return path.filename().string().rfind("team", 0) == 0 && is_folder(path / "trajectories");
       }))
    found.push_back(team / "trajectories");
  return found;
}

std::filesystem::path first_there(const std::filesystem::path& folder, const std::vector<std::string>& names,
                                  const std::string& what) {
  std::string tried;
  for (const std::string& name : names) {
    if (is_file(folder / name)) return folder / name;
    tried += (tried.empty() ? "" : ", ") + name;
  }
  throw Error(ErrorCode::kMissing, "holds no " + what, folder.string(), "one of these names was looked for: " + tried);
}

// Two robots of a map that were at different places at the same time.
std::optional<std::pair<std::string, std::string>> robots_at_the_same_time(const EvaluatedRun& run) {
  constexpr double kOtherPlace_m = 0.5, kLargestGap_s = 1.0;
  constexpr std::size_t kFewest = 10;
  for (const auto& robots : run.maps)
    for (auto a = robots.begin(); a != robots.end(); ++a)
      for (auto b = std::next(a); b != robots.end(); ++b) {
        std::vector<double> apart_m;
        for (const auto& point : a->estimate.trajectory)
          if (const auto other = evaluation::interpolated_pose(b->estimate.trajectory, point.stamp, kLargestGap_s))
            apart_m.push_back((point.pose.t - other->t).norm());
        if (apart_m.size() < kFewest) continue;
        if (median(std::move(apart_m)) > kOtherPlace_m) return std::pair(a->robot, b->robot);
      }
  return std::nullopt;
}

}  // namespace

EvaluatedRun read_run(const std::filesystem::path& path, const std::filesystem::path& times) {
  EvaluatedRun run{path.string(), {}};
  const auto add_map = [&](const std::vector<std::filesystem::path>& files) {
    auto& robots = run.maps.emplace_back();
    for (const auto& file : files)
      robots.push_back({file.stem().string(), file, evaluation::read_trajectory(file, times)});
  };
  if (!is_folder(path)) {
    run.maps = {{{"", path, evaluation::read_trajectory(path, times)}}};
    return run;
  }
  for (const auto& folder : maps_in(path))
    if (const auto files = trajectories_in(folder); !files.empty()) add_map(files);
  if (!run.maps.empty()) return run;
  if (is_file(path / "trajectory.tum")) {
    run.maps = {{{"", path / "trajectory.tum", evaluation::read_trajectory(path / "trajectory.tum", times)}}};
    return run;
  }
  const auto files = trajectories_in(path);
  if (files.empty())
    throw Error(ErrorCode::kMissing, "holds no trajectories", path.string(),
                "give a folder of results (team/trajectories/ROBOT.tum, or trajectory.tum), of files ROBOT.tum, or a "
                "trajectory");
  add_map(files);
  return run;
}

std::filesystem::path reference_of(const std::filesystem::path& given, const std::string& robot) {
  if (!is_folder(given)) return given;
  if (robot.empty())
    return first_there(given,
                       {"groundtruth.txt", "poses.txt", "mav0/state_groundtruth_estimate0/data.csv",
                        "state_groundtruth_estimate0/data.csv", "trajectory.tum"},
                       "reference");
  return first_there(given,
                     {robot + ".truth.tum", robot + ".tum", robot + ".txt", robot + ".csv", robot + "/groundtruth.txt",
                      "trajectories/" + robot + ".tum", "team/trajectories/" + robot + ".tum"},
                     "reference of robot '" + robot + "'");
}

EvaluatedRun meant_by(const EvaluatedRun& run, const std::filesystem::path& reference) {
  if (is_folder(reference)) return run;
  const auto together = robots_at_the_same_time(run);
  if (!together) return run;
  const std::string name = reference.filename().string();
  EvaluatedRun result{run.name, {}};
  for (const auto& robots : run.maps)
    for (const EvaluatedRobot& robot : robots)
      if (name.compare(0, robot.robot.size() + 1, robot.robot + ".") == 0) result.maps.push_back({robot});
  if (result.maps.size() == 1) {
    log(LogLevel::warning, run.name + ": robots drove at the same time; " + name + " is taken for that of robot " +
                               result.maps.front().front().robot + ", and no other one is judged");
    return result;
  }
  throw Error(ErrorCode::kBadInput,
              "robots " + together->first + " and " + together->second +
                  " drove at the same time, and one file does not say which of them it is about",
              reference.string(), "give a folder with a file for each robot, named like the robot");
}

std::filesystem::path relations_of(const std::filesystem::path& given, const std::string& robot) {
  if (!is_folder(given)) return given;
  if (robot.empty())
    throw Error(ErrorCode::kUsage, "a folder of relations is for a team's folder of results", given.string(),
                "name the file of relations");
  return first_there(given, {robot + ".relations", robot + ".txt"}, "relations of robot '" + robot + "'");
}

}  // namespace mapweave::app
