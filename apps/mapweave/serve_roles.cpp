// The roles of a deployment: robots, edges and a cloud as programs of their own, which talk through a NATS broker.

#include "serve.h"

#include "command_line.h"
#include "configuration.h"
#include "configuration_reload.h"
#include "misplaced_input.h"
#include "own_broker.h"
#include "service_notify.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/core/nearest_name.h>
#include <mapweave/rawlog/growing_log.h>
#include <mapweave/runtime/deployment_keys.h>
#include <mapweave/runtime/nats_wires.h>

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
  make_folder(live.store, "name another folder in live.store", "the store cannot be made");
  return std::filesystem::path(live.store) / (name + ".mwj");
}

// What they held is in the results now.
void remove_journals(const std::filesystem::path& journal) {
  std::error_code ignored;
  for (const std::filesystem::path& one : {runtime::journal_of_cameras(journal), journal}) {
    for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(one.string() + suffix, ignored);
    std::filesystem::remove(one.parent_path(), ignored);  // where it was the last one
  }
}

// Tier: LiveEdge or LiveCloud.
template <class Tier>
runtime::PageSource page_of(const std::string& title, const Deployment& deployment, const Tier& tier,
                            std::function<nlohmann::ordered_json()> status) {
  runtime::PageSource source = app::page_of(title, deployment.loaded.configuration, deployment.plan);
  source.status = std::move(status);
  source.preview = [&tier] { return tier.preview(); };
  return source;
}

bool has_said_all(const runtime::LiveRobotCounts& robot) { return robot.is_read && robot.confirmed >= robot.messages; }

// Whoever writes a log that is followed must end before who reads it does, which must not take it for the drive's end.
class LogEnd {
 public:
  LogEnd(StartingRobot& robot, RoleExtension& extension) : robot_(robot), extension_(extension) {}
  ~LogEnd() {
    robot_.leave();
    extension_.leave_log();
  }
  LogEnd(const LogEnd&) = delete;
  LogEnd& operator=(const LogEnd&) = delete;

 private:
  StartingRobot& robot_;
  RoleExtension& extension_;
};

// What a robot says to its user.
class RobotLines {
 public:
  RobotLines(const RobotId& robot, Progress& progress) : name_("robot " + robot.str()), progress_(progress) {}

  void show(const runtime::LiveRobotCounts& counts) {
    if (!std::exchange(has_begun_, true))
      progress_.say(
          name_ +
          (counts.is_on_board ? " maps on board, and sends its maps at the end to " : " sends what it senses to ") +
          (counts.edge.empty() ? "the edge that the coordinator names" : "edge " + counts.edge.str()));
    if (has_said_all(counts) && !counts.is_released && !std::exchange(waits_, true))
      progress_.say(name_ +
                    ": its edge has all; it stays until the team's map is written, since the coordinator may give it "
                    "to another edge");
  }

  void show_end(const runtime::LiveRobotCounts& counts) {
    progress_.say(
        name_ + ": its edge has all " +
        (counts.is_on_board ? "that it mapped" : std::to_string(counts.scans - counts.lost_scans) + " scans") +
        (counts.lost_scans > 0 ? "; " + std::to_string(counts.lost_scans) + " were lost" : ""));
  }

 private:
  const std::string name_;
  Progress& progress_;
  bool has_begun_ = false, waits_ = false;
};

}  // namespace

void add_role_arguments(CLI::App& role, RoleArguments& arguments, const std::string& example) {
  role.add_option("CONFIG", arguments.file, "the deployment's configuration, the same for all of its programs")
      ->required()
      ->type_name("CONFIG.yaml");
  role.add_option("--set", arguments.flags.set, "sets one option: key=value, as in " + example)
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
}

std::unique_ptr<runtime::Wires> RoleExtension::wires(const Deployment& deployment,
                                                     const std::optional<TierId>& edge) const {
  const runtime::RunConfiguration& configuration = deployment.loaded.configuration;
  if (edge) return std::make_unique<runtime::NatsWires>(configuration, *edge, kToConnect);
  return std::make_unique<runtime::NatsWires>(configuration, kToConnect);
}

ExitCode serve_robot(const RoleArguments& arguments, RoleExtension& extension) {
  StopSignals signals(StopSignals::OnHangup::reload);
  const Deployment deployment = load_deployment(arguments.file, arguments.flags);
  RunningSince since(deployment.live());
  std::vector<std::string> names;
  for (const runtime::PlannedRobot& robot : deployment.plan.robots) names.push_back(robot.id.str());
  const RobotId name(chosen("robot", arguments.name, names));
  const auto planned = std::find_if(deployment.plan.robots.begin(), deployment.plan.robots.end(),
                                    [&](const runtime::PlannedRobot& robot) { return robot.id == name; });
  std::error_code ignored;
  if (extension.has_log() && !std::filesystem::exists(planned->log, ignored))
    throw Error(ErrorCode::kMissing, "there is no log " + planned->log.string(), "robot " + name.str(),
                "robots' logs lie on their own machines; check `log` of this one");
  const std::unique_ptr<runtime::Wires> wires = extension.wires(deployment, planned->edge);
  PlanReader plans(*wires, deployment);
  extension.begin(deployment, name.str(), signals);
  StartingRobot robot(
      *planned, deployment.loaded.configuration, [&](const TierId& edge) { return wires->from_robot(name, edge)(); },
      [&](const TierId& edge, int number) { return wires->from_camera(name, number, edge)(); },
      [&] { return extension.has_log(); });
  const LogEnd log_end(robot, extension);
  const TierEnd tier_end(extension);
  const auto progress = make_terminal_progress();
  RobotLines lines(name, *progress);
  const auto status = [&] {
    const runtime::StatusTerms terms = since.terms();
    const runtime::LiveRobotCounts counts = robot.counts();
    return runtime::program_status("robot", name.str(), {runtime::tier_status(name, counts.edge, counts, terms)},
                                   terms);
  };
  StatusPublisher publisher(*wires, "robot-" + name.str(), deployment.live().keys.empty(), status);
  ServiceNotifier service;
  ConfigurationReload reload(arguments, deployment, signals);
  bool is_asked = false;
  while (!robot.is_done()) {
    if (const auto plan = plans.look()) robot.follow(*plan);
    const bool has_started = robot.look();
    publisher.publish();
    const runtime::LiveRobotCounts now = robot.counts();
    service.turn(service_turn_of(now));
    if (has_started) lines.show(now);
    if (const auto live = reload.look()) {
      robot.use(*live);
      since.use(*live);
    }
    const bool is_to_end = extension.look(robot, status) && !is_asked;
    if (has_said_all(now) && is_asked) break;
    if (!is_to_end && !signals.wait(kStep)) continue;
    if (is_asked || (!is_to_end && signals.asks_for_a_pause()))
      throw Interrupted("interrupted; " + std::to_string(robot.counts().waiting_bytes) +
                        " bytes did not get to the edge, which goes on when the robot is started again");
    is_asked = true;
    robot.end();
    extension.end_log();
    log(LogLevel::info, "robot " + name.str() + " ends its recording and sends the rest; again to end at once");
  }
  rawlog::UnsentMark(planned->log).clear();
  publisher.publish(true);
  const runtime::LiveRobotCounts counts = robot.counts();
  lines.show_end(counts);
  if (counts.trouble) throw Error(*counts.trouble);
  return ExitCode::done;
}

ExitCode serve_edge(const RoleArguments& arguments, RoleExtension& extension) {
  StopSignals signals(StopSignals::OnHangup::reload);
  Deployment deployment = load_deployment(arguments.file, arguments.flags);
  RunningSince since(deployment.live());
  std::vector<std::string> names;
  for (const TierId& edge : deployment.plan.edges) names.push_back(edge.str());
  const TierId name(chosen("edge", arguments.name, names));
  WorkerPool pool(threads_of(arguments.flags));
  const auto progress = make_terminal_progress();
  extension.begin(deployment, name.str(), signals);
  const std::unique_ptr<runtime::Wires> wires = extension.wires(deployment, name);
  const auto journal = journal_in(deployment.live(), name.str());
  {
    runtime::LiveEdge edge(name,
                           {deployment.loaded.configuration, deployment.plan, deployment.live(), pool, *progress,
                            journal, extension.shows_maps()},
                           wires->from_edge(name));
    const TierEnd tier_end(extension);
    runtime::ServedWires robots([&](std::shared_ptr<transport::Channel> channel) { edge.serve(std::move(channel)); });
    runtime::CameraWires cameras(*wires, name, edge);
    const auto add = [&](const RobotId& robot) {
      robots.add(robot.str(), wires->at_edge(robot, name));
      if (runtime::shares_cameras(deployment.loaded.configuration)) cameras.add(robot);
    };
    for (const runtime::PlannedRobot& robot : deployment.plan.robots)
      if (robot.edge == name) add(robot.id);
    PlanReader plans(*wires, deployment);
    MapReportPublisher maps(*wires, runtime::maps_word_of(name));
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
    LivePage page(page_of("mapweave serve edge " + name.str(), deployment, edge, status), deployment.live(), *progress);
    ConfigurationReload reload(arguments, deployment, signals);
    StatusPublisher publisher(*wires, "edge-" + name.str(), true, status);
    progress->say("edge " + name.str() + " waits for its robots; what it receives is kept in " + journal->string());
    ServiceNotifier service;
    while (!edge.counts().is_done) {
      follow();
      robots.keep();
      cameras.keep();
      publisher.publish();
      if (is_coordinated(deployment)) maps.publish(edge);
      service.turn(service_turn_of(edge.counts()));
      extension.look(edge, status);
      if (const auto live = reload.look()) {
        edge.use(*live);
        page.use(*live);
        since.use(*live);
      }
      if (signals.wait(kStep))
        throw Interrupted("interrupted; edge " + name.str() + " goes on from " + journal->string() +
                          " when it is started again");
    }
    publisher.publish(true);
    std::this_thread::sleep_for(1s);  // its last receipts
  }
  remove_journals(*journal);
  progress->say("edge " + name.str() + ": the cloud has written the team's map");
  return ExitCode::done;
}

ExitCode serve_cloud(const RoleArguments& arguments, RoleExtension& extension) {
  StopSignals signals(StopSignals::OnHangup::reload);
  Deployment deployment = load_deployment(arguments.file, arguments.flags);
  RunningSince since(deployment.live());
  WorkerPool pool(threads_of(arguments.flags));
  const auto progress = make_terminal_progress();
  extension.begin(deployment, runtime::cloud_tier().str(), signals);
  OwnBroker own_broker(deployment.loaded.configuration, deployment.plan, *progress);
  const std::unique_ptr<runtime::Wires> wires = extension.wires(deployment, std::nullopt);
  const auto journal = journal_in(deployment.live(), runtime::cloud_tier().str());
  std::optional<runtime::Report> report;
  {
    runtime::LiveCloud cloud({deployment.loaded.configuration, deployment.plan, deployment.live(), pool, *progress,
                              journal, extension.shows_maps()},
                             {arguments.flags.out, arguments.flags.force, true});
    const TierEnd tier_end(extension);
    runtime::ServedWires edges([&](std::shared_ptr<transport::Channel> channel) { cloud.serve(std::move(channel)); });
    for (const TierId& edge : deployment.plan.edges) edges.add(edge.str(), wires->at_cloud(edge));
    PlanReader plans(*wires, deployment);
    const auto status = [&] {
      const runtime::StatusTerms terms = since.terms();
      return runtime::program_status("cloud", "cloud", {runtime::tier_status(cloud.counts(), terms)}, terms);
    };
    LivePage page(page_of("mapweave serve cloud", deployment, cloud, status), deployment.live(), *progress);
    ConfigurationReload reload(arguments, deployment, signals);
    StatusPublisher publisher(*wires, "cloud", true, status);
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
      if (const auto live = reload.look()) {
        cloud.use(*live);
        page.use(*live);
        since.use(*live);
      }
      return extension.look(cloud, status);
    });
    publisher.publish(true);
  }
  remove_journals(*journal);
  own_broker.forget();
  return report_result(*report, arguments.flags.out, arguments.flags.json);
}

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
                                 const std::function<bool()>& now_and_then) {
  using Clock = std::chrono::steady_clock;
  bool is_asked = false;
  std::optional<runtime::Report> report;
  std::optional<Clock::time_point> end;
  while (true) {
    const bool is_to_end = now_and_then() && !is_asked;
    if (!report) report = cloud.wait(0ms);
    if (report && !end) end = Clock::now() + kToSayGoodbye;
    const runtime::LiveCloudCounts counts = cloud.counts();
    if (report && (Clock::now() >= *end || std::all_of(counts.edges.begin(), counts.edges.end(), [](const auto& edge) {
                     return edge.has_all || !edge.is_on_wire;
                   })))
      return *report;
    if (!is_to_end && !signals.wait(kStep)) continue;
    if (report) return *report;
    if (is_asked) throw Interrupted("interrupted; nothing was written");
    is_asked = true;
    asked();
  }
}

}  // namespace mapweave::app
