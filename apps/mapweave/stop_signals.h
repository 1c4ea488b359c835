#pragma once
// Ctrl-C, SIGTERM and SIGHUP for programs that run until they are asked to end: they end in order, and nothing throws.

#include <chrono>
#include <utility>

namespace mapweave::app {

// To be made before any thread: from then on the signals wait until they are asked for. Threads and child processes
// made later are asked for none.
class StopSignals {
 public:
  // By SIGHUP a terminal says that it goes away, which ends a program that began in one. A program without a terminal
  // may be asked by it to read its configuration again.
  enum class OnHangup { end, reload };
  explicit StopSignals(OnHangup on_hangup = OnHangup::end);
  // Whether one that ends the program came, within so long.
  bool wait(std::chrono::milliseconds patience);
  // Whether the configuration is to be read again: once each time.
  bool asks_for_reload() { return std::exchange(asks_for_reload_, false); }
  // The last one that came was SIGTERM, as of a service manager: the program goes on when it is started again, so that
  // it must not end its part of the work.
  bool asks_for_a_pause() const;

 private:
  const bool reloads_;
  bool asks_for_reload_ = false;
  int last_ = 0;
};

}  // namespace mapweave::app
