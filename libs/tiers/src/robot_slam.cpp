#include <mapweave/tiers/robot_slam.h>

namespace mapweave::tiers {

RobotSlam::RobotSlam(RobotId robot, std::unique_ptr<laser::LaserMapper> mapper) : robot_(robot), mapper_(std::move(mapper)) {}

std::optional<RobotOutcome> RobotSlam::step(const RobotMessage& message) {
  if (mapper_ == nullptr || message.sequence < expected_) return std::nullopt;
  try {
    return act(message);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInterrupted) throw;
    return failed(error);
  } catch (const std::exception& error) {
    return failed(Error(ErrorCode::kInternal, error.what(), "robot " + robot_.str()));
  }
}

std::optional<RobotOutcome> RobotSlam::act(const RobotMessage& message) {
  if (message.sequence != expected_)
    return finished(Error(ErrorCode::kBadInput,
                          "messages " + std::to_string(expected_) + " to " + std::to_string(message.sequence - 1) + " never came",
                          "robot " + robot_.str(), "replay the robot's own log"));
  ++expected_;
  if (const auto* end = std::get_if<StreamEnd>(&message.body)) return finished(end->trouble);
  mapper_->add(std::get<laser::LaserInput>(message.body));
  anything_ = true;
  return std::nullopt;
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
    } catch (const Error& error) {
      if (error.code() == ErrorCode::kInterrupted || !outcome.trouble) throw;  // else the first trouble is the cause
    }
  }
  outcome.helper_cpu_seconds = mapper_->helper_cpu_seconds();
  mapper_.reset();
  return outcome;
}

}  // namespace mapweave::tiers
