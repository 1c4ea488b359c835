#pragma once
// Something that has to be computed, but not at once.

#include <atomic>
#include <functional>
#include <mutex>

namespace mapweave {

// It may be run on any thread while its owner goes on.
class BackgroundWork {
 public:
  explicit BackgroundWork(std::function<void()> work) : work_(std::move(work)) {}
  // Returns when it is done, whoever does it. Thread-safe.
  void run() {
    std::call_once(once_, [this] {
      work_();
      done_ = true;
    });
  }
  bool is_done() const { return done_; }

 private:
  std::function<void()> work_;
  std::once_flag once_;
  std::atomic<bool> done_{false};
};

}  // namespace mapweave
