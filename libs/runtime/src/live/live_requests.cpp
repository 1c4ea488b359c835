#include <mapweave/core/error.h>
#include <mapweave/runtime/live_requests.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kMost_m = 1e6, kMost_rad = 7.0;

[[noreturn]] void refuse(const std::string& what, const std::string& where) {
  throw Error(ErrorCode::kBadInput, what, where, "ask again");
}

RobotId robot_of(const Json& json, const RunPlan& plan, const std::string& where) {
  if (!json.is_string()) refuse("a request is of no robot", where);
  const std::string name = json.get<std::string>();
  const auto is_it = [&](const PlannedRobot& robot) { return robot.id.str() == name; };
  if (std::none_of(plan.robots.begin(), plan.robots.end(), is_it))
    refuse("the configuration has no robot '" + name + "'", where);
  return RobotId(name);
}

double number_of(const Json& json, const char* key, double low, double high, const std::string& where) {
  const auto found = json.find(key);
  const double value = found != json.end() && found->is_number() ? found->get<double>() : std::nan("");
  if (!(value >= low && value <= high)) refuse(std::string("a start has no ") + key + " that can be", where);
  return value;
}

}  // namespace

std::string encode(const LiveRequests& requests) {
  Json json = {{"refused", Json::array()}, {"starts", Json::object()}};
  for (const auto& [a, b] : requests.refused) json["refused"].push_back({a.str(), b.str()});
  for (const auto& [robot, start] : requests.starts)
    json["starts"][robot.str()] = {{"x_m", start.x_m},
                                   {"y_m", start.y_m},
                                   {"yaw_rad", start.yaw_rad},
                                   {"sigma_m", start.sigma_m},
                                   {"sigma_rad", start.sigma_rad}};
  return json.dump();
}

LiveRequests decode_live_requests(std::string_view text, const RunPlan& plan, const std::string& where) {
  const Json json = Json::parse(text, nullptr, false);
  if (json.is_discarded()) throw Error(ErrorCode::kCorrupt, "is no JSON", where, "ask again");
  if (!json.is_object() || !json.contains("refused") || !json["refused"].is_array() || !json.contains("starts") ||
      !json["starts"].is_object())
    refuse("holds no requests", where);
  LiveRequests requests;
  for (const Json& pair : json["refused"]) {
    if (!pair.is_array() || pair.size() != 2) refuse("a pair has two robots", where);
    const RobotId a = robot_of(pair[0], plan, where), b = robot_of(pair[1], plan, where);
    if (a == b) refuse("'" + a.str() + "' and '" + b.str() + "' are one robot", where);
    requests.refused.insert(std::minmax(a, b));
  }
  for (const auto& [name, start] : json["starts"].items()) {
    if (!start.is_object()) refuse("a start has no pose", where);
    StartPose pose;
    pose.x_m = number_of(start, "x_m", -kMost_m, kMost_m, where);
    pose.y_m = number_of(start, "y_m", -kMost_m, kMost_m, where);
    pose.yaw_rad = number_of(start, "yaw_rad", -kMost_rad, kMost_rad, where);
    pose.sigma_m = number_of(start, "sigma_m", 0.0, kMost_m, where);
    pose.sigma_rad = number_of(start, "sigma_rad", std::numeric_limits<double>::min(), kMost_rad, where);
    requests.starts[robot_of(Json(name), plan, where)] = pose;
  }
  return requests;
}

StartPose start_of(const RunConfiguration& configuration, const LiveRequests& requests, const RobotId& robot) {
  const auto asked = requests.starts.find(robot);
  return asked != requests.starts.end() ? asked->second : robot_entry(configuration, robot).start;
}

std::set<std::pair<RobotId, RobotId>> refused_in(const RunPlan& plan, const LiveRequests& requests) {
  std::set<std::pair<RobotId, RobotId>> refused = plan.refused;
  refused.insert(requests.refused.begin(), requests.refused.end());
  return refused;
}

}  // namespace mapweave::runtime
