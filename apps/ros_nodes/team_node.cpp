#include "team_node.h"

#include "ros_names.h"

#include "roles.h"

#include <local_team.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>

#include <nlohmann/json.hpp>

#include <map>
#include <memory>
#include <utility>

namespace mapweave::ros_nodes {
namespace {

namespace fs = std::filesystem;

// Beside the results: the recordings, the configuration with which they can be mapped again, and what a team that was
// killed goes on with.
fs::path beside(const fs::path& out, const char* suffix) {
  fs::path path = out.lexically_normal();
  if (!path.has_filename()) path = path.parent_path();
  return path += suffix;
}

// Of a team that is named by its robots alone.
fs::path configuration_of_robots(const TeamArguments& arguments) {
  const fs::path folder = beside(arguments.flags.out, ".logs");
  fs::create_directories(folder);
  std::string text = "robots:\n";
  for (const std::string& robot : arguments.robots) text += "  - {id: " + robot + ", log: " + robot + ".mcap}\n";
  fs::path file = folder / "run.yaml";
  write_file(file, text);
  return file;
}

// The recorders of all robots.
class Recorders {
 public:
  Recorders(RosNode& node, const app::Deployment& deployment) {
    for (const runtime::PlannedRobot& robot : deployment.plan.robots)
      by_robot_[robot.id] = std::make_unique<TopicRecorder>(node.handle(), robot, deployment.loaded.configuration);
  }
  ~Recorders() = default;
  Recorders(const Recorders&) = delete;
  Recorders& operator=(const Recorders&) = delete;

  bool has_log(const RobotId& robot) const { return by_robot_.at(robot)->is_recording(); }
  void look() {
    for (auto& [robot, recorder] : by_robot_) recorder->look();
  }
  void finish(const RobotId& robot) { by_robot_.at(robot)->finish(); }
  void finish() {
    for (auto& [robot, recorder] : by_robot_) recorder->finish();
  }
  void leave() {
    for (auto& [robot, recorder] : by_robot_) recorder->leave();
  }
  void sent() {
    for (auto& [robot, recorder] : by_robot_) recorder->sent();
  }

 private:
  std::map<RobotId, std::unique_ptr<TopicRecorder>> by_robot_;
};

// What of the team is seen and asked for over ROS.
class TeamTopics {
 public:
  TeamTopics(RosNode& node, app::LocalTeam& team, const fs::path& store)
      : requests_(
            node, {team.configuration(), team.plan()}, store / "requests.json",
            [&team] { return team.cloud().preview(); },
            [&team](const runtime::LiveRequests& requests) {
              bool is_in_time = team.cloud().follow(requests);
              for (const TierId& edge : team.plan().edges) is_in_time = team.edge(edge).follow(requests) && is_in_time;
              return is_in_time;
            }),
        end_(node, "team/finish", "all robots end their drives") {
    for (const TierId& edge : team.plan().edges) {
      TierOfTeam tier{edge.str(), {}, false};
      for (const runtime::PlannedRobot& robot : team.plan().robots)
        if (robot.edge == edge) tier.robots.push_back(robot.id);
      tiers_.push_back(std::make_unique<TierTopics>(
          node, team.configuration(), team.plan(), tier,
          TierTopics::Maps{[&team, edge] { return team.edge(edge).preview(); },
                           [&team, edge](const RobotId& robot) { return team.edge(edge).map_so_far(robot); }}));
    }
    tiers_.push_back(std::make_unique<TierTopics>(node, team.configuration(), team.plan(),
                                                  TierOfTeam{runtime::cloud_tier().str(), {}, true},
                                                  TierTopics::Maps{[&team] { return team.cloud().preview(); }, {}}));
    for (const runtime::PlannedRobot& robot : team.plan().robots) {
      const std::string name = RosNames({robot.id.str()}).of(robot.id.str());
      robots_[robot.id] =
          std::make_unique<EndService>(node, name + "/finish", "robot " + robot.id.str() + " ends its drive");
    }
  }

  bool is_end_asked() const { return end_.is_asked(); }
  bool is_end_asked(const RobotId& robot) const { return robots_.at(robot)->is_asked(); }

 private:
  RequestsServer requests_;
  EndService end_;
  std::map<RobotId, std::unique_ptr<EndService>> robots_;
  std::vector<std::unique_ptr<TierTopics>> tiers_;
};

}  // namespace

ExitCode serve_team(const TeamArguments& arguments) {
  app::StopSignals stops;
  app::Deployment deployment = app::load_deployment(
      arguments.file.empty() ? configuration_of_robots(arguments) : arguments.file, arguments.flags);
  const app::RunningSince since(deployment.live());
  const auto progress = make_terminal_progress();
  const fs::path store = beside(arguments.flags.out, ".store");
  fs::create_directories(store);
  RosNode node(stops);
  Recorders recorders(node, deployment);
  app::LocalTeam team(deployment.loaded.configuration, deployment.plan, store,
                      {arguments.flags.out, arguments.flags.force, true}, *progress,
                      [&](const RobotId& robot) { return recorders.has_log(robot); });
  // Recorders end first: a robot waits for its log's end, and must not take this one for the drive's.
  struct LogsEnd {
    app::LocalTeam& team;
    Recorders& recorders;
    ~LogsEnd() {
      team.leave();
      recorders.leave();
    }
  } const logs_end{team, recorders};
  const auto status = [&] { return team.status("team", since.terms()); };
  std::unique_ptr<runtime::PageServer> page;
  if (arguments.port >= 0) {
    runtime::PageSource source = app::page_of("mapweave_ros team", team.configuration(), team.plan());
    source.preview = [&] { return team.cloud().preview(); };
    source.status = status;
    page = app::show_page(team.configuration().live.page_host, arguments.port, std::move(source), *progress);
  }
  TeamTopics topics(node, team, store);
  const DiagnosticsPublisher diagnostics(node.handle(), status);
  // A timer's callback may still run when roscpp has destroyed the timer, and would use what is destroyed next.
  struct CallbacksEnd {
    RosNode& node;
    ~CallbacksEnd() { node.stop(); }
  } const callbacks_end{node};
  progress->say("it waits for the topics of " + std::to_string(team.robots().size()) +
                " robots; Ctrl-C ends the drives and writes the map, and again ends at once");
  const runtime::Report report = app::wait_for_results(
      team.cloud(), stops,
      [&] {
        if (stops.asks_for_a_pause())
          throw Interrupted("interrupted; the team goes on from " + store.string() + " when it is started again");
        recorders.finish();
        team.end();
      },
      [&] {
        node.keep();
        for (const runtime::PlannedRobot& robot : team.plan().robots)
          if (topics.is_end_asked(robot.id)) recorders.finish(robot.id);
        recorders.look();
        team.look();
        return topics.is_end_asked();
      });
  recorders.sent();
  std::error_code ignored;
  fs::remove_all(store, ignored);
  return app::report_result(report, arguments.flags.out, arguments.flags.json);
}

}  // namespace mapweave::ros_nodes
