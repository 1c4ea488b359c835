#include "cluster_work.h"
#include "on_board.h"
#include "record_json.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/runtime/cluster.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/runtime/manifest.h>

#include <atomic>
#include <chrono>
#include <deque>
#include <mutex>
#include <thread>

namespace mapweave::runtime {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kAlive{1};
constexpr std::int64_t kMoment_ns = 500'000'000;  // of data, after which it looks whether it is still wanted

std::filesystem::path find_log(const ClusterTask::Robot& robot, const std::filesystem::path& folder) {
  std::error_code ignored;
  std::filesystem::path log(robot.log);
  if (!folder.empty() && std::filesystem::exists(folder / log.filename(), ignored)) log = folder / log.filename();
  if (!std::filesystem::exists(log, ignored))
    throw Error(ErrorCode::kMissing, "the log of robot '" + robot.id.str() + "' is not here", robot.log,
                "share the folder of the logs, or name where they lie: mapweave worker --logs DIR");
  if (hash_of_input(log) != robot.log_sha256)
    throw Error(ErrorCode::kBadInput, "the log of robot '" + robot.id.str() + "' is another one here", log.string(),
                "copy the run's log here");
  return log;
}

// Of who does the task: a run that is gone ends it.
class ProgressForRun final : public Progress {
 public:
  explicit ProgressForRun(const std::atomic<bool>& gives_up) : gives_up_(gives_up) {}
  int begin(std::string_view /*task*/, std::uint64_t /*total*/, std::string_view /*unit*/) override { return 0; }
  void advance(int /*task*/, std::uint64_t /*done*/) override {
    if (gives_up_) throw Interrupted();
  }
  void end(int /*task*/) override {}
  void say(std::string_view /*line*/) override {}

 private:
  const std::atomic<bool>& gives_up_;
};

}  // namespace

struct Worker::State {
  State(std::string called, Connect accepting, std::filesystem::path there)
      : name(std::move(called)), accept(std::move(accepting)), logs(std::move(there)) {}
  const std::string name;
  const Connect accept;
  const std::filesystem::path logs;

  std::shared_ptr<transport::Channel> channel;
  ClusterReader reader;                    // of the next task
  bool is_receiving = false;               // a part of it is here
  std::deque<transport::Envelope> to_say;  // what there was no room for yet
  bool has_ended = false;                  // all of the task is in `to_say` or sent
  Clock::time_point said_alive{};
  std::thread working;
  std::atomic<bool> gives_up{false};
  mutable std::mutex mutex;  // what the working thread leaves
  std::optional<std::deque<transport::Envelope>> words;
  std::uint64_t seen = 0;
  Counts counts;

  void begin(const transport::Envelope& envelope);
  void work(const ClusterTask& task);
  std::vector<transport::Envelope> map(const ClusterTask& task);
  void end_working();
  void leave(const std::vector<transport::Envelope>& said) {
    const std::lock_guard lock(mutex);
    words.emplace(said.begin(), said.end());
  }
  bool is_busy() const { return working.joinable() || !to_say.empty() || has_ended; }
};

// What it has to say of a robot that it mapped. Throws Interrupted where the run is gone.
std::vector<transport::Envelope> Worker::State::map(const ClusterTask& task) {
  const RobotPlan own = plan_of(task, find_log(task.robots.front(), logs));
  OnBoardMapping robot(own.plan.robots.front(), own.configuration);
  for (auto next = robot.next(); next; next = robot.next()) {
    if (gives_up) throw Interrupted();
    robot.advance({next->ns + kMoment_ns}, gives_up);
    const std::uint64_t so_far = robot.seen();
    const std::lock_guard lock(mutex);
    seen = so_far;
  }
  std::vector<transport::Envelope> said;
  for (const Sensed& message : robot.finish(false)) said.push_back({cluster_subject::kMapped, encode(message)});
  return said;
}

void Worker::State::work(const ClusterTask& task) {
  const auto failed = [&](const Error& error) {
    leave({{cluster_subject::kFailed, json_text(json_of(error), -1)}});
    const std::lock_guard lock(mutex);
    ++counts.failed;
  };
  try {
    ProgressForRun progress(gives_up);
    if (task.kind == ClusterTaskKind::robot) {
      leave(map(task));
    } else if (task.kind == ClusterTaskKind::judging) {
      leave(envelopes_of(cluster_subject::kAnswer, judged_by_worker(task, progress)));
    } else {
      std::vector<std::filesystem::path> found;
      for (const ClusterTask::Robot& robot : task.robots) found.push_back(find_log(robot, logs));
      leave(envelopes_of(cluster_subject::kAnswer, drawn_by_worker(task, found, progress)));
    }
    const std::lock_guard lock(mutex);
    ++(task.kind == ClusterTaskKind::robot     ? counts.mapped
       : task.kind == ClusterTaskKind::judging ? counts.judged
                                               : counts.drawn);
  } catch (const Error& error) {
    failed(error);
  } catch (const Interrupted&) {
    leave({});
  }
}

void Worker::State::begin(const transport::Envelope& envelope) {
  if ((envelope.subject != cluster_subject::kTask && envelope.subject != cluster_subject::kPart) || is_busy()) return;
  try {
    is_receiving = true;
    std::optional<ClusterMessage> message = reader.add(envelope, "task");
    if (!message) return;
    is_receiving = false;
    const ClusterTask task = decode_cluster_task(std::move(*message), "task");
    if (task.version != program_version())
      throw Error(ErrorCode::kUnsupported,
                  "worker " + name + " is version " + program_version() + ", the run is version " + task.version, "",
                  "give both the same version");
    gives_up = false;
    seen = 0;
    counts.task = task.name;
    working = std::thread([this, task] { work(task); });
    log(LogLevel::info, "worker " + name + " works: " + task.name);
  } catch (const Error& error) {
    is_receiving = false;
    to_say.push_back({cluster_subject::kFailed, json_text(json_of(error), -1)});
    has_ended = true;
  }
}

void Worker::State::end_working() {
  if (!working.joinable()) return;
  gives_up = true;
  working.join();
  const std::lock_guard lock(mutex);
  words.reset();
  counts.task.clear();
}

Worker::Worker(std::string name, Connect accept, std::filesystem::path logs)
    : state_(new State(std::move(name), std::move(accept), std::move(logs))) {}

Worker::~Worker() { state_->end_working(); }

void Worker::step() {
  State& s = *state_;
  if (s.channel == nullptr || s.channel->is_closed()) {
    if (s.is_busy()) {  // who asked is gone
      s.end_working();
      ++s.counts.given_up;
    }
    s.to_say.clear();
    s.has_ended = s.is_receiving = false;
    s.reader = {};
    s.channel = s.accept();
    if (s.channel == nullptr) return;
  }
  for (const transport::Channel::Delivery& delivery : s.channel->receive(std::chrono::milliseconds(0))) {
    s.begin(delivery.envelope);
    s.channel->acknowledge(delivery.number);
  }
  if (s.working.joinable() || s.is_receiving) {
    std::unique_lock lock(s.mutex);
    if (s.words) {
      s.to_say.insert(s.to_say.end(), s.words->begin(), s.words->end());
      s.has_ended = true;
      lock.unlock();
      s.end_working();
    } else if (Clock::now() - s.said_alive >= kAlive) {
      s.said_alive = Clock::now();
      s.channel->send({cluster_subject::kAlive, std::to_string(s.seen), {}, 0, true});
    }
  }
  while (!s.to_say.empty() && s.channel->send(s.to_say.front()) == transport::Channel::Sent::taken)
    s.to_say.pop_front();
  // The next task comes over a channel of its own.
  if (s.has_ended && s.to_say.empty() && s.channel->in_flight_bytes() == 0) s.has_ended = false;
}

bool Worker::is_busy() const { return state_->is_busy(); }

Worker::Counts Worker::counts() const {
  const std::lock_guard lock(state_->mutex);
  return state_->counts;
}

}  // namespace mapweave::runtime
