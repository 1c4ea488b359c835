#include "starting_robot.h"

#include <mapweave/core/error.h>
#include <mapweave/core/worker_pool.h>
#include <mapweave/runtime/sensor_choice.h>

#include <utility>

namespace mapweave::app {
namespace {

runtime::PlannedRobot with_sensors(runtime::PlannedRobot robot, const runtime::RunConfiguration& configuration) {
  runtime::RunPlan plan;
  plan.robots.push_back(std::move(robot));
  WorkerPool alone(1);
  runtime::choose_sensors(plan, configuration, alone);
  return std::move(plan.robots.front());
}

}  // namespace

StartingRobot::StartingRobot(runtime::PlannedRobot robot, const runtime::RunConfiguration& configuration,
                             runtime::ConnectToEdge to_edge, runtime::ConnectCamera to_camera_map_server,
                             std::function<bool()> has_log)
    : id_(robot.id),
      robot_(std::move(robot)),
      configuration_(configuration),
      to_edge_(std::move(to_edge)),
      to_camera_map_server_(std::move(to_camera_map_server)),
      has_log_(std::move(has_log)),
      options_(configuration.live) {}

// False: there is nothing to look into yet.
bool StartingRobot::look_into_log() {
  if (!looks_.valid()) {
    if (!has_log_ || has_log_()) {
      looks_ = std::async(std::launch::async, with_sensors, robot_, std::cref(configuration_));
    } else if (ends_) {
      robot_.trouble = Error(ErrorCode::kBadInput, "it has sensed nothing", "robot " + robot_.id.str(),
                             "check that its sensors publish");
      robot_.sensors.scans = &runtime::kLaser;
      return true;
    }
    return false;
  }
  if (looks_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return false;
  robot_ = looks_.get();
  return true;
}

bool StartingRobot::look() {
  const std::lock_guard lock(mutex_);
  if (started_) return true;
  if (!look_into_log()) return false;
  if (robot_.trouble && robot_.trouble->code() == ErrorCode::kMissing) throw Error(*robot_.trouble);
  runtime::LiveOptions live = options_;
  if (configuration_.reading.follow) live.speed = 0.0;  // it comes at the speed at which it is sensed
  started_.emplace(robot_, configuration_, live, std::move(to_edge_), std::move(to_camera_map_server_));
  if (plan_) started_->follow(*plan_);
  if (ends_ && !configuration_.reading.follow) started_->end();
  return true;
}

void StartingRobot::end() {
  const std::lock_guard lock(mutex_);
  ends_ = true;
  if (started_ && !configuration_.reading.follow) started_->end();
}

void StartingRobot::leave() {
  const std::lock_guard lock(mutex_);
  if (started_) started_->leave();
}

void StartingRobot::follow(const runtime::LivePlan& plan) {
  const std::lock_guard lock(mutex_);
  plan_ = plan;
  if (started_) started_->follow(plan);
}

void StartingRobot::use(const runtime::LiveOptions& options) {
  const std::lock_guard lock(mutex_);
  options_.take_while_running(options);
  if (started_) started_->use(options);
}

bool StartingRobot::is_done() const {
  const std::lock_guard lock(mutex_);
  return started_ && started_->is_done();
}

runtime::LiveRobotCounts StartingRobot::counts() const {
  const std::lock_guard lock(mutex_);
  if (started_) return started_->counts();
  runtime::LiveRobotCounts none;
  none.edge = robot_.edge;
  return none;
}

}  // namespace mapweave::app
