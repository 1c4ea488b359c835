#include "cluster_work.h"
#include "on_board.h"

#include <mapweave/core/interrupt.h>

namespace mapweave::runtime {
namespace {

class RobotOnWorker final : public ClusterWork {
 public:
  RobotOnWorker(const RunConfiguration& configuration, const PlannedRobot& robot, std::optional<RobotResult>& result)
      : configuration_(configuration), robot_(robot), result_(result) {}
  std::string name() const override { return "robot " + robot_.id.str(); }
  ClusterTask task() const override { return task_of(configuration_, robot_); }
  void begin_again() override { parts_ = {}; }

  bool take(const transport::Envelope& envelope, const std::string& where) override {
    if (envelope.subject != cluster_subject::kMapped) return false;
    Sensed message = decode_sensed(envelope.bytes, where);
    if (auto* part = std::get_if<MappedPart>(&message.body)) {
      parts_.add(std::move(*part), robot_.id);
      return false;
    }
    if (!std::holds_alternative<StreamEnd>(message.body) || !parts_.record)
      throw Error(ErrorCode::kCorrupt, "what it mapped has no end", where);
    if (!parts_.record->log.empty()) parts_.record->log = robot_.log.string();  // the same file, as the run has it
    result_ = result_of(std::move(*parts_.record), std::move(parts_.maps), robot_, configuration_);
    return true;
  }

 private:
  const RunConfiguration& configuration_;
  const PlannedRobot& robot_;
  std::optional<RobotResult>& result_;
  OnBoardParts parts_;
};

}  // namespace

void expect_cluster(const RunConfiguration& configuration, const RunPlan& plan) {
  const auto refuse = [](const std::string& what, const std::string& key, const std::string& remedy) {
    throw Error(ErrorCode::kBadInput, what, key, remedy);
  };
  if (configuration.server.share != tiers::Sharing::none)
    refuse("cameras that share while they map are mapped by one program", "server.share",
           "set share: none, or run without --cluster");
  if (configuration.coordinator.method)
    refuse("a coordinator maps all robots in one program", "coordinator.method",
           "set method: none, or run without --cluster");
  if (configuration.cloud.rounds.are_on())
    refuse("rounds drive all robots in one program", "cloud.rounds", "leave rounds out, or run without --cluster");
  for (const PlannedRobot& robot : plan.robots)
    if (robot.part)
      refuse("robot '" + robot.robot().str() + "' has several edges, which is mapped by one program", "robots",
             "give it `edge` in place of `edges`, or run without --cluster");
}

std::vector<std::optional<RobotResult>> map_on_cluster(const RunConfiguration& configuration, const RunPlan& plan,
                                                       const Cluster& cluster, Progress& progress) {
  std::vector<std::optional<RobotResult>> results(plan.robots.size());
  std::vector<std::unique_ptr<ClusterWork>> works;
  for (std::size_t i = 0; i < plan.robots.size(); ++i)
    works.push_back(std::make_unique<RobotOnWorker>(configuration, plan.robots[i], results[i]));
  try {
    run_on_cluster("robots mapped by workers", works, cluster, progress);
  } catch (const Interrupted&) {  // what is mapped already is kept
  }
  return results;
}

}  // namespace mapweave::runtime
