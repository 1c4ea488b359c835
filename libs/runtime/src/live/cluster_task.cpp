#include "cluster_task.h"

#include "record_json.h"

#include <mapweave/core/files.h>
#include <mapweave/core/options.h>
#include <mapweave/maps/exchange.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/runtime/manifest.h>
#include <mapweave/runtime/sensor_choice.h>

#include <unistd.h>

#include <cstdlib>
#include <utility>

namespace mapweave::runtime {
namespace {

constexpr std::size_t kMostBytes = std::size_t{1} << 30;  // of one message's parts: more no machine keeps beside a map
constexpr const char* kKinds[] = {"robot", "judging", "dense map"};

}  // namespace

PassingFolder::PassingFolder(const std::string& what) {
  std::string name = (std::filesystem::temp_directory_path() / "mapweave-task-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr)
    throw Error(ErrorCode::kCannotWrite, "no folder can be made for " + what, name,
                "make room, or name another folder in TMPDIR");
  path_ = name;
}

PassingFolder::~PassingFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::vector<transport::Envelope> envelopes_of(const char* subject, const ClusterMessage& message) {
  nlohmann::json head = message.head;
  head["blobs"] = nlohmann::json::array();
  std::string bytes;
  for (const std::string& blob : message.blobs) {
    head["blobs"].push_back(blob.size());
    bytes += blob;
  }
  std::vector<transport::Envelope> envelopes{{subject, json_text(head, -1)}};
  for (std::size_t begin = 0; begin < bytes.size(); begin += kMostPartBytes)
    envelopes.push_back({cluster_subject::kPart, bytes.substr(begin, kMostPartBytes)});
  return envelopes;
}

std::optional<ClusterMessage> ClusterReader::add(const transport::Envelope& envelope, const std::string& where) {
  const auto total = [&] {
    std::size_t sum = 0;
    for (const std::size_t size : sizes_) sum += size;
    return sum;
  };
  if (envelope.subject == cluster_subject::kPart) {
    if (head_.is_null()) throw Error(ErrorCode::kCorrupt, "a part of nothing", where);
    bytes_ += envelope.bytes;
  } else {
    head_ = scheduling::parse_json(envelope.bytes, where);
    if (!head_.is_object()) scheduling::refuse("an object was expected", where, "", "");
    sizes_.clear();
    bytes_.clear();
    std::size_t left = kMostBytes;
    for (const nlohmann::json& value : list_of(scheduling::member(head_, "blobs", where, ""), where, "blobs")) {
      const std::int64_t size = whole_number_of(value, where, "blobs");
      if (size < 0 || static_cast<std::uint64_t>(size) > left)
        throw Error(ErrorCode::kCorrupt, "parts of more than " + std::to_string(kMostBytes) + " bytes", where);
      left -= static_cast<std::size_t>(size);
      sizes_.push_back(static_cast<std::size_t>(size));
    }
  }
  if (bytes_.size() > total()) throw Error(ErrorCode::kCorrupt, "more parts than it says", where);
  if (bytes_.size() < total()) return std::nullopt;
  ClusterMessage message{std::exchange(head_, nullptr), {}};
  std::size_t begin = 0;
  for (const std::size_t size : sizes_)
    message.blobs.push_back(bytes_.substr(std::exchange(begin, begin + size), size));
  bytes_ = {};
  return message;
}

std::vector<transport::Envelope> envelopes_of(const ClusterTask& task) {
  ClusterMessage message{nlohmann::json::object(), task.blobs};
  message.head["version"] = task.version;
  message.head["kind"] = kKinds[static_cast<std::size_t>(task.kind)];
  message.head["name"] = task.name;
  message.head["configuration"] = task.configuration;
  message.head["robots"] = nlohmann::json::array();
  for (const ClusterTask::Robot& robot : task.robots)
    message.head["robots"].push_back({{"robot", robot.id.str()},
                                      {"log", robot.log},
                                      {"log_sha256", to_hex(robot.log_sha256)},
                                      {"configuration", robot.configuration}});
  return envelopes_of(cluster_subject::kTask, message);
}

ClusterTask decode_cluster_task(ClusterMessage message, const std::string& where) {
  const auto text = [&](const nlohmann::json& json, const char* key) {
    return text_of(scheduling::member(json, key, where, ""), where, key);
  };
  ClusterTask task;
  task.version = text(message.head, "version");
  const std::string kind = text(message.head, "kind");
  const auto* const known = std::find(std::begin(kKinds), std::end(kKinds), kind);
  if (known == std::end(kKinds)) throw Error(ErrorCode::kUnsupported, "no worker knows the task '" + kind + "'", where);
  task.kind = static_cast<ClusterTaskKind>(known - std::begin(kKinds));
  task.name = text(message.head, "name");
  task.configuration = text(message.head, "configuration");
  for (const nlohmann::json& robot : list_of(scheduling::member(message.head, "robots", where, ""), where, "robots")) {
    if (!robot.is_object()) scheduling::refuse("an object was expected", where, "robots", "");
    task.robots.push_back({RobotId(scheduling::name(scheduling::member(robot, "robot", where, ""), where, "robot")),
                           text(robot, "log"), hash_of_hex(text(robot, "log_sha256"), where),
                           text(robot, "configuration")});
  }
  task.blobs = std::move(message.blobs);
  if (task.kind == ClusterTaskKind::robot && task.robots.size() != 1)
    throw Error(ErrorCode::kCorrupt, "a robot's task is of one robot", where);
  return task;
}

RunConfiguration configuration_of_task(RunConfiguration configuration) {
  configuration.robots.clear();
  configuration.maps.clear();
  configuration.edges.clear();
  configuration.team = {};
  configuration.cloud = {};
  configuration.live = {};
  return configuration;
}

ClusterTask task_of(const RunConfiguration& configuration, const PlannedRobot& robot) {
  RunConfiguration own = configuration_of_task(configuration_of(configuration, robot));
  RobotEntry entry;
  entry.id = robot.id.str();
  entry.edge = robot.edge.str();
  own.robots = {entry};
  own.output = {};
  ClusterTask task;
  task.version = program_version();
  task.name = "robot " + robot.id.str();
  task.robots = {{robot.id, robot.log.string(), hash_of_input(robot.log), to_yaml(own)}};
  return task;
}

WorkerPlan configuration_in(const std::string& yaml, const std::filesystem::path& log) {
  WorkerPlan result;
  ConfigurationSources sources;
  const PassingFolder folder("the configuration of a task");
  write_file(folder.path() / "task.yaml", yaml);
  sources.files = {folder.path() / "task.yaml"};
  if (!log.empty()) sources.settings = {"robots.0.log=" + nlohmann::json(log.string()).dump()};
  result.origins = load(result.configuration, sources);
  complete_starts(result.configuration, result.origins);
  read_vocabulary(result.configuration, result.origins);
  result.configuration.fusion.laser_cameras = result.configuration.laser_cameras;
  return result;
}

RobotPlan plan_of(const ClusterTask& task, const std::filesystem::path& log) {
  const ClusterTask::Robot& robot = task.robots.front();
  const WorkerPlan loaded = configuration_in(robot.configuration, log);
  RobotPlan result{loaded.configuration, {}};
  if (result.configuration.robots.size() != 1 || result.configuration.robots.front().id != robot.id.str())
    throw Error(ErrorCode::kBadInput, "its configuration is not of robot '" + robot.id.str() + "' alone", "task");
  result.plan = make_plan(result.configuration, loaded.origins);
  WorkerPool pool(1);
  choose_sensors(result.plan, result.configuration, pool);
  return result;
}

}  // namespace mapweave::runtime
