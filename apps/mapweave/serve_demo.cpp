// mapweave serve demo: a broker, a cloud, two edges and three robots of a simulated apartment, in one program, which
// talk through the broker as they would on machines of their own.

#include "configuration.h"
#include "serve.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/log.h>
#include <mapweave/core/options.h>
#include <mapweave/runtime/nats_wires.h>
#include <mapweave/runtime/sensor_choice.h>
#include <mapweave/simulation/simulate.h>
#include <mapweave/transport/broker.h>

#include <nlohmann/json.hpp>

#include <stdlib.h>

#include <algorithm>
#include <map>
#include <memory>

namespace mapweave::app {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

constexpr auto kToConnect = 20s;
constexpr auto kBetweenLines = 3s;

// For the broker's files and the journals; gone with the demo.
class WorkingFolder {
 public:
  WorkingFolder() {
    std::string made = (fs::temp_directory_path() / "mapweave-demo-XXXXXX").string();
    if (::mkdtemp(made.data()) == nullptr)
      throw Error(ErrorCode::kCannotWrite, "no folder for temporary files can be made", made,
                  "name another one in TMPDIR");
    path_ = made;
  }
  ~WorkingFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  WorkingFolder(const WorkingFolder&) = delete;
  WorkingFolder& operator=(const WorkingFolder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

simulation::WorldOptions demo_world() {
  constexpr double kLength_m = 16.0;
  simulation::WorldOptions world;
  world.edges = 2;
  world.laser.rays = 181;
  world.laser.scans_per_second = 4.0;
  int room = 0;
  for (const char* id : {"alpha", "beta", "gamma"}) {
    simulation::RobotOptions robot;
    robot.id = id;
    robot.edge = room % 2 == 0 ? "north" : "south";
    robot.first_room = room++;
    robot.length_m = kLength_m;
    world.robots.push_back(robot);
  }
  return world;
}

// The robots' logs, beside the results, so that they can be mapped again; where they are there, they are the same.
fs::path logs_of_demo(const fs::path& out, WorkerPool& pool, Progress& progress) {
  fs::path logs = out;
  logs += ".logs";
  std::error_code ignored;
  if (fs::is_regular_file(logs / "run.yaml", ignored)) return logs;
  const simulation::WorldOptions world = demo_world();
  OutputFolder folder(logs, false);
  simulation::simulate(world, folder.staging(), pool, progress);
  folder.commit();
  return logs;
}

using DemoEdges = std::map<TierId, std::unique_ptr<runtime::LiveEdge>>;
using DemoRobots = std::vector<std::unique_ptr<runtime::LiveRobot>>;

nlohmann::ordered_json status_of_demo(const runtime::StatusTerms& terms, const runtime::RunPlan& plan,
                                      const runtime::LiveCloud& cloud, const DemoEdges& edges,
                                      const DemoRobots& robots) {
  std::vector<nlohmann::ordered_json> tiers{runtime::tier_status(cloud.counts(), terms)};
  for (const auto& [name, edge] : edges) tiers.push_back(runtime::tier_status(name, edge->counts(), terms));
  for (std::size_t i = 0; i < robots.size(); ++i)
    tiers.push_back(runtime::tier_status(plan.robots[i].id, plan.robots[i].edge, robots[i]->counts(), terms));
  return runtime::program_status("demo", "demo", std::move(tiers), terms);
}

// Who is where, now and then.
class DemoLines {
 public:
  DemoLines(Progress& progress, const DemoRobots& robots, const runtime::LiveCloud& cloud, const runtime::RunPlan& plan)
      : progress_(progress), robots_(robots), cloud_(cloud), plan_(plan) {}
  void show() {
    const auto now = std::chrono::steady_clock::now();
    const runtime::LiveCloudCounts cloud = cloud_.counts();
    if (now < next_ || cloud.is_sealing) return;
    next_ = now + kBetweenLines;
    std::string line;
    for (std::size_t i = 0; i < robots_.size(); ++i) {
      const runtime::LiveRobotCounts robot = robots_[i]->counts();
      line += plan_.robots[i].id.str() + " " + std::to_string(robot.scans) + " scans" +
              (robot.is_read ? " (all)" : "") + "; ";
    }
    progress_.say(line + "the cloud shows " + std::to_string(cloud.maps) + " maps" +
                  (cloud.joint.empty() ? ", none joined yet" : ", joined: " + joint_in_words(cloud.joint)));
  }

 private:
  Progress& progress_;
  const DemoRobots& robots_;
  const runtime::LiveCloud& cloud_;
  const runtime::RunPlan& plan_;
  std::chrono::steady_clock::time_point next_{};
};

}  // namespace

ExitCode serve_demo(const DemoArguments& arguments) {
  StopSignals signals;  // before all threads, the broker's too
  const WorkingFolder work;
  transport::BrokerOptions how;
  how.folder = work.path() / "broker";
  const transport::Broker broker(how);
  const auto progress = make_terminal_progress();
  WorkerPool pool(1);
  const fs::path logs = logs_of_demo(arguments.out, pool, *progress);
  LoadedConfiguration loaded = load_configuration(logs / "run.yaml", {}, {});
  runtime::RunConfiguration& configuration = loaded.configuration;
  configuration.live.speed = arguments.speed;
  configuration.live.preview_period_s = 2.0;
  runtime::RunPlan plan = runtime::make_plan(configuration, loaded.origins);
  runtime::choose_sensors(plan, configuration, pool);
  configuration.live.broker = broker.url();
  const runtime::NatsWires wires(configuration, kToConnect);
  const RunningSince since(configuration.live);
  WorkerPool merging(available_processors());
  const auto site = [&](const std::string& name) {
    return runtime::LiveSite{configuration, plan, configuration.live, merging, *progress, work.path() / (name + ".mwj"),
                             true};
  };
  runtime::LiveCloud cloud(site(runtime::cloud_tier().str()), {arguments.out, arguments.force, true});
  std::vector<runtime::ServedWires> served;
  served.emplace_back([&](std::shared_ptr<transport::Channel> channel) { cloud.serve(std::move(channel)); });
  DemoEdges edges;
  for (const TierId& name : plan.edges) {
    edges[name] = std::make_unique<runtime::LiveEdge>(name, site(name.str()), wires.from_edge(name));
    served.front().add(name.str(), wires.at_cloud(name));
    runtime::ServedWires& robots = served.emplace_back(
        [edge = edges[name].get()](std::shared_ptr<transport::Channel> channel) { edge->serve(std::move(channel)); });
    for (const runtime::PlannedRobot& robot : plan.robots)
      if (robot.edge == name) robots.add(robot.id.str(), wires.at_edge(robot.id, name));
  }
  DemoRobots robots;
  for (const runtime::PlannedRobot& robot : plan.robots)
    robots.push_back(std::make_unique<runtime::LiveRobot>(
        robot, configuration, configuration.live,
        [&wires, id = robot.id](const TierId& edge) { return wires.from_robot(id, edge)(); }));
  runtime::PageSource source = page_of("mapweave serve demo", configuration, plan);
  source.preview = [&] { return cloud.preview(); };
  source.status = [&] { return status_of_demo(since.terms(), plan, cloud, edges, robots); };
  const auto page = show_page(configuration.live.page_host, arguments.port, std::move(source), *progress);
  progress->say("a broker, a cloud, " + std::to_string(edges.size()) + " edges and " + std::to_string(robots.size()) +
                " robots run; Ctrl-C ends the drives and writes the map, and again ends at once");
  DemoLines lines(*progress, robots, cloud, plan);
  const runtime::Report report = wait_for_results(
      cloud, signals,
      [&] {
        for (const auto& robot : robots) robot->end();
      },
      [&] {
        for (runtime::ServedWires& wire : served) wire.keep();
        lines.show();
      });
  return report_result(report, arguments.out, arguments.json);
}

}  // namespace mapweave::app
