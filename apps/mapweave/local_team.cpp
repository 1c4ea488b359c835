#include "local_team.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <utility>

namespace mapweave::app {
namespace {

constexpr std::chrono::seconds kToConnect{20};

transport::BrokerOptions broker_in(const std::filesystem::path& store, std::uint64_t store_bytes) {
  transport::BrokerOptions options;
  options.folder = store / "broker";
  options.most_store_bytes = std::max(options.most_store_bytes, store_bytes);
  return options;
}

}  // namespace

LocalTeam::LocalTeam(runtime::RunConfiguration configuration, runtime::RunPlan plan, const std::filesystem::path& store,
                     const runtime::RunSettings& results, Progress& progress,
                     const std::function<bool(const RobotId&)>& has_log)
    : broker_(broker_in(store, runtime::store_bytes(configuration, plan))),
      configuration_(std::move(configuration)),
      plan_(std::move(plan)),
      merging_(available_processors()) {
  configuration_.live.broker = broker_.url();
  wires_ = std::make_unique<runtime::NatsWires>(configuration_, kToConnect);
  const auto site = [&](const std::string& name) {
    return runtime::LiveSite{configuration_,          plan_, configuration_.live, merging_, progress,
                             store / (name + ".mwj"), true};
  };
  cloud_ = std::make_unique<runtime::LiveCloud>(site(runtime::cloud_tier().str()), results);
  served_.emplace_back([this](std::shared_ptr<transport::Channel> channel) { cloud_->serve(std::move(channel)); });
  for (const TierId& name : plan_.edges) {
    edges_[name] = std::make_unique<runtime::LiveEdge>(name, site(name.str()), wires_->from_edge(name));
    served_.front().add(name.str(), wires_->at_cloud(name));
    runtime::ServedWires& robots = served_.emplace_back(
        [edge = edges_[name].get()](std::shared_ptr<transport::Channel> channel) { edge->serve(std::move(channel)); });
    for (const runtime::PlannedRobot& robot : plan_.robots)
      if (robot.edge == name) robots.add(robot.id.str(), wires_->at_edge(robot.id, name));
    if (!runtime::shares_cameras(configuration_)) continue;
    runtime::CameraWires& cameras = cameras_.emplace_back(*wires_, name, *edges_[name]);
    for (const runtime::PlannedRobot& robot : plan_.robots)
      if (robot.edge == name) cameras.add(robot.id);
  }
  for (const runtime::PlannedRobot& robot : plan_.robots)
    robots_.emplace_back(
        robot, configuration_, [this, id = robot.id](const TierId& edge) { return wires_->from_robot(id, edge)(); },
        [this, id = robot.id](const TierId& edge, int number) { return wires_->from_camera(id, number, edge)(); },
        has_log ? std::function<bool()>([has_log, id = robot.id] { return has_log(id); }) : nullptr);
}

LocalTeam::~LocalTeam() = default;

void LocalTeam::look() {
  for (StartingRobot& robot : robots_) robot.look();
  for (runtime::ServedWires& wire : served_) wire.keep();
  for (runtime::CameraWires& wires : cameras_) wires.keep();
}

void LocalTeam::end() {
  for (StartingRobot& robot : robots_) robot.end();
}

void LocalTeam::leave() {
  for (StartingRobot& robot : robots_) robot.leave();
}

nlohmann::ordered_json LocalTeam::status(const std::string& program, const runtime::StatusTerms& terms) const {
  std::vector<nlohmann::ordered_json> tiers{runtime::tier_status(cloud_->counts(), terms)};
  for (const auto& [name, edge] : edges_) tiers.push_back(runtime::tier_status(name, edge->counts(), terms));
  for (const StartingRobot& robot : robots_) {
    const runtime::LiveRobotCounts counts = robot.counts();
    tiers.push_back(runtime::tier_status(robot.id(), counts.edge, counts, terms));
  }
  return runtime::program_status(program, program, std::move(tiers), terms);
}

}  // namespace mapweave::app
