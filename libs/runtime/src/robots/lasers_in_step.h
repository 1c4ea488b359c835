#pragma once
// The lasers of a team, driven together through the team's time: for who looks at their maps while they grow. The same
// maps as by one robot after the other.

#include <mapweave/core/worker_pool.h>
#include <mapweave/runtime/laser_task.h>

#include <atomic>
#include <map>
#include <optional>
#include <vector>

namespace mapweave::runtime {

class CoordinatedRobots;
class FusionRounds;

class LasersInStep {
 public:
  // Opens all logs. `may_move`: as of LaserTask. Throws, without `keep_going`, the first trouble with a log.
  LasersInStep(const RunConfiguration&, const RunPlan&, bool keep_going, bool may_move, Progress&);

  std::size_t size() const { return tasks_.size(); }
  const PlannedRobot& robot(std::size_t i) const { return *robots_[i]; }
  LaserTask& task(std::size_t i) { return tasks_[i]; }
  LaserTask* task_of(const RobotId& robot);  // null where it has no laser
  // The team's time. Who has no data never comes.
  bool has_come(std::size_t i, double now_s) const { return begin_[i] && now_s > from_s_[i]; }
  double due_s() const;                       // of the next record; infinite: there is none
  void advance(double until_s, WorkerPool&);  // all records before. Throws as the constructor, and Interrupted
  std::map<RobotId, LaserOutcome> finish(WorkerPool&);

 private:
  void expect_no_trouble() const;
  const bool keep_going_;
  const std::atomic<bool> give_up_{false};
  std::vector<const PlannedRobot*> robots_;
  std::vector<LaserTask> tasks_;
  std::vector<std::optional<Stamp>> begin_;  // of each robot's own data
  std::vector<double> from_s_;
};

// Drives them to the ends of their logs; a coordinator and rounds (each may be null) act at their times.
std::map<RobotId, LaserOutcome> map_in_step(LasersInStep&, CoordinatedRobots*, FusionRounds*, WorkerPool&);

}  // namespace mapweave::runtime
