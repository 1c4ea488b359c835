#include "journal_saver.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/runtime/metrics.h>

#include <chrono>
#include <iterator>

namespace mapweave::runtime {
namespace {

constexpr std::chrono::seconds kUntilRetry{1};

}  // namespace

JournalSaver::JournalSaver(std::optional<mapdb::UpdateJournal> journal, std::function<void()> on_room)
    : journal_(std::move(journal)), on_room_(std::move(on_room)) {
  if (journal_) thread_ = std::thread([this] { run(); });
}

void JournalSaver::save(std::vector<mapdb::JournalEntry> entries, std::function<void()> then) {
  if (!journal_) return then();
  for (const mapdb::JournalEntry& entry : entries) unsaved_bytes_ += entry.update.size();
  const std::lock_guard lock(mutex_);
  waiting_.push_back({std::move(entries), std::move(then)});
  changed_.notify_all();
}

double JournalSaver::cpu_seconds() const {
  const std::lock_guard lock(mutex_);
  return cpu_s_;
}

std::string JournalSaver::trouble() const {
  const std::lock_guard lock(mutex_);
  return trouble_;
}

void JournalSaver::finish() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
    changed_.notify_all();
  }
  if (thread_.joinable()) thread_.join();
  journal_.reset();
}

void JournalSaver::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return ending_ || !waiting_.empty(); });
    if (waiting_.empty()) return;
    std::deque<Waiting> batch = std::move(waiting_);
    waiting_.clear();
    lock.unlock();
    const double begin_s = thread_cpu_seconds();
    std::string trouble = append(batch);
    std::size_t bytes = 0;
    if (trouble.empty())  // `then` posts to a wire and throws nothing but for want of memory, which ends the program everywhere
      for (const Waiting& saved : batch) {
        saved.then();
        for (const mapdb::JournalEntry& entry : saved.entries) bytes += entry.update.size();
      }
    unsaved_bytes_ -= bytes;
    const double spent_s = thread_cpu_seconds() - begin_s;
    if (trouble.empty()) on_room_();
    lock.lock();
    cpu_s_ += spent_s;
    if (!trouble.empty() && trouble_ != trouble) log(LogLevel::error, trouble);
    trouble_ = std::move(trouble);
    if (trouble_.empty()) continue;
    waiting_.insert(waiting_.begin(), std::make_move_iterator(batch.begin()), std::make_move_iterator(batch.end()));
    if (changed_.wait_for(lock, kUntilRetry, [&] { return ending_; })) return;
  }
}

std::string JournalSaver::append(const std::deque<Waiting>& batch) {
  try {
    std::vector<mapdb::JournalEntry> entries;
    for (const Waiting& saved : batch) entries.insert(entries.end(), saved.entries.begin(), saved.entries.end());
    journal_->append(entries);
  } catch (const std::exception& error) {
    return error.what();
  }
  return {};
}

}  // namespace mapweave::runtime
