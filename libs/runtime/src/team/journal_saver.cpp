#include "journal_saver.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/runtime/metrics.h>

#include <algorithm>
#include <chrono>
#include <iterator>

namespace mapweave::runtime {
namespace {

constexpr std::chrono::seconds kUntilRetry{1};

}  // namespace

JournalSaver::JournalSaver(std::optional<mapdb::UpdateJournal> journal, std::uint64_t most_growth_bytes,
                           std::function<void()> on_room)
    : journal_(std::move(journal)), most_growth_bytes_(most_growth_bytes), on_room_(std::move(on_room)) {
  if (journal_) {
    short_bytes_ = journal_->bytes();
    thread_ = std::thread([this] { run(); });
  }
}

void JournalSaver::save(std::vector<mapdb::JournalEntry> entries, std::function<void()> then) {
  if (!journal_) return then();
  for (const mapdb::JournalEntry& entry : entries) unsaved_bytes_ += entry.update.size();
  const std::lock_guard lock(mutex_);
  waiting_.push_back({std::move(entries), std::move(then)});
  changed_.notify_all();
}

void JournalSaver::replace(std::function<Entries()> all) {
  is_long_ = false;
  const std::lock_guard lock(mutex_);
  waiting_.push_back({{}, [] {}, std::move(all)});
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
    std::string trouble = write(batch);
    std::size_t bytes = 0;
    if (trouble.empty())  // `then` posts to a wire and throws nothing but for want of memory, which ends the program
                          // everywhere
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

bool JournalSaver::is_replaced(std::deque<Waiting>& batch) {
  const auto replaced =
      std::find_if(batch.rbegin(), batch.rend(), [](const Waiting& one) { return one.all != nullptr; });
  if (replaced == batch.rend()) return false;
  bool done = false;
  try {
    Entries entries = replaced->all();
    for (auto saved = replaced.base(); saved != batch.end(); ++saved)
      entries.insert(entries.end(), saved->entries.begin(), saved->entries.end());
    journal_->replace(entries);
    done = true;
  } catch (const std::exception& error) {
    log(LogLevel::warning, std::string("the journal stays as long as it is: ") + error.what());
  }
  for (Waiting& one : batch) one.all = nullptr;
  short_bytes_ = journal_->bytes();
  return done;
}

std::string JournalSaver::write(std::deque<Waiting>& batch) {
  try {
    if (is_replaced(batch)) return {};
    Entries entries;
    for (const Waiting& saved : batch) entries.insert(entries.end(), saved.entries.begin(), saved.entries.end());
    journal_->append(entries);
    const std::uint64_t bytes = journal_->bytes();
    if (bytes > short_bytes_ + std::max(short_bytes_, most_growth_bytes_)) {
      is_long_ = true;
      short_bytes_ = bytes;
    }
  } catch (const std::exception& error) {
    return error.what();
  }
  return {};
}

}  // namespace mapweave::runtime
