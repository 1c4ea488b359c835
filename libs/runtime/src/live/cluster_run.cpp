#include "cluster_work.h"
#include "record_json.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>

#include <algorithm>
#include <chrono>
#include <deque>
#include <set>
#include <thread>

namespace mapweave::runtime {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kStep{20};
constexpr std::chrono::seconds kLook{1};

class ClusterRun {
 public:
  ClusterRun(const std::vector<std::unique_ptr<ClusterWork>>& works, const Cluster& cluster)
      : works_(works), cluster_(cluster), unfit_(works.size()) {
    for (std::size_t i = 0; i < works.size(); ++i) waiting_.push_back(i);
  }
  ~ClusterRun() {
    for (Job& job : jobs_) job.channel->close();
  }
  ClusterRun(const ClusterRun&) = delete;
  ClusterRun& operator=(const ClusterRun&) = delete;

  void run(const std::string& what, Progress& progress) {
    ProgressTask task(progress, what, works_.size(), "tasks");
    while (!waiting_.empty() || !jobs_.empty()) {
      throw_if_interrupted();
      if (Clock::now() >= next_look_) assign(progress);
      for (std::size_t i = jobs_.size(); i-- > 0;)
        if (!go_on(jobs_[i])) end(i);
      task.advance(done_);
      std::this_thread::sleep_for(kStep);
    }
  }

 private:
  struct Job {
    std::size_t work = 0;
    std::string worker;
    std::shared_ptr<transport::Channel> channel;
    std::deque<transport::Envelope> to_send;  // of the task
    Clock::time_point received_at = Clock::now();
    bool is_done = false;
  };

  void assign(Progress& progress) {
    const auto now = Clock::now();
    next_look_ = now + kLook;
    if (waiting_.empty()) return;
    std::vector<std::string> idle = cluster_.idle_workers();
    // Those that have just done a task of this run say so later.
    for (const std::string& worker : done_by_)
      if (std::find(idle.begin(), idle.end(), worker) == idle.end()) idle.push_back(worker);
    for (const std::string& worker : idle) give(worker, progress);
    if (!jobs_.empty()) waits_since_ = now;
    if (std::chrono::duration<double>(now - waits_since_).count() < cluster_.patience_s) return;
    waits_since_ = now;
    waiting_.erase(
        std::remove_if(waiting_.begin(), waiting_.end(),
                       [&](std::size_t work) { return !idle.empty() && is_unfit(work, idle) && give_up(work); }),
        waiting_.end());
    if (!waiting_.empty())
      log(LogLevel::warning, std::to_string(waiting_.size()) +
                                 " tasks wait for a worker, and none is idle: start `mapweave worker` on a machine "
                                 "that has the robots' logs");
  }

  void give(const std::string& worker, Progress& progress) {
    const auto given = std::find_if(waiting_.begin(), waiting_.end(),
                                    [&](std::size_t work) { return unfit_[work].count(worker) == 0; });
    if (given == waiting_.end()) return;
    if (std::any_of(jobs_.begin(), jobs_.end(), [&](const Job& job) { return job.worker == worker; })) return;
    Job job;
    job.work = *given;
    job.worker = worker;
    job.channel = cluster_.open(worker);
    done_by_.erase(worker);
    if (job.channel == nullptr) return;
    const ClusterWork& work = *works_[job.work];
    for (transport::Envelope& envelope : envelopes_of(work.task())) job.to_send.push_back(std::move(envelope));
    progress.say(work.name() + ": worker " + worker);
    waiting_.erase(given);
    jobs_.push_back(std::move(job));
    waits_since_ = Clock::now();
  }

  bool is_unfit(std::size_t work, const std::vector<std::string>& idle) const {
    return std::all_of(idle.begin(), idle.end(),
                       [&](const std::string& worker) { return unfit_[work].count(worker) != 0; });
  }

  bool give_up(std::size_t work) {
    if (!works_[work]->give_up(*why_unfit_)) throw Error(*why_unfit_);
    ++done_;
    return true;
  }

  // False: it has ended, well or not.
  bool go_on(Job& job) {
    ClusterWork& work = *works_[job.work];
    const std::string where = "worker " + job.worker;
    try {
      while (!job.to_send.empty() && job.channel->send(job.to_send.front()) == transport::Channel::Sent::taken) {
        job.to_send.pop_front();
        job.received_at = Clock::now();
      }
      for (const transport::Channel::Delivery& delivery : job.channel->receive(std::chrono::milliseconds(0))) {
        job.received_at = Clock::now();
        if (delivery.envelope.subject == cluster_subject::kFailed)
          throw Error(error_of(nlohmann::json::parse(delivery.envelope.bytes, nullptr, false), where));
        job.is_done = delivery.envelope.subject != cluster_subject::kAlive && work.take(delivery.envelope, where);
        job.channel->acknowledge(delivery.number);
        if (job.is_done) return false;
      }
    } catch (const Error& error) {
      log(LogLevel::warning, where + " cannot do " + work.name() + ": " + error.what());
      unfit_[job.work].insert(job.worker);
      why_unfit_ = error;
      return false;
    }
    const double silent_s = std::chrono::duration<double>(Clock::now() - job.received_at).count();
    if (!job.channel->is_closed() && silent_s < cluster_.patience_s) return true;
    log(LogLevel::warning, where + " is silent; another one gets its task: " + work.name());
    return false;
  }

  void end(std::size_t number) {
    Job& job = jobs_[number];
    job.channel->close();
    if (job.is_done) {
      ++done_;
      done_by_.insert(job.worker);
      next_look_ = {};
    } else {
      works_[job.work]->begin_again();
      waiting_.insert(waiting_.begin(), job.work);
    }
    jobs_.erase(jobs_.begin() + static_cast<std::ptrdiff_t>(number));
  }

  const std::vector<std::unique_ptr<ClusterWork>>& works_;
  const Cluster& cluster_;
  std::vector<std::set<std::string>> unfit_;  // workers that cannot do it, by work
  std::optional<Error> why_unfit_;
  std::vector<std::size_t> waiting_;  // that nobody does
  std::vector<Job> jobs_;
  std::set<std::string> done_by_;  // workers that did the last task they got
  std::size_t done_ = 0;
  Clock::time_point next_look_{}, waits_since_ = Clock::now();
};

}  // namespace

bool AnsweredWork::take(const transport::Envelope& envelope, const std::string& where) {
  if (envelope.subject != cluster_subject::kAnswer && envelope.subject != cluster_subject::kPart) return false;
  std::optional<ClusterMessage> answer = reader_.add(envelope, where);
  if (answer) take_answer(std::move(*answer), where);
  return answer.has_value();
}

bool AnsweredWork::give_up(const Error& why) {
  log(LogLevel::warning, "no worker can do " + name() + ", so this program does it: " + why.what());
  return true;
}

void run_on_cluster(const std::string& what, const std::vector<std::unique_ptr<ClusterWork>>& works,
                    const Cluster& cluster, Progress& progress) {
  ClusterRun(works, cluster).run(what, progress);
}

}  // namespace mapweave::runtime
