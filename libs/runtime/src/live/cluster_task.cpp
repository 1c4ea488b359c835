#include "cluster_task.h"

#include "record_json.h"

#include <mapweave/core/files.h>
#include <mapweave/core/options.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/runtime/manifest.h>
#include <mapweave/runtime/sensor_choice.h>

#include <unistd.h>

#include <cstdlib>

namespace mapweave::runtime {
namespace {

// A file that is gone with this.
class PassingFile {
 public:
  explicit PassingFile(const std::string& content) {
    if (::mkdtemp(folder_.data()) == nullptr)
      throw Error(ErrorCode::kCannotWrite, "no folder can be made for the configuration of a task", folder_,
                  "make room, or name another folder in TMPDIR");
    write_file(path(), content);
  }
  ~PassingFile() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  PassingFile(const PassingFile&) = delete;
  PassingFile& operator=(const PassingFile&) = delete;
  std::filesystem::path path() const { return std::filesystem::path(folder_) / "task.yaml"; }

 private:
  std::string folder_ = (std::filesystem::temp_directory_path() / "mapweave-task-XXXXXX").string();
};

}  // namespace

std::string encode(const ClusterTask& task) {
  nlohmann::ordered_json json;
  json["version"] = task.version;
  json["robot"] = task.robot.str();
  json["log"] = task.log;
  json["log_sha256"] = to_hex(task.log_sha256);
  json["configuration"] = task.configuration;
  return json_text(json, -1);
}

ClusterTask decode_cluster_task(std::string_view bytes, const std::string& where) {
  const nlohmann::json json = scheduling::parse_json(bytes, where);
  if (!json.is_object()) scheduling::refuse("an object was expected", where, "", "");
  const auto text = [&](const char* key) { return text_of(scheduling::member(json, key, where, ""), where, key); };
  ClusterTask task;
  task.version = text("version");
  task.robot = RobotId(scheduling::name(scheduling::member(json, "robot", where, ""), where, "robot"));
  task.log = text("log");
  task.log_sha256 = hash_of_hex(text("log_sha256"), where);
  task.configuration = text("configuration");
  return task;
}

ClusterTask task_of(const RunConfiguration& configuration, const PlannedRobot& robot) {
  RunConfiguration own = configuration_of(configuration, robot);
  RobotEntry entry;
  entry.id = robot.id.str();
  entry.edge = robot.edge.str();
  own.robots = {entry};
  own.maps.clear();
  own.edges.clear();
  own.team = {};
  own.cloud = {};
  own.live = {};
  own.output = {};
  return {program_version(), robot.id, robot.log.string(), hash_of_input(robot.log), to_yaml(own)};
}

WorkerPlan plan_of(const ClusterTask& task, const std::filesystem::path& log) {
  WorkerPlan result;
  ConfigurationSources sources;
  const PassingFile file(task.configuration);
  sources.files = {file.path()};
  sources.settings = {"robots.0.log=" + nlohmann::json(log.string()).dump()};
  const Origins origins = load(result.configuration, sources);
  complete_starts(result.configuration, origins);
  read_vocabulary(result.configuration, origins);
  result.configuration.fusion.laser_cameras = result.configuration.laser_cameras;
  if (result.configuration.robots.size() != 1 || result.configuration.robots.front().id != task.robot.str())
    throw Error(ErrorCode::kBadInput, "its configuration is not of robot '" + task.robot.str() + "' alone", "task");
  result.plan = make_plan(result.configuration, origins);
  WorkerPool pool(1);
  choose_sensors(result.plan, result.configuration, pool);
  return result;
}

}  // namespace mapweave::runtime
