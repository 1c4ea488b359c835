#include "paced_thread.h"

#include <algorithm>
#include <utility>

namespace mapweave::ros_nodes {
namespace {

constexpr int kPauses = 4;  // as long as a turn

}  // namespace

PacedThread::PacedThread(std::function<void()> turn, std::chrono::milliseconds least_pause)
    : turn_(std::move(turn)), least_pause_(least_pause), thread_([this] { run(); }) {}

PacedThread::~PacedThread() {
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
    changed_.notify_all();
  }
  thread_.join();
}

void PacedThread::run() {
  using Clock = std::chrono::steady_clock;
  std::unique_lock lock(mutex_);
  while (!ends_) {
    lock.unlock();
    const Clock::time_point began = Clock::now();
    turn_();
    const Clock::time_point now = Clock::now();
    lock.lock();
    changed_.wait_until(lock, now + std::max<Clock::duration>(least_pause_, kPauses * (now - began)),
                        [&] { return ends_; });
  }
}

}  // namespace mapweave::ros_nodes
