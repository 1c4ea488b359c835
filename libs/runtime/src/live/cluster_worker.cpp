#include "cluster_task.h"
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

std::filesystem::path find_log(const ClusterTask& task, const std::filesystem::path& folder) {
  std::error_code ignored;
  std::filesystem::path log(task.log);
  if (!folder.empty() && std::filesystem::exists(folder / log.filename(), ignored)) log = folder / log.filename();
  if (!std::filesystem::exists(log, ignored))
    throw Error(ErrorCode::kMissing, "the log of robot '" + task.robot.str() + "' is not here", task.log,
                "share the folder of the logs, or name where they lie: mapweave worker --logs DIR");
  if (hash_of_input(log) != task.log_sha256)
    throw Error(ErrorCode::kBadInput, "the log of robot '" + task.robot.str() + "' is another one here", log.string(),
                "copy the run's log here");
  return log;
}

}  // namespace

struct Worker::State {
  const std::string name;
  const Connect accept;
  const std::filesystem::path logs;

  std::shared_ptr<transport::Channel> channel;
  std::deque<transport::Envelope> to_say;  // what there was no room for yet
  bool has_ended = false;                  // all of the task is in `to_say` or sent
  Clock::time_point said_alive{};
  std::thread mapping;
  std::atomic<bool> gives_up{false};
  mutable std::mutex mutex;  // what the mapping thread leaves
  std::optional<std::deque<transport::Envelope>> mapped;
  std::uint64_t seen = 0;
  Counts counts;

  void begin(const transport::Envelope& envelope);
  void map(const ClusterTask& task);
  void end_mapping();
  void leave(std::deque<transport::Envelope> words) {
    const std::lock_guard lock(mutex);
    mapped = std::move(words);
  }
  bool is_busy() const { return mapping.joinable() || !to_say.empty() || has_ended; }
};

void Worker::State::map(const ClusterTask& task) {
  const auto failed = [&](const Error& error) {
    leave({{cluster_subject::kFailed, json_text(json_of(error), -1)}});
    const std::lock_guard lock(mutex);
    ++counts.failed;
  };
  try {
    const WorkerPlan work = plan_of(task, find_log(task, logs));
    OnBoardMapping robot(work.plan.robots.front(), work.configuration);
    for (auto next = robot.next(); next && !gives_up; next = robot.next()) {
      robot.advance({next->ns + kMoment_ns}, gives_up);
      const std::uint64_t so_far = robot.seen();
      const std::lock_guard lock(mutex);
      seen = so_far;
    }
    if (gives_up) return leave({});
    std::deque<transport::Envelope> words;
    for (const Sensed& message : robot.finish(false)) words.push_back({cluster_subject::kMapped, encode(message)});
    leave(std::move(words));
    const std::lock_guard lock(mutex);
    ++counts.mapped;
  } catch (const Error& error) {
    failed(error);
  } catch (const Interrupted&) {
    leave({});
  }
}

void Worker::State::begin(const transport::Envelope& envelope) {
  if (envelope.subject != cluster_subject::kTask || is_busy()) return;
  try {
    const ClusterTask task = decode_cluster_task(envelope.bytes, "task");
    if (task.version != program_version())
      throw Error(ErrorCode::kUnsupported,
                  "worker " + name + " is version " + program_version() + ", the run is version " + task.version, "",
                  "give both the same version");
    gives_up = false;
    seen = 0;
    counts.robot = task.robot.str();
    mapping = std::thread([this, task] { map(task); });
    log(LogLevel::info, "worker " + name + " maps robot " + task.robot.str());
  } catch (const Error& error) {
    to_say.push_back({cluster_subject::kFailed, json_text(json_of(error), -1)});
    has_ended = true;
  }
}

void Worker::State::end_mapping() {
  if (!mapping.joinable()) return;
  gives_up = true;
  mapping.join();
  const std::lock_guard lock(mutex);
  mapped.reset();
  counts.robot.clear();
}

Worker::Worker(std::string name, Connect accept, std::filesystem::path logs)
    : state_(new State{std::move(name), std::move(accept), std::move(logs), {}, {}, false, {}, {}, {}, {}, {}, 0, {}}) {
}

Worker::~Worker() { state_->end_mapping(); }

void Worker::step() {
  State& s = *state_;
  if (s.channel == nullptr || s.channel->is_closed()) {
    if (s.is_busy()) {  // who asked is gone
      s.end_mapping();
      ++s.counts.given_up;
    }
    s.to_say.clear();
    s.has_ended = false;
    s.channel = s.accept();
    if (s.channel == nullptr) return;
  }
  for (const transport::Channel::Delivery& delivery : s.channel->receive(std::chrono::milliseconds(0))) {
    s.begin(delivery.envelope);
    s.channel->acknowledge(delivery.number);
  }
  if (s.mapping.joinable()) {
    std::unique_lock lock(s.mutex);
    if (s.mapped) {
      s.to_say.insert(s.to_say.end(), s.mapped->begin(), s.mapped->end());
      s.has_ended = true;
      lock.unlock();
      s.end_mapping();
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
