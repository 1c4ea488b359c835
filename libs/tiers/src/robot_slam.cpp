#include <mapweave/tiers/robot_slam.h>

namespace mapweave::tiers {

RobotSlam::RobotSlam(RobotId robot, std::unique_ptr<laser::LaserMapper> mapper)
    : robot_(robot), mapper_(std::move(mapper)) {}

std::optional<RobotOutcome> RobotSlam::step(Sensed sensed) {
  if (mapper_ == nullptr || sensed.sequence < expected_) return std::nullopt;
  try {
    return act(std::move(sensed));
  } catch (const Error& error) {
    return failed(error);
  } catch (const std::exception& error) {
    return failed(Error(ErrorCode::kInternal, error.what(), "robot " + robot_.str()));
  }
}

std::optional<RobotOutcome> RobotSlam::act(Sensed sensed) {
  if (sensed.sequence != expected_)
    return finished(
        Error(ErrorCode::kBadInput,
              "messages " + std::to_string(expected_) + " to " + std::to_string(sensed.sequence - 1) + " never came",
              "robot " + robot_.str(), "replay the robot's own log"));
  ++expected_;
  if (const auto* end = std::get_if<StreamEnd>(&sensed.body)) return finished(end->trouble);
  if (std::holds_alternative<LostScan>(sensed.body)) return std::nullopt;
  if (std::holds_alternative<MappedPart>(sensed.body))
    throw Error(ErrorCode::kBadInput, "it maps on board and sends what it senses, too", "robot " + robot_.str());
  if (auto* scan = std::get_if<PackedScan>(&sensed.body)) {
    if (geometry_ != nullptr && *geometry_ == *scan->geometry) scan->geometry = geometry_;
    geometry_ = scan->geometry;
    mapper_->add(laser::ScanInput{sensed.stamp, std::move(*scan)});
  } else if (const auto* inertial = std::get_if<InertialYaw>(&sensed.body)) {
    mapper_->add(laser::InertialInput{sensed.stamp, inertial->yaw_rad});
    return std::nullopt;  // no map comes of it alone
  } else {
    mapper_->add(laser::OdometryInput{sensed.stamp, std::get<Pose3>(sensed.body)});
  }
  anything_ = true;
  return std::nullopt;
}

std::vector<laser::LivePose> RobotSlam::take_live_poses() {
  return mapper_ != nullptr ? mapper_->take_live_poses() : std::vector<laser::LivePose>{};
}

Map RobotSlam::map_so_far() {
  if (mapper_ == nullptr || !anything_) return {};
  try {
    mapper_->catch_up();
  } catch (const Error&) {
    return {};
  }
  return mapper_->snapshot();
}

RobotOutcome RobotSlam::failed(Error trouble) {
  RobotOutcome outcome{robot_, std::nullopt, std::move(trouble), mapper_->helper_cpu_seconds()};
  mapper_.reset();
  return outcome;
}

RobotOutcome RobotSlam::finished(std::optional<Error> trouble) {
  RobotOutcome outcome{robot_, std::nullopt, std::move(trouble)};
  if (anything_) {
    try {
      mapper_->finish();
      Map map = mapper_->snapshot();
      if (!map.empty()) outcome.map = std::move(map);
      outcome.notes = mapper_->notes();
    } catch (const Error&) {
      if (!outcome.trouble) throw;  // else the first trouble is the cause
    }
  }
  outcome.helper_cpu_seconds = mapper_->helper_cpu_seconds();
  mapper_.reset();
  return outcome;
}

}  // namespace mapweave::tiers
