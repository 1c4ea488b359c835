#pragma once
// Lasers of a team whose edges a coordinator chooses (RecSLAM III-D), in moments of data time: maps grow, edges and
// wires come and go, and robots move. The same bytes for any number of threads.

#include <mapweave/runtime/laser_task.h>
#include <mapweave/runtime/report.h>

#include <map>

namespace mapweave::runtime {

class CoordinatedRobots {
 public:
  // Decides a first time, with what is announced: `plan` then names each robot's edge. Plan and configuration must
  // outlive it. Throws what Coordinator::decide and reading a model throw.
  CoordinatedRobots(const RunConfiguration&, RunPlan& plan);

  // Drives all robots with a laser to the ends of their logs; `plan` then names the edges that they ended on. Throws
  // Interrupted, and without `keep_going` the first trouble with a log.
  std::map<RobotId, LaserOutcome> map_lasers(bool keep_going, WorkerPool&, Progress&);

  CoordinationReport take_report() { return std::move(report_); }

 private:
  void send(const CoordinatorEvent& event);  // by its bytes
  void report_robots(double now_s);          // those that come
  void report_edges_and_wires(double now_s);
  transport::LinkState link(const std::string& from, const std::string& to,
                            const transport::LinkModelOptions& otherwise, double now_s);
  double summary_seconds(const RobotId& robot, std::size_t bytes, double now_s);
  void decide(double now_s, std::map<RobotId, LaserTask>& tasks, WorkerPool&);
  bool decide(double now_s);

  const RunConfiguration& configuration_;
  RunPlan& plan_;
  tiers::Coordinator coordinator_;
  std::map<std::pair<std::string, std::string>, transport::LinkModel> wires_;
  CoordinationReport report_;
};

}  // namespace mapweave::runtime
