#include "lasers_in_step.h"
#include "coordinated_robots.h"
#include "team/fusion_rounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace mapweave::runtime {

// A part of a log begins when its robot has come so far.
LasersInStep::LasersInStep(const RunConfiguration& configuration, const RunPlan& plan, bool keep_going, bool may_move,
                           Progress& progress)
    : keep_going_(keep_going) {
  for (const PlannedRobot& robot : plan.robots)
    if (robot.sensors.scans != nullptr && !robot.trouble) robots_.push_back(&robot);
  std::map<RobotId, Stamp> first;  // of each robot's log
  for (const PlannedRobot* robot : robots_) {
    tasks_.emplace_back(*robot, configuration_of(configuration, *robot), keep_going, may_move, progress);
    begin_.push_back(tasks_.back().next());
    from_s_.push_back(robot_entry(configuration, robot->robot()).from_s);
    if (!begin_.back()) continue;
    Stamp& earliest = first.emplace(robot->robot(), *begin_.back()).first->second;
    earliest = std::min(earliest, *begin_.back());
  }
  for (std::size_t i = 0; i < tasks_.size(); ++i)
    if (begin_[i] && robots_[i]->part) from_s_[i] += seconds_between(first.at(robots_[i]->robot()), *begin_[i]);
  expect_no_trouble();
}

LaserTask* LasersInStep::task_of(const RobotId& robot) {
  for (std::size_t i = 0; i < robots_.size(); ++i)
    if (robots_[i]->id == robot) return &tasks_[i];
  return nullptr;
}

void LasersInStep::expect_no_trouble() const {
  for (const LaserTask& task : tasks_)
    if (task.trouble() && !keep_going_ && task.trouble()->code() != ErrorCode::kHelperFailed) throw *task.trouble();
}

double LasersInStep::due_s() const {
  double due_s = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < tasks_.size(); ++i)
    if (const auto next = tasks_[i].next()) due_s = std::min(due_s, from_s_[i] + seconds_between(*begin_[i], *next));
  return due_s;
}

void LasersInStep::advance(double until_s, WorkerPool& pool) {
  pool.for_each(tasks_.size(), [&](std::size_t i) {
    if (tasks_[i].next() && has_come(i, until_s))
      tasks_[i].advance(Stamp{begin_[i]->ns + static_cast<std::int64_t>(1e9 * (until_s - from_s_[i]))}, give_up_);
  });
  expect_no_trouble();
}

std::map<RobotId, LaserOutcome> LasersInStep::finish(WorkerPool& pool) {
  std::vector<LaserOutcome> finished = pool.map(tasks_.size(), [&](std::size_t i) { return tasks_[i].finish(); });
  std::map<RobotId, LaserOutcome> outcomes;
  for (std::size_t i = 0; i < tasks_.size(); ++i) outcomes.emplace(robots_[i]->id, std::move(finished[i]));
  return outcomes;
}

std::map<RobotId, LaserOutcome> map_in_step(LasersInStep& lasers, CoordinatedRobots* coordinated, FusionRounds* rounds,
                                            WorkerPool& pool) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  // Chosen when the last of its kind is over: it comes though others have read the last records meanwhile.
  const auto next = [&](auto* who) {
    const double due_s = lasers.due_s();
    return who == nullptr || std::isinf(due_s) ? kNever : who->next_s(due_s);
  };
  double decision_s = next(coordinated), round_s = next(rounds);
  for (;;) {
    const double now_s = std::min(decision_s, round_s);
    if (std::isinf(now_s)) break;
    lasers.advance(now_s, pool);
    if (decision_s == now_s) {
      coordinated->step(now_s, lasers, pool);
      decision_s = next(coordinated);
    }
    if (round_s == now_s) {
      rounds->step(now_s, lasers, pool);
      round_s = next(rounds);
    }
  }
  return lasers.finish(pool);
}

}  // namespace mapweave::runtime
