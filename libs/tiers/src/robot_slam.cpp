#include <mapweave/tiers/robot_slam.h>

namespace mapweave::tiers {

RobotSlam::RobotSlam(RobotId robot, std::unique_ptr<laser::LaserMapper> mapper) : robot_(robot), mapper_(std::move(mapper)) {}

std::optional<RobotOutcome> RobotSlam::step(const RobotMessage& message) {
  if (mapper_ == nullptr || message.sequence < expected_) return std::nullopt;
  try {
    return act(message);
  } catch (const Error& error) {
    mapper_.reset();
    if (error.code() == ErrorCode::kInterrupted) throw;
    return RobotOutcome{robot_, std::nullopt, error};
  } catch (const std::exception& error) {
    mapper_.reset();
    return RobotOutcome{robot_, std::nullopt, Error(ErrorCode::kInternal, error.what(), "robot " + robot_.str())};
  }
}

std::optional<RobotOutcome> RobotSlam::act(const RobotMessage& message) {
  if (message.sequence != expected_)
    return finished(Error(ErrorCode::kBadInput,
                          "messages " + std::to_string(expected_) + " to " + std::to_string(message.sequence - 1) + " never came", "robot " + robot_.str(),
                          "replay the robot's own log"));
  ++expected_;
  if (const auto* end = std::get_if<StreamEnd>(&message.body)) return finished(end->trouble);
  mapper_->add(std::get<laser::LaserInput>(message.body));
  anything_ = true;
  return std::nullopt;
}

RobotOutcome RobotSlam::finished(std::optional<Error> trouble) {
  RobotOutcome outcome{robot_, std::nullopt, std::move(trouble)};
  const std::unique_ptr<laser::LaserMapper> mapper = std::move(mapper_);
  if (!anything_) return outcome;
  try {
    mapper->finish();
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInterrupted || !outcome.trouble) throw;
    return outcome;  // the first trouble is the cause
  }
  Map map = mapper->snapshot();
  if (!map.empty()) outcome.map = std::move(map);
  return outcome;
}

}  // namespace mapweave::tiers
