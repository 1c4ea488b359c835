#pragma once
// What the parts of `serve` share.

#include "configuration.h"
#include "starting_robot.h"
#include "stop_signals.h"

#include <mapweave/core/exit_code.h>
#include <mapweave/runtime/live_cloud.h>
#include <mapweave/runtime/live_coordinator.h>
#include <mapweave/runtime/live_status.h>
#include <mapweave/runtime/page_server.h>
#include <mapweave/runtime/wires.h>

#include <nlohmann/json.hpp>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace mapweave::app {

// "alpha + beta, gamma" of maps that are one.
std::string joint_in_words(const std::vector<std::vector<MapId>>& joint);

// Until the results are written and the edges know it: shows what it does. `asked`: called once, when the user wants an
// end. now_and_then: true where an end is asked for. Throws Interrupted where the user asks again.
runtime::Report wait_for_results(runtime::LiveCloud& cloud, StopSignals& signals, const std::function<void()>& asked,
                                 const std::function<bool()>& now_and_then);

// Since when a program runs, and who is missing for it.
class RunningSince {
 public:
  explicit RunningSince(const runtime::LiveOptions& live) : patience_s_(live.patience_s) {}
  void use(const runtime::LiveOptions& live) { patience_s_ = live.patience_s; }
  runtime::StatusTerms terms() const {
    return {patience_s_, std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count()};
  }

 private:
  std::atomic<double> patience_s_;
  std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
};

// A configuration of programs that run by themselves; logs lie with their robots.
struct Deployment {
  LoadedConfiguration loaded;
  runtime::RunPlan plan;
  const runtime::LiveOptions& live() const { return loaded.configuration.live; }
};
Deployment load_deployment(const std::filesystem::path& file, const WritingFlags& flags);

// Says every two seconds how a program is, for who asks (mapweave doctor).
class StatusPublisher {
 public:
  // makes: the stream at the broker where it is missing; robots with accounts may not.
  StatusPublisher(const runtime::Wires& wires, std::string user, bool makes,
                  std::function<nlohmann::ordered_json()> status)
      : board_(wires.board()), user_(std::move(user)), makes_(makes), status_(std::move(status)) {}
  void publish(bool at_once = false);  // now and then

 private:
  std::shared_ptr<transport::Board> board_;
  std::string user_;
  bool makes_;
  std::function<nlohmann::ordered_json()> status_;
  std::chrono::steady_clock::time_point next_{};
  int times_ = 0;
};

bool is_coordinated(const Deployment& deployment);

// The coordinator's plan, for those who follow it.
class PlanReader {
 public:
  PlanReader(const runtime::Wires& wires, const Deployment& deployment)
      : plans_(wires.plans()), of_(deployment.plan), is_coordinated_(is_coordinated(deployment)) {}
  // Now and then: a newer one than before.
  std::optional<runtime::LivePlan> look();

 private:
  std::shared_ptr<transport::Board> plans_;
  const runtime::RunPlan& of_;
  bool is_coordinated_, has_warned_ = false;
  std::uint64_t number_ = 0;
  std::chrono::steady_clock::time_point next_{};
};

// What an edge says to the coordinator of its robots' maps.
class MapReportPublisher {
 public:
  MapReportPublisher(const runtime::Wires& wires, std::string name) : board_(wires.board()), name_(std::move(name)) {}
  void publish(const runtime::LiveEdge& edge);  // now and then

 private:
  std::shared_ptr<transport::Board> board_;
  const std::string name_;
  std::string said_;
  std::chrono::steady_clock::time_point next_{}, again_{};
};

// What a page shows of maps and robots; `status` and `preview` are its program's to add.
runtime::PageSource page_of(const std::string& title, const runtime::RunConfiguration&, const runtime::RunPlan&);
// Shows it, and says where; warns where others than this machine reach it. port 0: any that is free.
std::unique_ptr<runtime::PageServer> show_page(const std::string& host, int port, runtime::PageSource, Progress&);

// The page of a program that runs, where its options want one.
class LivePage {
 public:
  LivePage(runtime::PageSource source, const runtime::LiveOptions& live, Progress& progress);  // throws as show_page()
  // Moves it. What keeps it from being shown there is logged.
  void use(const runtime::LiveOptions& live);

 private:
  void show();

  const runtime::PageSource source_;
  Progress& progress_;
  std::string host_;
  int port_;
  std::unique_ptr<runtime::PageServer> page_;
};

// Which of a deployment's programs this one is.
struct RoleArguments {
  std::filesystem::path file;
  std::string name;
  WritingFlags flags;
};

// What the command line of each says of it. example: of an option that is set.
void add_role_arguments(CLI::App& role, RoleArguments& arguments, const std::string& example);

// What another program adds to a role. Called by the thread that serves.
class RoleExtension {
 public:
  using Status = std::function<nlohmann::ordered_json()>;
  RoleExtension() = default;
  virtual ~RoleExtension() = default;
  RoleExtension(const RoleExtension&) = delete;
  RoleExtension& operator=(const RoleExtension&) = delete;

  // What carries its messages. edge: at whose broker it is; none: at the cloud's. By default, and where `live.broker`
  // is not "ros", a NATS server.
  virtual std::unique_ptr<runtime::Wires> wires(const Deployment& deployment, const std::optional<TierId>& edge) const;
  // Before the tier is made. name: the robot or edge that it is.
  virtual void begin(const Deployment&, const std::string& /*name*/, StopSignals&) {}
  // Now and then. True: the tier is asked to end as if Ctrl-C were pressed: a robot its drive, a cloud the collecting.
  virtual bool look(const StartingRobot&, const Status&) { return false; }
  virtual bool look(runtime::LiveEdge&, const Status&) { return false; }
  virtual bool look(runtime::LiveCloud&, const Status&) { return false; }
  virtual bool look(runtime::LiveCoordinator&, const Status&) { return false; }
  // What look() was given ends, after begin(): nothing may use it, or the status, from now on.
  virtual void leave_tier() {}
  virtual bool shows_maps() const { return false; }  // an edge's and a cloud's previews are to be kept
  virtual bool has_log() const { return true; }      // of the robot: it is there, though it may still be written
  // The drive ends: whoever writes the robot's log finishes it.
  virtual void end_log() {}
  // The program ends: whoever writes the log closes it; an unfinished one is gone on with.
  virtual void leave_log() {}
};

// Lets the extension go of a tier before that ends; to be made after it.
class TierEnd {
 public:
  explicit TierEnd(RoleExtension& extension) : extension_(extension) {}
  ~TierEnd() { extension_.leave_tier(); }
  TierEnd(const TierEnd&) = delete;
  TierEnd& operator=(const TierEnd&) = delete;

 private:
  RoleExtension& extension_;
};

ExitCode serve_robot(const RoleArguments&, RoleExtension&);
// What standard input brings becomes the robot's log, and is sent to its edge as it comes.
ExitCode serve_robot_by_input(RoleArguments arguments);
ExitCode serve_edge(const RoleArguments&, RoleExtension&);
ExitCode serve_cloud(const RoleArguments&, RoleExtension&);

// serve coordinator: decides until the team's map is written; its plans are kept in plan.json of the
// output folder.
ExitCode serve_coordinator(const RoleArguments&, RoleExtension&);

// serve demo: all of it on this machine.
struct DemoArguments {
  std::filesystem::path out = "mapweave-demo";
  bool force = false, json = false;
  double speed = 1.0;
  int port = 0;  // of its page; 0: any that is free
};
ExitCode serve_demo(const DemoArguments& arguments);

// serve keys: for a broker on a machine with these names or addresses. What the folder holds already stays.
struct KeysArguments {
  std::vector<std::string> hosts;
  int port = 4222, leaf_port = 7422;
  std::filesystem::path out;
};
ExitCode make_keys(const Deployment& deployment, const KeysArguments& arguments);

}  // namespace mapweave::app
