// mapweave serve: robots, edges and a cloud as programs of their own, which talk through a NATS broker.

#include "serve.h"

#include "command_line.h"
#include "configuration.h"
#include "misplaced_input.h"
#include "service_notify.h"

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/core/nearest_name.h>
#include <mapweave/runtime/deployment_keys.h>
#include <mapweave/runtime/nats_wires.h>
#include <mapweave/runtime/sensor_choice.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <memory>
#include <thread>

namespace mapweave::app {
namespace {

using namespace std::chrono_literals;

constexpr auto kStep = 50ms;
constexpr auto kToConnect = 20s;
constexpr auto kToSayGoodbye = 10s;

struct Arguments {
  std::filesystem::path file;
  std::string name;
  WritingFlags flags;
  DemoArguments demo;
  KeysArguments keys;
};

// The one that is named, or the only one.
std::string chosen(const std::string& kind, const std::string& name, const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& one : names) list += (list.empty() ? "" : ", ") + one;
  if (name.empty() && names.size() == 1) return names.front();
  if (name.empty())
    throw Error(ErrorCode::kUsage, "which " + kind + "? The configuration has: " + list, "--name", "name one of them");
  if (std::find(names.begin(), names.end(), name) != names.end()) return name;
  const auto nearest = nearest_name(name, names);
  throw Error(ErrorCode::kUsage, "the configuration has no " + kind + " '" + name + "'; it has: " + list, "--name",
              nearest ? "did you mean '" + *nearest + "'?" : "name one of them");
}

std::optional<std::filesystem::path> journal_in(const runtime::LiveOptions& live, const std::string& name) {
  std::error_code error;
  std::filesystem::create_directories(live.store, error);
  if (error)
    throw Error(ErrorCode::kCannotWrite, "the store cannot be made: " + error.message(), live.store,
                "name another folder in live.store");
  return std::filesystem::path(live.store) / (name + ".mwj");
}

// What it held is in the results now.
void remove_journal(const std::filesystem::path& journal) {
  std::error_code ignored;
  for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(journal.string() + suffix, ignored);
  std::filesystem::remove(journal.parent_path(), ignored);  // where it was the last one
}

bool shows(const Deployment& deployment) { return deployment.live().page_port != 0; }

// Null: no page is wanted. Tier: LiveEdge or LiveCloud.
template <class Tier>
std::unique_ptr<runtime::PageServer> page_if_wanted(const Deployment& deployment, const std::string& title,
                                                    Progress& progress, const Tier& tier,
                                                    std::function<nlohmann::ordered_json()> status) {
  if (!shows(deployment)) return nullptr;
  runtime::PageSource source = page_of(title, deployment.loaded.configuration, deployment.plan);
  source.status = std::move(status);
  source.preview = [&tier] { return tier.preview(); };
  return show_page(deployment.live().page_host, deployment.live().page_port, std::move(source), progress);
}

bool has_said_all(const runtime::LiveRobotCounts& robot) { return robot.is_read && robot.confirmed >= robot.messages; }

ExitCode serve_robot(const Arguments& arguments) {
  StopSignals signals;
  Deployment deployment = load_deployment(arguments.file, arguments.flags);
  const RunningSince since(deployment.live());
  std::vector<std::string> names;
  for (const runtime::PlannedRobot& robot : deployment.plan.robots) names.push_back(robot.id.str());
  const RobotId name(chosen("robot", arguments.name, names));
  runtime::RunPlan own = deployment.plan;
  own.robots.erase(std::remove_if(own.robots.begin(), own.robots.end(),
                                  [&](const runtime::PlannedRobot& robot) { return robot.id != name; }),
                   own.robots.end());
  WorkerPool pool(1);
  runtime::choose_sensors(own, deployment.loaded.configuration, pool);
  const runtime::PlannedRobot& planned = own.robots.front();
  if (planned.trouble && planned.trouble->code() == ErrorCode::kMissing) throw *planned.trouble;
  const runtime::NatsWires wires(deployment.loaded.configuration, planned.edge, kToConnect);
  PlanReader plans(wires, deployment);
  runtime::LiveRobot robot(planned, deployment.loaded.configuration, deployment.live(),
                           [&](const TierId& edge) { return wires.from_robot(name, edge)(); });
  if (const auto plan = plans.look()) robot.follow(*plan);
  const auto progress = make_terminal_progress();
  const TierId first = robot.counts().edge;
  progress->say(
      "robot " + name.str() +
      (robot.counts().is_on_board ? " maps on board, and sends its maps at the end to " : " sends what it senses to ") +
      (first.empty() ? "the edge that the coordinator names" : "edge " + first.str()));
  StatusPublisher publisher(wires, "robot-" + name.str(), deployment.live().keys.empty(), [&] {
    const runtime::StatusTerms terms = since.terms();
    return runtime::program_status("robot", name.str(),
                                   {runtime::tier_status(name, robot.counts().edge, robot.counts(), terms)}, terms);
  });
  ServiceNotifier service;
  bool is_asked = false, waits = false;
  while (!robot.is_done()) {
    if (const auto plan = plans.look()) robot.follow(*plan);
    publisher.publish();
    const runtime::LiveRobotCounts now = robot.counts();
    service.turn(service_turn_of(now));
    if (has_said_all(now) && is_asked) break;
    if (has_said_all(now) && !std::exchange(waits, true))
      progress->say("robot " + name.str() +
                    ": its edge has all; it stays until the team's map is written, since the coordinator may give it "
                    "to another edge");
    if (!signals.wait(kStep)) continue;
    if (is_asked || signals.asks_for_a_pause())
      throw Interrupted("interrupted; " + std::to_string(robot.counts().waiting_bytes) +
                        " bytes did not get to the edge, which goes on when the robot is started again");
    is_asked = true;
    robot.end();
    log(LogLevel::info, "robot " + name.str() + " ends its recording and sends the rest; again to end at once");
  }
  publisher.publish(true);
  const runtime::LiveRobotCounts counts = robot.counts();
  progress->say("robot " + name.str() + ": its edge has all " +
                (counts.is_on_board ? "that it mapped" : std::to_string(counts.scans - counts.lost_scans) + " scans") +
                (counts.lost_scans > 0 ? "; " + std::to_string(counts.lost_scans) + " were lost" : ""));
  return ExitCode::done;
}

ExitCode serve_edge(const Arguments& arguments) {
  StopSignals signals;
  Deployment deployment = load_deployment(arguments.file, arguments.flags);
  const RunningSince since(deployment.live());
  std::vector<std::string> names;
  for (const TierId& edge : deployment.plan.edges) names.push_back(edge.str());
  const TierId name(chosen("edge", arguments.name, names));
  WorkerPool pool(threads_of(arguments.flags));
  const auto progress = make_terminal_progress();
  const runtime::NatsWires wires(deployment.loaded.configuration, name, kToConnect);
  const auto journal = journal_in(deployment.live(), name.str());
  {
    runtime::LiveEdge edge(name,
                           {deployment.loaded.configuration, deployment.plan, deployment.live(), pool, *progress,
                            journal, shows(deployment)},
                           wires.from_edge(name));
    runtime::ServedWires robots([&](std::shared_ptr<transport::Channel> channel) { edge.serve(std::move(channel)); });
    const auto add = [&](const RobotId& robot) { robots.add(robot.str(), wires.at_edge(robot, name)); };
    for (const runtime::PlannedRobot& robot : deployment.plan.robots)
      if (robot.edge == name) add(robot.id);
    PlanReader plans(wires, deployment);
    MapReportPublisher maps(wires, runtime::maps_word_of(name));
    const auto follow = [&] {
      const auto plan = plans.look();
      if (!plan) return;
      edge.follow(*plan);
      for (const auto& [robot, at] : plan->edge_of)
        if (at == name)
          add(robot);
        else
          robots.remove(robot.str());
    };
    const auto status = [&] {
      const runtime::StatusTerms terms = since.terms();
      return runtime::program_status("edge", name.str(), {runtime::tier_status(name, edge.counts(), terms)}, terms);
    };
    const auto page = page_if_wanted(deployment, "mapweave serve edge " + name.str(), *progress, edge, status);
    StatusPublisher publisher(wires, "edge-" + name.str(), true, status);
    progress->say("edge " + name.str() + " waits for its robots; what it receives is kept in " + journal->string());
    ServiceNotifier service;
    while (!edge.counts().is_done) {
      follow();
      robots.keep();
      publisher.publish();
      if (is_coordinated(deployment)) maps.publish(edge);
      service.turn(service_turn_of(edge.counts()));
      if (signals.wait(kStep))
        throw Interrupted("interrupted; edge " + name.str() + " goes on from " + journal->string() +
                          " when it is started again");
    }
    publisher.publish(true);
    std::this_thread::sleep_for(1s);  // its last receipts
  }
  remove_journal(*journal);
  progress->say("edge " + name.str() + ": the cloud has written the team's map");
  return ExitCode::done;
}

ExitCode serve_cloud(const Arguments& arguments) {
  StopSignals signals;
  Deployment deployment = load_deployment(arguments.file, arguments.flags);
  const RunningSince since(deployment.live());
  WorkerPool pool(threads_of(arguments.flags));
  const auto progress = make_terminal_progress();
  const runtime::NatsWires wires(deployment.loaded.configuration, kToConnect);
  const auto journal = journal_in(deployment.live(), runtime::cloud_tier().str());
  std::optional<runtime::Report> report;
  {
    runtime::LiveCloud cloud({deployment.loaded.configuration, deployment.plan, deployment.live(), pool, *progress,
                              journal, shows(deployment)},
                             {arguments.flags.out, arguments.flags.force, true});
    runtime::ServedWires edges([&](std::shared_ptr<transport::Channel> channel) { cloud.serve(std::move(channel)); });
    for (const TierId& edge : deployment.plan.edges) edges.add(edge.str(), wires.at_cloud(edge));
    PlanReader plans(wires, deployment);
    const auto status = [&] {
      const runtime::StatusTerms terms = since.terms();
      return runtime::program_status("cloud", "cloud", {runtime::tier_status(cloud.counts(), terms)}, terms);
    };
    const auto page = page_if_wanted(deployment, "mapweave serve cloud", *progress, cloud, status);
    StatusPublisher publisher(wires, "cloud", true, status);
    progress->say("the cloud waits for its edges; Ctrl-C merges what is there, and again ends at once");
    ServiceNotifier service;
    const auto asked = [&] {
      if (signals.asks_for_a_pause())
        throw Interrupted("interrupted; the cloud goes on from " + journal->string() + " when it is started again");
      cloud.seal_now();
    };
    report = wait_for_results(cloud, signals, asked, [&] {
      if (const auto plan = plans.look()) cloud.follow(*plan);
      edges.keep();
      publisher.publish();
      service.turn(service_turn_of(cloud.counts()));
    });
    publisher.publish(true);
  }
  remove_journal(*journal);
  return report_result(*report, arguments.flags.out, arguments.flags.json);
}

void add_role_arguments(CLI::App& role, Arguments& arguments) {
  role.add_option("CONFIG", arguments.file, "the deployment's configuration, the same for all of its programs")
      ->required()
      ->type_name("CONFIG.yaml");
  role.add_option("--set", arguments.flags.set, "sets one option: key=value, as in live.speed=2")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
}

void add_threads_flag(CLI::App& role, Arguments& arguments) {
  role.add_option("--threads", arguments.flags.threads,
                  "threads to merge with; 0: one per processor. Results do not depend on it")
      ->check(whole_number(0, 1024))
      ->type_name("N");
}

}  // namespace

Deployment load_deployment(const std::filesystem::path& file, const WritingFlags& flags) {
  expect_configuration(file);
  Deployment deployment{load_configuration(file, {}, flags), {}};
  deployment.plan =
      runtime::make_plan(deployment.loaded.configuration, deployment.loaded.origins, runtime::LogsAre::with_robots);
  runtime::expect_live(deployment.loaded.configuration, deployment.plan);
  return deployment;
}

std::string joint_in_words(const std::vector<std::vector<MapId>>& joint) {
  std::string words;
  for (const std::vector<MapId>& members : joint) {
    if (!words.empty()) words += ", ";
    for (std::size_t i = 0; i < members.size(); ++i) words += (i > 0 ? " + " : "") + members[i].str();
  }
  return words;
}

runtime::Report wait_for_results(runtime::LiveCloud& cloud, StopSignals& signals, const std::function<void()>& asked,
                                 const std::function<void()>& now_and_then) {
  using Clock = std::chrono::steady_clock;
  bool is_asked = false;
  std::optional<runtime::Report> report;
  std::optional<Clock::time_point> end;
  while (true) {
    now_and_then();
    if (!report) report = cloud.wait(0ms);
    if (report && !end) end = Clock::now() + kToSayGoodbye;
    const runtime::LiveCloudCounts counts = cloud.counts();
    if (report && (Clock::now() >= *end || std::all_of(counts.edges.begin(), counts.edges.end(), [](const auto& edge) {
                     return edge.has_all || !edge.is_on_wire;
                   })))
      return *report;
    if (!signals.wait(kStep)) continue;
    if (report) return *report;
    if (is_asked) throw Interrupted("interrupted; nothing was written");
    is_asked = true;
    asked();
  }
}

Action set_up_serve(CLI::App& verb) {
  const auto arguments = std::make_shared<Arguments>();
  verb.require_subcommand(1);
  CLI::App* robot = verb.add_subcommand("robot", "plays a robot's recording and sends it to its edge");
  CLI::App* edge = verb.add_subcommand("edge", "maps what its robots send, and merges their maps");
  CLI::App* cloud = verb.add_subcommand("cloud", "merges the maps of all edges, and writes the results");
  CLI::App* coordinator = verb.add_subcommand("coordinator", "gives robots to edges, again and again while they drive");
  CLI::App* keys = verb.add_subcommand("keys", "makes certificates, users and passwords for a deployment's broker");
  CLI::App* demo = verb.add_subcommand("demo", "all of them on this machine, with three simulated robots");
  for (CLI::App* role : {robot, edge, cloud, coordinator, keys}) add_role_arguments(*role, *arguments);
  robot->add_option("--name", arguments->name, "which robot of the configuration it is")->type_name("NAME");
  edge->add_option("--name", arguments->name, "which edge of the configuration it is")->type_name("NAME");
  for (CLI::App* role : {edge, cloud}) add_threads_flag(*role, *arguments);
  cloud->add_option("-o,--out", arguments->flags.out, "new folder for the results")->required()->type_name("DIR");
  cloud->add_flag("--force", arguments->flags.force, "replace an old folder of results");
  cloud->add_flag("--json", arguments->flags.json, "print the summary as JSON");
  coordinator->add_option("-o,--out", arguments->flags.out, "folder for plan.json, which holds what it decided and why")
      ->required()
      ->type_name("DIR");
  keys->add_option("-o,--out", arguments->flags.out, "folder for them; keys that it holds already stay as they are")
      ->required()
      ->type_name("DIR");
  keys->add_option("--host", arguments->keys.hosts,
                   "name or address of the broker's machine, as programs reach it; several may be given")
      ->required()
      ->type_name("HOST")
      ->allow_extra_args(false);
  keys->add_option("--port", arguments->keys.port, "where the broker listens")
      ->check(whole_number(1, 65535))
      ->type_name("N")
      ->capture_default_str();
  keys->add_option("--leaf-port", arguments->keys.leaf_port, "where it listens for edges' own brokers")
      ->check(whole_number(1, 65535))
      ->type_name("N")
      ->capture_default_str();
  demo->add_option("-o,--out", arguments->demo.out, "new folder for the results; the robots' logs are put beside it")
      ->type_name("DIR")
      ->capture_default_str();
  demo->add_option("--speed", arguments->demo.speed, "how many times faster than real the robots drive")
      ->check(number(0.0))
      ->type_name("X")
      ->capture_default_str();
  demo->add_option("--port", arguments->demo.port,
                   "port of the page that shows what happens, on this machine alone; 0: any that is free")
      ->check(whole_number(0, 65535))
      ->type_name("PORT")
      ->capture_default_str();
  demo->add_flag("--force", arguments->demo.force, "replace an old folder of results");
  demo->add_flag("--json", arguments->demo.json, "print the summary as JSON");
  show_examples(*robot, {"mapweave serve robot office.yaml --name alpha"});
  show_examples(*edge, {"mapweave serve edge office.yaml --name north"});
  show_examples(*cloud, {"mapweave serve cloud office.yaml --out maps/office"});
  show_examples(*coordinator, {"mapweave serve coordinator office.yaml --out plans/office"});
  show_examples(*keys, {"mapweave serve keys office.yaml --host 10.0.0.1 --out keys"});
  show_examples(*demo, {"mapweave serve demo --out maps/demo"});
  return [=] {
    if (robot->parsed()) return serve_robot(*arguments);
    if (edge->parsed()) return serve_edge(*arguments);
    if (cloud->parsed()) return serve_cloud(*arguments);
    if (coordinator->parsed())
      return serve_coordinator(load_deployment(arguments->file, arguments->flags), arguments->flags.out);
    if (keys->parsed()) {
      arguments->keys.out = arguments->flags.out;
      return make_keys(load_deployment(arguments->file, arguments->flags), arguments->keys);
    }
    return serve_demo(arguments->demo);
  };
}

}  // namespace mapweave::app
