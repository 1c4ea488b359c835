#include "record_json.h"

#include <mapweave/runtime/json_text.h>
#include <mapweave/runtime/live_plan.h>
#include <mapweave/runtime/run_configuration.h>

#include <algorithm>

namespace mapweave::runtime {

std::vector<RobotId> LivePlan::members(const TierId& edge) const {
  std::vector<RobotId> there;
  for (const auto& [robot, at] : edge_of)
    if (at == edge) there.push_back(robot);
  return there;
}

std::string encode(const LivePlan& plan) {
  nlohmann::ordered_json edges = nlohmann::ordered_json::object();
  for (const auto& [robot, edge] : plan.edge_of) edges[robot.str()] = edge.str();
  const nlohmann::ordered_json json = {{"plan", plan.number},
                                       {"since", plan.since},
                                       {"final", plan.is_final},
                                       {"done", plan.is_done},
                                       {"edges", std::move(edges)}};
  return json_text(json);
}

LivePlan decode_live_plan(std::string_view json, const std::string& where) {
  const nlohmann::json root = scheduling::parse_json(json, where);
  scheduling::expect_object(root, {"plan", "since", "final", "done", "edges"}, where, "");
  const auto number = [&](const char* key) {
    const std::int64_t value = whole_number_of(scheduling::member(root, key, where, ""), where, key);
    if (value < 1) scheduling::refuse("a number from 1 on was expected", where, key, "");
    return static_cast<std::uint64_t>(value);
  };
  const auto flag = [&](const char* key) {
    const nlohmann::json& value = scheduling::member(root, key, where, "");
    if (!value.is_boolean()) scheduling::refuse("true or false was expected", where, key, "");
    return value.get<bool>();
  };
  LivePlan plan{number("plan"), number("since"), flag("final"), flag("done"), {}};
  const nlohmann::json& edges = scheduling::member(root, "edges", where, "");
  if (!edges.is_object()) scheduling::refuse("robots and their edges were expected", where, "edges", "");
  for (const auto& [robot, edge] : edges.items()) {
    if (!is_valid_name(robot)) scheduling::refuse("'" + robot + "' is no name", where, "edges", "");
    const std::string at = text_of(edge, where, "edges." + robot);
    plan.edge_of[RobotId(robot)] = at.empty() ? TierId() : TierId(scheduling::name(edge, where, "edges." + robot));
  }
  return plan;
}

void expect_of(const LivePlan& plan, const RunPlan& of) {
  const auto refuse = [](const std::string& what) {
    throw Error(ErrorCode::kBadInput,
                "the coordinator's plan names " + what + ", which the configuration does not have", {},
                "give all programs of a deployment the same configuration");
  };
  for (const auto& [robot, edge] : plan.edge_of) {
    if (std::none_of(of.robots.begin(), of.robots.end(),
                     [&, name = robot](const PlannedRobot& one) { return one.id == name; }))
      refuse("robot '" + robot.str() + "'");
    if (!edge.empty() && std::find(of.edges.begin(), of.edges.end(), edge) == of.edges.end())
      refuse("edge '" + edge.str() + "'");
  }
}

}  // namespace mapweave::runtime
