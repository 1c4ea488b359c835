#pragma once
// Lasers of a team whose edges a coordinator chooses (RecSLAM III-D), in moments of data time: maps grow, edges and
// wires come and go, and robots move. The same bytes for any number of threads.

#include "lasers_in_step.h"

#include <mapweave/runtime/report.h>

#include <map>

namespace mapweave::runtime {

// As the configuration has them. Throws what reading a model throws.
tiers::CoordinatorOptions coordinator_options(const RunConfiguration&, const RunPlan& plan);
std::string coordination_method(const RunConfiguration&);  // "default"
// What is announced of a robot: its route.
RobotComes announced(const RobotEntry& entry, const RobotId& robot, const TierId& edge, double route_range_m);

class CoordinatedRobots {
 public:
  // Decides a first time, with what is announced: `plan` then names each robot's edge. Plan and configuration must
  // outlive it. Throws what Coordinator::decide and reading a model throw.
  CoordinatedRobots(const RunConfiguration&, RunPlan& plan);

  // When it acts next, where the next record is due then: nothing happens in between.
  double next_s(double due_s) const;
  // What it does at this time, with all records read that come before: robots report and come, edges and wires change,
  // and it decides. `plan` then names the edges that robots are on.
  void step(double now_s, LasersInStep& lasers, WorkerPool& pool);

  CoordinationReport take_report() { return std::move(report_); }

 private:
  void send(const CoordinatorEvent& event);  // by its bytes
  void report_robots(double now_s);          // those that come
  void report_edges_and_wires(double now_s);
  transport::LinkState link(const std::string& from, const std::string& to,
                            const transport::LinkModelOptions& otherwise, double now_s);
  std::string cloud_place() const;  // the edge that stands for it, or its own name
  double summary_seconds(const RobotId& robot, std::size_t bytes, double now_s);
  void decide(double now_s, LasersInStep& lasers, WorkerPool&);
  bool decide(double now_s);

  const RunConfiguration& configuration_;
  RunPlan& plan_;
  tiers::Coordinator coordinator_;
  std::map<std::pair<std::string, std::string>, transport::LinkModel> wires_;
  std::vector<bool> has_ended_;  // robots that sensed all before the last step
  CoordinationReport report_;
};

}  // namespace mapweave::runtime
