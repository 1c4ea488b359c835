#include <mapweave/tiers/robot_agent.h>

namespace mapweave::tiers {
namespace {

Stamp stamp_of(const laser::LaserInput& input) {
  return std::visit([](const auto& any) { return any.stamp; }, input);
}

}  // namespace

RobotAgent::RobotAgent(RobotId robot, TierId edge, laser::ScanInputOptions options, std::string stream)
    : robot_(robot), edge_(edge), stream_(stream.empty() ? "robot " + robot.str() : std::move(stream)), packer_(std::move(options)) {}

RobotMessage RobotAgent::next_message() {
  RobotMessage message;
  message.robot = robot_;
  message.edge = edge_;
  message.sequence = ++sequence_;
  return message;
}

std::optional<RobotMessage> RobotAgent::step(const rawlog::Record& record) {
  MAPWEAVE_EXPECT(!ended_, "the stream of robot '" + robot_.str() + "' has ended");
  std::optional<laser::LaserInput> input = packer_(record);
  if (!input) return std::nullopt;
  const Stamp stamp = stamp_of(*input);
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
  RobotMessage message = next_message();
  message.body = std::move(*input);
  return message;
}

RobotMessage RobotAgent::end(std::optional<Error> trouble) {
  MAPWEAVE_EXPECT(!ended_, "the stream of robot '" + robot_.str() + "' has ended");
  ended_ = true;
  if (!trouble && scans_ == 0) {
    std::string others;
    for (const auto& [label, count] : packer_.ignored_lasers())
      others += (others.empty() ? "" : ", ") + label + " (" + std::to_string(count) + ")";
    trouble = Error(ErrorCode::kBadInput,
                    "there is no usable laser scan in the log" + (others.empty() ? "" : "; it has lasers labelled " + others), stream_,
                    others.empty() ? "look at the log with: mapweave inspect LOG" : "choose one with --set laser.scan.label=...");
  }
  RobotMessage message = next_message();
  message.body.emplace<StreamEnd>().trouble = std::move(trouble);
  return message;
}

}  // namespace mapweave::tiers
