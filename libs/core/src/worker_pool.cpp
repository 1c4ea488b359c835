#include <mapweave/core/error.h>
#include <mapweave/core/worker_pool.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <limits>
#include <mutex>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

namespace mapweave {
namespace {

// One call of for_each. Threads take numbers from it, in rising order, until none is left.
class Batch {
 public:
  Batch(std::size_t count, const std::function<void(std::size_t)>& task) : count_(count), task_(&task) {}

  void work() {
    std::size_t done = 0, failed = kNone;
    std::exception_ptr failure;  // of the lowest number of this thread, which is the first that fails
    for (std::size_t number; (number = next_.fetch_add(1)) < count_; ++done) {
      try {
        (*task_)(number);
      } catch (...) {
        if (failed == kNone) {
          failed = number;
          failure = std::current_exception();
        }
      }
    }
    const std::lock_guard lock(mutex_);
    if (failed < failed_) {
      failed_ = failed;
      failure_ = std::move(failure);
    }
    failure = nullptr;  // under the lock: the last owner may be another thread
    done_ += done;
    if (done_ == count_) all_done_.notify_all();
  }

  void wait_and_rethrow() {
    std::unique_lock lock(mutex_);
    all_done_.wait(lock, [&] { return done_ == count_; });
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  }

 private:
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  const std::size_t count_;
  const std::function<void(std::size_t)>* task_;  // lives as long as numbers are left: its caller waits for them
  std::atomic<std::size_t> next_{0};
  std::mutex mutex_;
  std::condition_variable all_done_;
  std::size_t done_ = 0, failed_ = kNone;
  std::exception_ptr failure_;
};

}  // namespace

// A thread works on its own batch first and then only waits for numbers that others are working on. Those can wait for
// nothing but batches nested in them, so no circle of waiting threads can arise.
struct WorkerPool::State {
  std::mutex mutex;
  std::condition_variable wake;
  std::vector<std::shared_ptr<Batch>> open;  // batches with numbers to take; the latest, which is the innermost, first
  bool stopping = false;
  std::vector<std::thread> threads;

  void run() {
    std::unique_lock lock(mutex);
    for (;;) {
      wake.wait(lock, [&] { return stopping || !open.empty(); });
      if (open.empty()) return;
      const auto batch = open.back();
      lock.unlock();
      batch->work();
      lock.lock();
      close(batch);
    }
  }

  void close(const std::shared_ptr<Batch>& batch) {
    open.erase(std::remove(open.begin(), open.end(), batch), open.end());
  }

  void stop() {
    {
      const std::lock_guard lock(mutex);
      stopping = true;
    }
    wake.notify_all();
    for (auto& thread : threads) thread.join();
  }
};

WorkerPool::WorkerPool(int threads) : state_(std::make_unique<State>()) {
  MAPWEAVE_EXPECT(threads >= 1, "a worker pool has at least one thread");
  try {
    for (int i = 1; i < threads; ++i) state_->threads.emplace_back([this] { state_->run(); });
  } catch (const std::system_error& error) {
    state_->stop();
    throw Error(ErrorCode::kInternal,
                std::string("cannot start ") + std::to_string(threads) + " threads: " + error.what(), {},
                "use fewer with --threads");
  }
}

WorkerPool::~WorkerPool() { state_->stop(); }

int WorkerPool::threads() const { return static_cast<int>(state_->threads.size()) + 1; }

void WorkerPool::for_each(std::size_t count, const std::function<void(std::size_t)>& task) {
  if (count == 0) return;
  const auto batch = std::make_shared<Batch>(count, task);
  if (state_->threads.empty() || count == 1) {
    batch->work();
    return batch->wait_and_rethrow();
  }
  {
    const std::lock_guard lock(state_->mutex);
    state_->open.push_back(batch);
  }
  state_->wake.notify_all();
  batch->work();
  {
    const std::lock_guard lock(state_->mutex);
    state_->close(batch);
  }
  batch->wait_and_rethrow();
}

}  // namespace mapweave
