#include <mapweave/core/files.h>
#include <mapweave/runtime/timeline.h>
#include <mapweave/scheduling/json_fields.h>

#include <nlohmann/json.hpp>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::json;
using scheduling::field;
using scheduling::member;
using scheduling::refuse;

constexpr double kMost = 1e15;

std::uint64_t count(const Json& object, const char* name, const std::string& where, const std::string& key) {
  return static_cast<std::uint64_t>(field(object, name, kMost, where, key));
}
const Json& list(const Json& object, const char* name, const std::string& where) {
  const Json& value = member(object, name, where, "timeline");
  if (!value.is_array()) refuse("a list was expected", where, std::string("timeline.") + name, "");
  return value;
}
std::string name_or_nothing(const Json& value, const std::string& where, const std::string& key) {
  if (value.is_string() && value.get_ref<const std::string&>().empty()) return {};
  return scheduling::name(value, where, key);
}

}  // namespace

Work read_work(const std::filesystem::path& summary, double* recorded_s) {
  constexpr std::uint64_t kMostBytes = 1 << 26;
  const std::string where = summary.string();
  const Json root = scheduling::parse_json(read_file(summary, kMostBytes), where);
  if (!root.is_object() || !root.contains("timeline") || !root["timeline"].is_object())
    refuse("there is no timeline", where, "timeline", "it is written by `mapweave run` where nothing interrupts it");
  const Json& line = root["timeline"];
  Work work;
  for (const Json& robot : list(line, "robots", where)) {
    const std::string key = "timeline.robots";
    if (!robot.is_object()) refuse("an object was expected", where, key, "");
    RobotWork done;
    done.id = RobotId(scheduling::name(member(robot, "id", where, key), where, key + ".id"));
    done.edge = TierId(name_or_nothing(member(robot, "edge", where, key), where, key + ".edge"));
    done.log_s = field(robot, "log_seconds", kMost, where, key);
    done.packing_s = field(robot, "packing_cpu_seconds", kMost, where, key);
    done.mapping_s = field(robot, "mapping_cpu_seconds", kMost, where, key);
    done.seeing_s = field(robot, "seeing_cpu_seconds", kMost, where, key);
    done.sensed_bytes = count(robot, "sensed_bytes", where, key);
    done.map_bytes = count(robot, "map_bytes", where, key);
    done.repeated_s = field(robot, "repeated_cpu_seconds", kMost, where, key);
    done.repeated_bytes = count(robot, "repeated_bytes", where, key);
    work.robots.push_back(done);
  }
  for (const Json& edge : list(line, "edges", where)) {
    const std::string key = "timeline.edges";
    if (!edge.is_object()) refuse("an object was expected", where, key, "");
    EdgeWork done;
    done.id = TierId(scheduling::name(member(edge, "id", where, key), where, key + ".id"));
    done.fusing_s = field(edge, "fusing_cpu_seconds", kMost, where, key);
    done.bytes = count(edge, "bytes", where, key);
    done.speed = scheduling::number(member(edge, "speed", where, key), 0.0, kMost, true, where, key + ".speed");
    if (edge.contains("sent_scans")) {
      done.thinning.scans = count(edge, "scans", where, key);
      done.thinning.kept = count(edge, "sent_scans", where, key);
      done.thinning.walls_left_out = scheduling::number(member(edge, "walls_left_out", where, key), 0.0, 1.0, false,
                                                        where, key + ".walls_left_out");
    }
    done.sent_bytes = count(edge, "lent_bytes", where, key);
    done.judged_bytes = count(edge, "judged_bytes", where, key);
    done.judging_s = field(edge, "judging_cpu_seconds", kMost, where, key);
    work.edges.push_back(done);
  }
  const Json& cloud = member(line, "cloud", where, "timeline");
  work.fusing_s = field(cloud, "fusing_cpu_seconds", kMost, where, "timeline.cloud");
  if (cloud.contains("planning_cpu_seconds"))
    work.planning_s = field(cloud, "planning_cpu_seconds", kMost, where, "timeline.cloud");
  for (const Json& push : list(line, "pushes", where)) {
    const std::string key = "timeline.pushes";
    if (!push.is_object()) refuse("an object was expected", where, key, "");
    work.pushes.push_back({RobotId(scheduling::name(member(push, "robot", where, key), where, key + ".robot")),
                           count(push, "bytes", where, key)});
  }
  for (const Json& overlap : line.contains("overlaps") ? list(line, "overlaps", where) : Json::array()) {
    const std::string key = "timeline.overlaps";
    if (!overlap.is_array() || overlap.size() != 3)
      refuse("two robots and their overlap degree were expected", where, key, "");
    work.overlaps.push_back({RobotId(scheduling::name(overlap[0], where, key)),
                             RobotId(scheduling::name(overlap[1], where, key)),
                             scheduling::number(overlap[2], 0.0, 0.5, false, where, key)});
  }
  if (line.contains("rounds")) work.rounds = read_rounds(line["rounds"], where);
  if (recorded_s != nullptr) *recorded_s = field(line, "recorded_seconds", kMost, where, "timeline");
  return work;
}

}  // namespace mapweave::runtime
