#include "stop_signals.h"

#include <signal.h>
#include <time.h>

namespace mapweave::app {
namespace {

sigset_t stop_signals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int one : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&set, one);
  return set;
}

}  // namespace

StopSignals::StopSignals() {
  const sigset_t set = stop_signals();
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
}

bool StopSignals::wait(std::chrono::milliseconds patience) {
  const sigset_t set = stop_signals();
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(patience);
  timespec time{};
  time.tv_sec = seconds.count();
  time.tv_nsec = std::chrono::nanoseconds(patience - seconds).count();
  const int came = sigtimedwait(&set, nullptr, &time);
  if (came > 0) last_ = came;
  return came > 0;
}

bool StopSignals::asks_for_a_pause() const { return last_ == SIGTERM; }

}  // namespace mapweave::app
