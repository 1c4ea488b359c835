#include "cluster_task.h"
#include "on_board.h"
#include "record_json.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/runtime/cluster.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <set>
#include <thread>

namespace mapweave::runtime {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kStep{20};
constexpr std::chrono::seconds kLook{1};

class ClusterRun {
 public:
  ClusterRun(const RunConfiguration& configuration, const RunPlan& plan, const Cluster& cluster, Progress& progress)
      : configuration_(configuration),
        plan_(plan),
        cluster_(cluster),
        progress_(progress),
        results_(plan.robots.size()),
        unfit_(plan.robots.size()) {
    for (std::size_t i = 0; i < plan.robots.size(); ++i) waiting_.push_back(i);
  }

  std::vector<std::optional<RobotResult>> run() {
    const int task = progress_.begin("robots mapped by workers", plan_.robots.size(), "robots");
    try {
      while (!waiting_.empty() || !jobs_.empty()) {
        throw_if_interrupted();
        if (Clock::now() >= next_look_) assign();
        const std::size_t before = jobs_.size();
        for (std::size_t i = jobs_.size(); i-- > 0;)
          if (!listen(jobs_[i])) end(i);
        if (jobs_.size() < before) progress_.advance(task, done_);
        std::this_thread::sleep_for(kStep);
      }
    } catch (const Interrupted&) {  // what is mapped already is kept
    }
    for (Job& job : jobs_) job.channel->close();
    progress_.end(task);
    return std::move(results_);
  }

 private:
  struct Job {
    std::size_t robot = 0;
    std::string worker;
    std::shared_ptr<transport::Channel> channel;
    Clock::time_point received_at = Clock::now();
    OnBoardParts parts;
    bool is_done = false;
  };

  void assign() {
    const auto now = Clock::now();
    next_look_ = now + kLook;
    if (waiting_.empty()) return;
    const std::vector<std::string> idle = cluster_.idle_workers();
    for (const std::string& worker : idle) {
      const auto given = std::find_if(waiting_.begin(), waiting_.end(),
                                      [&](std::size_t robot) { return unfit_[robot].count(worker) == 0; });
      if (given == waiting_.end()) continue;
      if (std::any_of(jobs_.begin(), jobs_.end(), [&](const Job& job) { return job.worker == worker; })) continue;
      Job job;
      job.robot = *given;
      job.worker = worker;
      job.channel = cluster_.open(worker);
      if (job.channel == nullptr) continue;
      const ClusterTask task = task_of(configuration_, plan_.robots[job.robot]);
      if (job.channel->send({cluster_subject::kTask, encode(task)}) != transport::Channel::Sent::taken) continue;
      progress_.say("robot " + task.robot.str() + ": worker " + worker + " maps it");
      waiting_.erase(given);
      jobs_.push_back(std::move(job));
      waits_since_ = now;
    }
    if (!jobs_.empty()) waits_since_ = now;
    if (std::chrono::duration<double>(now - waits_since_).count() < cluster_.patience_s) return;
    waits_since_ = now;
    for (const std::size_t robot : waiting_)
      if (!idle.empty() &&
          std::all_of(idle.begin(), idle.end(), [&](const auto& worker) { return unfit_[robot].count(worker) != 0; }))
        throw Error(*why_unfit_);
    log(LogLevel::warning, std::to_string(waiting_.size()) +
                               " robots wait for a worker, and none is idle: start `mapweave worker` on a machine "
                               "that has their logs");
  }

  // False: it has ended, well or not.
  bool listen(Job& job) {
    const RobotId& robot = plan_.robots[job.robot].id;
    try {
      for (const transport::Channel::Delivery& delivery : job.channel->receive(std::chrono::milliseconds(0))) {
        job.received_at = Clock::now();
        take(job, delivery.envelope);
        job.channel->acknowledge(delivery.number);
        if (job.is_done) return false;
      }
    } catch (const Error& error) {
      log(LogLevel::warning, "worker " + job.worker + " cannot map robot " + robot.str() + ": " + error.what());
      unfit_[job.robot].insert(job.worker);
      why_unfit_ = error;
      return false;
    }
    const double silent_s = std::chrono::duration<double>(Clock::now() - job.received_at).count();
    if (!job.channel->is_closed() && silent_s < cluster_.patience_s) return true;
    log(LogLevel::warning, "worker " + job.worker + " is silent; another one maps robot " + robot.str());
    return false;
  }

  void take(Job& job, const transport::Envelope& envelope) {
    const PlannedRobot& robot = plan_.robots[job.robot];
    const std::string where = "worker " + job.worker;
    if (envelope.subject == cluster_subject::kFailed)
      throw Error(error_of(nlohmann::json::parse(envelope.bytes, nullptr, false), where));
    if (envelope.subject != cluster_subject::kMapped) return;
    Sensed message = decode_sensed(envelope.bytes, where);
    if (auto* part = std::get_if<MappedPart>(&message.body)) {
      job.parts.add(std::move(*part), robot.id);
      return;
    }
    if (!std::holds_alternative<StreamEnd>(message.body) || !job.parts.record)
      throw Error(ErrorCode::kCorrupt, "what it mapped has no end", where);
    if (!job.parts.record->log.empty()) job.parts.record->log = robot.log.string();  // the same file, as the run has it
    results_[job.robot] = result_of(std::move(*job.parts.record), std::move(job.parts.maps), robot, configuration_);
    ++done_;
    job.is_done = true;
  }

  void end(std::size_t number) {
    Job& job = jobs_[number];
    job.channel->close();
    if (!job.is_done) waiting_.insert(waiting_.begin(), job.robot);
    jobs_.erase(jobs_.begin() + static_cast<std::ptrdiff_t>(number));
  }

  const RunConfiguration& configuration_;
  const RunPlan& plan_;
  const Cluster& cluster_;
  Progress& progress_;
  std::vector<std::optional<RobotResult>> results_;
  std::vector<std::set<std::string>> unfit_;  // workers that cannot map it, by robot
  std::optional<Error> why_unfit_;
  std::vector<std::size_t> waiting_;  // robots that nobody maps
  std::vector<Job> jobs_;
  std::size_t done_ = 0;
  Clock::time_point next_look_{}, waits_since_ = Clock::now();
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
  return ClusterRun(configuration, plan, cluster, progress).run();
}

}  // namespace mapweave::runtime
