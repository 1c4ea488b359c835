#pragma once
// Puts what a server has received on the disk, and informs who waits for that. A thread of its own: a disk may take its
// time.

#include <mapweave/mapdb/update_journal.h>

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace mapweave::runtime {

class JournalSaver {
 public:
  static constexpr std::uint64_t kNeverLong = std::uint64_t{1} << 62;  // for a journal that is never replaced
  // Without a journal nothing has to wait. on_room: after what was unsaved became less, on its thread.
  // most_growth_bytes: see is_long().
  JournalSaver(std::optional<mapdb::UpdateJournal> journal, std::uint64_t most_growth_bytes,
               std::function<void()> on_room);
  ~JournalSaver() { finish(); }
  JournalSaver(const JournalSaver&) = delete;
  JournalSaver& operator=(const JournalSaver&) = delete;

  // Both in the order of the calls; `then` once the entries are on the disk, on its thread (here, without a journal).
  // Thread-safe.
  void save(std::vector<mapdb::JournalEntry> entries, std::function<void()> then);
  // Whether the journal has become twice as long, and longer by most_growth_bytes, than when it began or was replaced.
  bool is_long() const { return is_long_; }
  // `all`, made on its thread, stands for everything that was given to save() before. Where it cannot be written the
  // journal stays as it is. Thread-safe.
  using Entries = std::vector<mapdb::JournalEntry>;
  void replace(std::function<Entries()> all);
  std::size_t unsaved_bytes() const { return unsaved_bytes_; }
  double cpu_seconds() const;
  std::string trouble() const;  // why nothing can be saved now; it tries again. Empty: it can
  // What waits is saved first, unless that fails: then nobody is informed.
  void finish();

 private:
  struct Waiting {
    std::vector<mapdb::JournalEntry> entries;
    std::function<void()> then;
    std::function<Entries()> all = {};  // in place of what came before
  };
  void run();
  std::string write(std::deque<Waiting>& batch);
  bool is_replaced(std::deque<Waiting>& batch);

  std::optional<mapdb::UpdateJournal> journal_;
  const std::uint64_t most_growth_bytes_;
  const std::function<void()> on_room_;
  std::uint64_t short_bytes_ = 0;  // of the journal, when it began or was replaced
  std::atomic<bool> is_long_{false};
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Waiting> waiting_;
  std::atomic<std::size_t> unsaved_bytes_{0};
  double cpu_s_ = 0.0;
  std::string trouble_;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace mapweave::runtime
