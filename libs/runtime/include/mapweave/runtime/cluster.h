#pragma once
// A run spread over workers, programs on this and other machines. A robot is one task: a worker reads its log, maps it,
// and sends the maps and what there is to say of them; the run goes on with these as if it had mapped itself. So are
// pairs of maps that are judged before edges and the cloud merge, and a dense map (output.ply, output.octomap).

#include <mapweave/core/progress.h>
#include <mapweave/runtime/live_robot.h>
#include <mapweave/runtime/robot_task.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/transport/channel.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::runtime {

// How a run reaches workers. Called on one thread.
struct Cluster {
  std::function<std::vector<std::string>()> idle_workers;  // names of those that said lately that they are there
  std::function<std::shared_ptr<transport::Channel>(const std::string& worker)> open;
  double patience_s = 15.0;  // a worker that is silent for longer is given up, and its task goes to another one
};

// Throws Error(kBadInput), naming the key, for runs whose robots cannot be mapped each for itself: cameras that share
// while they map, a coordinator, rounds, several edges of one robot.
void expect_cluster(const RunConfiguration& configuration, const RunPlan& plan);

// Every robot of the plan, whose sensors are chosen. Waits for workers without end, and says so. nullopt for those that
// an interruption left. Throws Error where no idle worker can map a robot.
std::vector<std::optional<RobotResult>> map_on_cluster(const RunConfiguration& configuration, const RunPlan& plan,
                                                       const Cluster& cluster, Progress& progress);

// Does one task after another for whoever asks. Not thread-safe; a thread of its own works.
class Worker {
 public:
  // accept: a new channel to whoever asks next. logs: where robots' logs are looked for by name, before the path that
  // the run says; empty: nowhere else.
  Worker(std::string name, Connect accept, std::filesystem::path logs);
  ~Worker();

  void step();  // every few milliseconds
  bool is_busy() const;
  struct Counts {
    std::uint64_t mapped = 0, judged = 0, drawn = 0;  // tasks, by their kinds
    std::uint64_t failed = 0, given_up = 0;           // given up: the run that asked is gone
    std::string task;                                 // of now, for people; empty: none
  };
  Counts counts() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::runtime
