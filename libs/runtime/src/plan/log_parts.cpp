#include "log_parts.h"

#include <algorithm>

namespace mapweave::runtime {
namespace {

// The last node of a part and the first one of the next are not the same moment.
constexpr double kTurnBetweenNodes_rad = 0.3;

class PartStream : public rawlog::ObservationStream {
 public:
  PartStream(std::unique_ptr<rawlog::ObservationStream> log, const LogPart& part) : log_(std::move(log)), part_(part) {}

  std::optional<rawlog::Record> next() override {
    while (auto record = log_->next()) {
      if (record->stamp < part_.from) continue;
      if (part_.until && !(record->stamp < *part_.until)) return std::nullopt;
      return record;
    }
    return std::nullopt;
  }
  std::uint64_t bytes_read() const override { return log_->bytes_read(); }
  std::uint64_t bytes_total() const override { return log_->bytes_total(); }

 private:
  std::unique_ptr<rawlog::ObservationStream> log_;
  LogPart part_;
};

void divide(PlannedRobot& robot, const rawlog::ReadOptions& reading) {
  if (!robot.sensors.cameras.empty())
    throw Error(ErrorCode::kBadInput,
                "robot " + robot.part->robot.str() + " maps with cameras, whose data do not go to several edges",
                robot.log.string(), "leave out the robot's `edges`, or map with its laser alone: --set sensor=laser");
  const auto log = rawlog::open_log(robot.log, reading);
  std::optional<Stamp> first, last;
  try {
    while (const auto record = log->next()) {
      if (!first) first = record->stamp;
      last = record->stamp;
    }
  } catch (const Error&) {
    if (!first) throw;  // else who maps the last part meets it
  }
  if (!first) return;  // who maps says what is wrong
  LogPart& part = *robot.part;
  const auto parts = static_cast<std::int64_t>(part.count), number = static_cast<std::int64_t>(part.number);
  const std::int64_t duration_ns = (last->ns - first->ns) / parts;
  if (number > 1) part.from = Stamp{first->ns + duration_ns * (number - 1)};
  if (number < parts) part.until = Stamp{first->ns + duration_ns * number};
}

const Node& end_node(const Map& map, bool is_last) {
  const auto by_stamp = [](const auto& l, const auto& r) { return l.second.stamp < r.second.stamp; };
  return is_last ? std::max_element(map.nodes.begin(), map.nodes.end(), by_stamp)->second
                 : std::min_element(map.nodes.begin(), map.nodes.end(), by_stamp)->second;
}

}  // namespace

void divide_logs(RunPlan& plan, const RunConfiguration& configuration, WorkerPool& pool) {
  pool.for_each(plan.robots.size(), [&](std::size_t i) {
    PlannedRobot& robot = plan.robots[i];
    if (!robot.part || robot.trouble) return;
    try {
      divide(robot, configuration_of(configuration, robot).reading);
    } catch (const Error& error) {
      robot.trouble = error;
    }
  });
}

std::unique_ptr<rawlog::ObservationStream> part_of(std::unique_ptr<rawlog::ObservationStream> log,
                                                   const LogPart& part) {
  return std::make_unique<PartStream>(std::move(log), part);
}

std::vector<fusion::MapPrior> priors_of_parts(const RunPlan& plan, const std::vector<tiers::RobotOutcome>& outcomes) {
  const auto map_of = [&](const RobotId& robot, std::size_t number) -> const Map* {
    for (const PlannedRobot& planned : plan.robots)
      if (planned.part && planned.part->robot == robot && planned.part->number == number)
        for (const tiers::RobotOutcome& outcome : outcomes)
          if (outcome.robot == planned.id && outcome.map) return &*outcome.map;
    return nullptr;
  };
  std::vector<fusion::MapPrior> priors;
  for (const PlannedRobot& planned : plan.robots) {
    if (!planned.part || planned.part->number == planned.part->count) continue;
    const Map* before = map_of(planned.part->robot, planned.part->number);
    const Map* after = map_of(planned.part->robot, planned.part->number + 1);
    if (before == nullptr || after == nullptr || before->nodes.empty() || after->nodes.empty()) continue;
    fusion::MapPrior prior{
        before->id, after->id,
        compose(planar(end_node(*before, true).map_from_node), inverse(planar(end_node(*after, false).map_from_node)))};
    prior.sigma_rad = kTurnBetweenNodes_rad;
    // That place may be far from the origin of a map: the heading there swings it.
    const double reach_m = end_node(*after, false).map_from_node.t.norm();
    prior.sigma_m = kStartSigma_m + reach_m * prior.sigma_rad;
    priors.push_back(prior);
  }
  return priors;
}

}  // namespace mapweave::runtime
