#include "stop_signals.h"

#include <fcntl.h>
#include <signal.h>
#include <time.h>
#include <unistd.h>

namespace mapweave::app {
namespace {

// SIGHUP not where it is ignored, as nohup(1) has it.
sigset_t stop_signals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int one : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction action {};
    if (one != SIGHUP || sigaction(one, nullptr, &action) != 0 || action.sa_handler != SIG_IGN) sigaddset(&set, one);
  }
  return set;
}

bool has_terminal() {
  const int terminal = open("/dev/tty", O_RDONLY | O_NOCTTY | O_CLOEXEC);
  if (terminal >= 0) close(terminal);
  return terminal >= 0;
}

}  // namespace

StopSignals::StopSignals(OnHangup on_hangup) : reloads_(on_hangup == OnHangup::reload && !has_terminal()) {
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
  if (came == SIGHUP && reloads_) {
    asks_for_reload_ = true;
    return false;
  }
  if (came > 0) last_ = came;
  return came > 0;
}

bool StopSignals::asks_for_a_pause() const { return last_ == SIGTERM; }

}  // namespace mapweave::app
