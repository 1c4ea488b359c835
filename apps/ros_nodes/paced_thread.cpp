#include "paced_thread.h"

#include <mapweave/runtime/metrics.h>

#include <algorithm>
#include <utility>

namespace mapweave::ros_nodes {
namespace {

constexpr double kPauses = 4.0;  // as long as a turn took of a processor, however many other programs it waited for

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
    const double before_s = runtime::thread_cpu_seconds();
    turn_();
    const std::chrono::duration<double> pause(kPauses * (runtime::thread_cpu_seconds() - before_s));
    lock.lock();
    changed_.wait_for(lock, std::max<Clock::duration>(least_pause_, std::chrono::duration_cast<Clock::duration>(pause)),
                      [&] { return ends_; });
  }
}

}  // namespace mapweave::ros_nodes
