#include "cluster_run.h"
#include "cluster_work.h"
#include "record_json.h"

#include <mapweave/core/files.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/runtime/manifest.h>

#include <cstring>
#include <set>

namespace mapweave::runtime {
namespace {

constexpr const char* kFiles[] = {"map.ply", "map.dense.pcd", "map.bt", "map.ot"};
static_assert(sizeof(std::int16_t) == 2);

std::vector<std::int64_t> nanoseconds_of(const std::vector<Stamp>& stamps) {
  std::vector<std::int64_t> values;
  for (const Stamp stamp : stamps) values.push_back(stamp.ns);
  return values;
}

nlohmann::json json_of_trajectory(const DepthTrajectory& trajectory) {
  return {{"robot", trajectory.robot.id.str()},
          {"label", trajectory.chosen.label},
          {"kind", std::string(trajectory.chosen.kind->name)},
          {"readout_s", trajectory.calibration.readout_s},
          {"inverse_depth_offset", trajectory.calibration.inverse_depth_offset},
          {"frames", json_of(trajectory.frames)},
          {"keyframes", nanoseconds_of(trajectory.keyframes)}};
}

// Machines with other byte orders than little-endian have no package of this program.
std::string bytes_of(const OccupancyGrid& grid) {
  std::string bytes(grid.log_odds.size() * sizeof(std::int16_t), '\0');
  if (!bytes.empty()) std::memcpy(bytes.data(), grid.log_odds.data(), bytes.size());
  return bytes;
}

nlohmann::json json_of_slab(const exporters::MapSlab& slab) {
  const OccupancyGrid& grid = slab.grid;
  return {{"height_m", slab.height_m},     {"resolution_m", grid.resolution_m}, {"origin_x_m", grid.origin_x_m},
          {"origin_y_m", grid.origin_y_m}, {"columns", grid.columns},           {"rows", grid.rows}};
}

exporters::MapSlab slab_of(const nlohmann::json& json, const std::string& bytes, const std::string& where) {
  const auto number = [&](const char* key) { return number_of(scheduling::member(json, key, where, ""), where, key); };
  const auto count = [&](const char* key) {
    const std::int64_t value = whole_number_of(scheduling::member(json, key, where, ""), where, key);
    if (value < 0 || value > std::numeric_limits<std::int32_t>::max())
      throw Error(ErrorCode::kCorrupt, "a grid of no size", where);
    return static_cast<std::int32_t>(value);
  };
  exporters::MapSlab slab;
  slab.height_m = number("height_m");
  OccupancyGrid& grid = slab.grid;
  grid.resolution_m = number("resolution_m");
  grid.origin_x_m = number("origin_x_m");
  grid.origin_y_m = number("origin_y_m");
  grid.columns = count("columns");
  grid.rows = count("rows");
  const std::uint64_t cells = static_cast<std::uint64_t>(grid.columns) * static_cast<std::uint64_t>(grid.rows);
  if (bytes.size() != cells * sizeof(std::int16_t) || !(grid.resolution_m > 0.0))
    throw Error(ErrorCode::kCorrupt, "a grid of another size than it says", where);
  grid.log_odds.resize(cells);
  if (!bytes.empty()) std::memcpy(grid.log_odds.data(), bytes.data(), bytes.size());
  return slab;
}

class DenseMapOnWorker final : public AnsweredWork {
 public:
  DenseMapOnWorker(const DenseRequest& request, const RunConfiguration& configuration,
                   const std::vector<InputFile>& inputs, std::optional<std::vector<std::string>>& notes)
      : request_(request), configuration_(configuration), inputs_(inputs), notes_(notes) {}
  std::string name() const override { return "the dense map of " + request_.title; }

  ClusterTask task() const override {
    ClusterTask task;
    task.version = program_version();
    task.kind = ClusterTaskKind::dense_map;
    task.name = name();
    task.configuration = to_yaml(configuration_of_task(configuration_));
    nlohmann::json content{{"ply", request_.content.ply}, {"octomap", request_.content.octomap}};
    content["trajectories"] = nlohmann::json::array();
    content["slabs"] = nlohmann::json::array();
    std::set<RobotId> robots;
    for (const DepthTrajectory& trajectory : request_.content.trajectories) {
      content["trajectories"].push_back(json_of_trajectory(trajectory));
      const PlannedRobot& robot = trajectory.robot;
      if (robots.insert(robot.id).second)
        task.robots.push_back({robot.id, robot.log.string(), hash_of(robot.log),
                               to_yaml(configuration_of_task(configuration_of(configuration_, robot)))});
    }
    task.blobs.emplace_back();
    for (const exporters::MapSlab& slab : request_.content.slabs) {
      content["slabs"].push_back(json_of_slab(slab));
      task.blobs.push_back(bytes_of(slab.grid));
    }
    task.blobs.front() = json_text(content, -1);
    return task;
  }

 private:
  Hash hash_of(const std::filesystem::path& log) const {
    for (const InputFile& input : inputs_)
      if (input.path == log.string()) return input.sha256;
    return hash_of_input(log);
  }

  void take_answer(ClusterMessage answer, const std::string& where) override {
    const auto texts = [&](const char* key) {
      return texts_of(list_of(scheduling::member(answer.head, key, where, ""), where, key), where, key);
    };
    const std::vector<std::string> files = texts("files");
    if (files.size() != answer.blobs.size()) throw Error(ErrorCode::kCorrupt, "files without names", where);
    for (const std::string& file : files)
      if (std::find(std::begin(kFiles), std::end(kFiles), file) == std::end(kFiles))
        throw Error(ErrorCode::kCorrupt, "a file that nobody asked for: " + file, where);
    std::vector<std::string> notes = texts("notes");
    for (std::size_t i = 0; i < files.size(); ++i) write_file(request_.folder / files[i], answer.blobs[i]);
    notes_ = std::move(notes);
  }

  const DenseRequest& request_;
  const RunConfiguration& configuration_;
  const std::vector<InputFile>& inputs_;
  std::optional<std::vector<std::string>>& notes_;
};

DepthTrajectory trajectory_of(const nlohmann::json& json, const std::vector<PlannedRobot>& robots,
                              const std::string& where) {
  const auto member = [&](const char* key) { return scheduling::member(json, key, where, ""); };
  const std::string robot = text_of(member("robot"), where, "robot"), kind = text_of(member("kind"), where, "kind");
  const auto planned =
      std::find_if(robots.begin(), robots.end(), [&](const PlannedRobot& one) { return one.id.str() == robot; });
  const SensorKind* sensor = sensor_kind(kind);
  if (planned == robots.end() || sensor == nullptr || sensor->task != SensorTask::frames)
    throw Error(ErrorCode::kCorrupt, "a camera of nobody", where);
  DepthTrajectory trajectory{*planned,
                             {text_of(member("label"), where, "label"), sensor},
                             {number_of(member("readout_s"), where, "readout_s"),
                              number_of(member("inverse_depth_offset"), where, "inverse_depth_offset")},
                             poses_of(member("frames"), where, "frames"),
                             {}};
  const nlohmann::json keyframes = member("keyframes");
  for (const nlohmann::json& stamp : list_of(keyframes, where, "keyframes"))
    trajectory.keyframes.push_back({whole_number_of(stamp, where, "keyframes")});
  return trajectory;
}

}  // namespace

std::vector<std::optional<std::vector<std::string>>> draw_on_cluster(const RunConfiguration& configuration,
                                                                     const std::vector<DenseRequest>& requests,
                                                                     const std::vector<InputFile>& inputs,
                                                                     const Cluster& cluster, Progress& progress) {
  std::vector<std::optional<std::vector<std::string>>> notes(requests.size());
  std::vector<std::unique_ptr<ClusterWork>> works;
  for (std::size_t i = 0; i < requests.size(); ++i)
    works.push_back(std::make_unique<DenseMapOnWorker>(requests[i], configuration, inputs, notes[i]));
  run_on_cluster("dense maps made by workers", works, cluster, progress);
  return notes;
}

ClusterMessage drawn_by_worker(const ClusterTask& task, const std::vector<std::filesystem::path>& logs,
                               Progress& progress) {
  const std::string where = "task";
  if (task.blobs.empty()) throw Error(ErrorCode::kCorrupt, "nothing is to be drawn", where);
  const WorkerPlan plan = configuration_in(task.configuration);
  std::vector<PlannedRobot> robots;
  for (std::size_t i = 0; i < task.robots.size(); ++i) {
    PlannedRobot& robot = robots.emplace_back();
    robot.id = task.robots[i].id;
    robot.log = logs[i];
    robot.configuration =
        std::make_shared<const RunConfiguration>(configuration_in(task.robots[i].configuration).configuration);
  }
  const nlohmann::json json = scheduling::parse_json(task.blobs.front(), where);
  if (!json.is_object()) scheduling::refuse("an object was expected", where, "", "");
  DenseContent content;
  content.ply = scheduling::member(json, "ply", where, "") == true;
  content.octomap = scheduling::member(json, "octomap", where, "") == true;
  const nlohmann::json trajectories = scheduling::member(json, "trajectories", where, ""),
                       slabs = scheduling::member(json, "slabs", where, "");
  for (const nlohmann::json& one : list_of(trajectories, where, "trajectories"))
    content.trajectories.push_back(trajectory_of(one, robots, where));
  for (const nlohmann::json& one : list_of(slabs, where, "slabs")) {
    if (content.slabs.size() + 1 >= task.blobs.size()) throw Error(ErrorCode::kCorrupt, "a slab without cells", where);
    content.slabs.push_back(slab_of(one, task.blobs[content.slabs.size() + 1], where));
  }
  if (!content.is_any()) throw Error(ErrorCode::kCorrupt, "nothing is to be drawn", where);
  const PassingFolder folder("a dense map");
  ClusterMessage answer{nlohmann::json::object(), {}};
  answer.head["notes"] = write_dense_map(folder.path(), content, plan.configuration, progress);
  answer.head["files"] = nlohmann::json::array();
  for (const char* file : kFiles)
    if (std::filesystem::exists(folder.path() / file)) {
      answer.head["files"].push_back(file);
      answer.blobs.push_back(read_file(folder.path() / file));
    }
  return answer;
}

}  // namespace mapweave::runtime
