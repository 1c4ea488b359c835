#include "team_options.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <vector>

namespace mapweave::runtime {
namespace {

using Robots = std::vector<const PlannedRobot*>;

template <class Predicate>
Robots robots_of(const RunPlan& plan, const TierId& edge, Predicate&& counts) {
  Robots robots;
  for (const PlannedRobot& robot : plan.robots)
    if (robot.edge == edge && counts(robot)) robots.push_back(&robot);
  return robots;
}

Robots with_cameras(const RunPlan& plan, const TierId& edge) {
  return robots_of(plan, edge, [](const PlannedRobot& robot) { return !robot.sensors.cameras.empty(); });
}

// Those whose log nobody has looked into, too.
Robots perhaps_with_cameras(const RunPlan& plan, const TierId& edge) {
  return robots_of(plan, edge, [](const PlannedRobot& robot) {
    return !robot.sensors.cameras.empty() || (robot.sensors.scans == nullptr && !robot.trouble);
  });
}

// As the camera map server uses them: each robot's own trajectory is averaged without it.
std::string rig_text(const RunConfiguration& configuration) {
  rig::RigOptions rig = configuration.rig;
  rig.trajectory = {};
  return to_yaml(rig);
}

// Where a robot's own option that begins so was given.
std::string place_of_own(const RunConfiguration& configuration, const Robots& robots, const std::string& key) {
  for (const PlannedRobot* robot : robots)
    for (const OptionSetting& setting : robot_entry(configuration, robot->robot()).own)
      if (setting.key.compare(0, key.size(), key) == 0) return setting.place;
  return {};
}

std::string listed(const Robots& robots) {
  std::string text;
  for (std::size_t i = 0; i < robots.size(); ++i)
    text += (i == 0 ? "'" : i + 1 == robots.size() ? " and '" : ", '") + robots[i]->id.str() + "'";
  return text;
}

void expect_one_rig(const RunConfiguration& configuration, const Robots& robots, const std::string& edge) {
  const auto other = std::find_if(robots.begin(), robots.end(), [&](const PlannedRobot* robot) {
    return rig_text(configuration_of(configuration, *robot)) !=
           rig_text(configuration_of(configuration, *robots.front()));
  });
  if (other == robots.end()) return;
  const Robots both{robots.front(), *other};
  throw Error(ErrorCode::kBadInput,
              "robots " + listed(both) + " have different options of rig, and the camera map server of edge '" + edge +
                  "' merges the cameras of both by the same ones",
              place_of_own(configuration, both, "rig."),
              "set rig for all robots, give the two different edges, or leave out server.share");
}

bool waits(const RunConfiguration& configuration, const PlannedRobot& robot) {
  return configuration_of(configuration, robot).visual.client.session.await_place &&
         std::all_of(robot.sensors.cameras.begin(), robot.sensors.cameras.end(),
                     [](const ChosenCamera& camera) { return camera.kind->camera == visual::CameraKind::mono; });
}

void expect_a_beginner(const RunConfiguration& configuration, const Robots& robots, const std::string& edge) {
  if (!std::all_of(robots.begin(), robots.end(),
                   [&](const PlannedRobot* robot) { return waits(configuration, *robot); }))
    return;
  const std::string who = robots.size() == 1
                              ? "robot " + listed(robots) + " of edge '" + edge + "' waits for a place"
                              : "robots " + listed(robots) + " of edge '" + edge + "' wait for each other's maps";
  throw Error(ErrorCode::kBadInput, who + " (visual.session.await_place), so that none is ever begun",
              place_of_own(configuration, robots, "visual.session.await_place"),
              "let one robot of the edge begin a map: visual: {session: {await_place: false}}");
}

}  // namespace

void expect_agreement(const RunConfiguration& configuration, const RunPlan& plan) {
  if (configuration.server.share == tiers::Sharing::none) return;
  for (const TierId& edge : plan.edges) {
    const Robots robots = with_cameras(plan, edge);
    if (robots.empty()) continue;
    expect_one_rig(configuration, robots, edge.str());
    // Maps that the run begins with, and other edges, have places too.
    if (plan.maps.empty() && !configuration.server.across_edges) expect_a_beginner(configuration, robots, edge.str());
  }
}

std::optional<std::string> note_on_senses(const RunPlan& plan) {
  const PlannedRobot *by_laser = nullptr, *by_cameras = nullptr;
  for (const PlannedRobot& robot : plan.robots) {
    const bool has_laser = robot.sensors.scans != nullptr, has_cameras = !robot.sensors.cameras.empty();
    if (has_laser && has_cameras) return std::nullopt;
    if (has_laser && by_laser == nullptr) by_laser = &robot;
    if (has_cameras && by_cameras == nullptr) by_cameras = &robot;
  }
  if (by_laser == nullptr || by_cameras == nullptr) return std::nullopt;
  return "robot " + by_laser->id.str() + " maps with its " + std::string(by_laser->sensors.scans->in_words) +
         ", robot " + by_cameras->id.str() +
         " with cameras: such maps show nothing in common and stay apart; map all robots with the same kind of sensor, "
         "or one of them with both (sensor: all)";
}

void expect_one_rig(const RunConfiguration& configuration, const RunPlan& plan) {
  for (const TierId& edge : plan.edges)
    if (const Robots robots = perhaps_with_cameras(plan, edge); !robots.empty())
      expect_one_rig(configuration, robots, edge.str());
}

const rig::RigOptions& shared_rig_options(const RunConfiguration& configuration, const RunPlan& plan,
                                          const TierId& edge) {
  const Robots robots = perhaps_with_cameras(plan, edge);
  return robots.empty() ? configuration.rig : configuration_of(configuration, *robots.front()).rig;
}

}  // namespace mapweave::runtime
