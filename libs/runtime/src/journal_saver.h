#pragma once
// Puts what a server has heard on the disk, and tells who waits for that. A thread of its own: a disk may take its time.

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
  // Without a journal nothing has to wait. on_room: after what was unsaved became less, on its thread.
  JournalSaver(std::optional<mapdb::UpdateJournal> journal, std::function<void()> on_room);
  ~JournalSaver() { finish(); }
  JournalSaver(const JournalSaver&) = delete;
  JournalSaver& operator=(const JournalSaver&) = delete;

  // Both in the order of the calls; `then` once the entries are on the disk, on its thread (here, without a journal). Thread-safe.
  void save(std::vector<mapdb::JournalEntry> entries, std::function<void()> then);
  std::size_t unsaved_bytes() const { return unsaved_bytes_; }
  double cpu_seconds() const;
  std::string trouble() const;  // why nothing can be saved now; it tries again. Empty: it can
  // What waits is saved first, unless that fails: then nobody is told.
  void finish();

 private:
  struct Waiting {
    std::vector<mapdb::JournalEntry> entries;
    std::function<void()> then;
  };
  void run();
  std::string append(const std::deque<Waiting>& batch);

  std::optional<mapdb::UpdateJournal> journal_;
  const std::function<void()> on_room_;
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
