#include "plan/team_options.h"

#include <mapweave/core/options.h>
#include <mapweave/runtime/live_robot.h>
#include <mapweave/runtime/manifest.h>

#include <set>

namespace mapweave::runtime {

Hash agreement_of(RunConfiguration configuration) {
  for (RobotEntry& robot : configuration.robots) robot.log.clear();
  for (EdgeEntry& edge : configuration.edges) edge.broker.clear();
  configuration.output = {};
  configuration.live = {};
  configuration.reading.follow = false;
  configuration.visual.vocabulary.clear();  // a path
  configuration.maps.clear();               // paths on the cloud's machine
  return Hasher().add(program_version()).add(to_yaml(configuration)).finish();
}

void expect_live(const RunConfiguration& configuration, const RunPlan& plan) {
  const auto refuse = [](const std::string& what, const std::string& key, const std::string& remedy) {
    throw Error(ErrorCode::kBadInput, what, key, remedy);
  };
  if (configuration.mode != Mode::offload && configuration.mode != Mode::onboard)
    refuse("robots, edges and a cloud that are programs of their own need edges that merge", "mode",
           "set mode: offload, or onboard where robots map themselves");
  if (shares_cameras(configuration)) {
    if (configuration.coordinator.method)
      refuse("cameras that share while they drive stay at their edge, and a coordinator may move their robots",
             "server.share", "set share: none, or coordinator.method: none");
    std::set<TierId> edges;
    for (const PlannedRobot& robot : plan.robots) edges.insert(robot.edge);
    if (configuration.server.across_edges && edges.size() > 1)
      refuse("cameras of robots that are programs of their own share within their edge alone, and these have " +
                 std::to_string(edges.size()) + " edges",
             "server.across_edges", "set across_edges: false, or give all robots one edge");
    if (!configuration.maps.empty())
      refuse("cameras that share while they drive do not know maps of sessions before", "maps",
             "leave them out, or set server.share: none; mapweave merge joins the maps afterwards");
    expect_one_rig(configuration, plan);
  }
  if (!configuration.cloud.push_to.empty())
    refuse("a deployment sends robots no maps", "cloud.push_to",
           "leave it out; the next deployment begins with the map that its `maps` names");
  if (configuration.coordinator.method)
    for (const EdgeEntry& edge : configuration.edges)
      if (!edge.broker.empty())
        refuse("a coordinator gives robots to other edges, which have one broker for all", "edges.broker",
               "leave edge " + edge.id + "'s broker out, or set coordinator.method: none");
  for (const PlannedRobot& robot : plan.robots) {
    if (robot.part)
      refuse("robot '" + robot.robot().str() + "' has several edges; robots that are programs of their own have one",
             "robots", "give it `edge` in place of `edges`");
  }
}

}  // namespace mapweave::runtime
