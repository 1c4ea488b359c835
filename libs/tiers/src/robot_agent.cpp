#include <mapweave/tiers/robot_agent.h>

namespace mapweave::tiers {

RobotAgent::RobotAgent(RobotId robot, laser::ScanInputOptions options, std::string stream)
    : robot_(robot),
      stream_(stream.empty() ? "robot " + robot.str() : std::move(stream)),
      packer_(std::move(options)) {}

std::optional<Sensed> RobotAgent::step(const rawlog::Record& record) {
  MAPWEAVE_EXPECT(!ended_, "the stream of robot '" + robot_.str() + "' has ended");
  std::optional<laser::LaserInput> input = packer_(record);
  if (!input) return std::nullopt;
  const Stamp stamp = std::visit([](const auto& any) { return any.stamp; }, *input);
  if (latest_ && stamp < *latest_ && std::holds_alternative<laser::InertialInput>(*input))
    return std::nullopt;  // not worth a stream
  if (latest_ && stamp < *latest_)
    throw Error(ErrorCode::kBadInput,
                "time runs backwards: a stamp of " + std::to_string(stamp.seconds()) + " s after one of " +
                    std::to_string(latest_->seconds()) + " s",
                stream_, "repair the clock of the recording, or run with --keep-going to keep what came before");
  latest_ = stamp;
  if (std::holds_alternative<laser::ScanInput>(*input)) {
    if (scans_++ == 0) first_ = stamp;
    last_ = stamp;
  }
  Sensed sensed{robot_, ++sequence_, stamp, {}};
  if (auto* scan = std::get_if<laser::ScanInput>(&*input))
    sensed.body = std::move(scan->scan);
  else if (const auto* inertial = std::get_if<laser::InertialInput>(&*input))
    sensed.body = InertialYaw{inertial->yaw_rad};
  else
    sensed.body = std::get<laser::OdometryInput>(*input).odometry_from_robot;
  return sensed;
}

Sensed RobotAgent::end(std::optional<Error> trouble) {
  MAPWEAVE_EXPECT(!ended_, "the stream of robot '" + robot_.str() + "' has ended");
  ended_ = true;
  if (!trouble && scans_ == 0) {
    std::string others;
    for (const auto& [label, count] : packer_.ignored_lasers())
      others += (others.empty() ? "" : ", ") + label + " (" + std::to_string(count) + ")";
    trouble = Error(
        ErrorCode::kBadInput,
        "there is no usable laser scan in the log" + (others.empty() ? "" : "; it has lasers labelled " + others),
        stream_,
        others.empty() ? "look at the log with: mapweave inspect LOG" : "choose one with --set laser.scan.label=...");
  }
  return {robot_, ++sequence_, {}, StreamEnd{std::move(trouble)}};
}

}  // namespace mapweave::tiers
