#pragma once
// Ctrl-C, SIGTERM and a terminal that goes away (SIGHUP) throw Interrupted at the next safe point, so that what is
// finished can be saved.

#include <string>

namespace mapweave {

// No error, and no std::exception, so that nobody who handles failures takes it for one.
class Interrupted {
 public:
  explicit Interrupted(std::string message = "interrupted") : message_(std::move(message)) {}
  const std::string& message() const { return message_; }

 private:
  std::string message_;
};

void install_interrupt_handlers();  // once, by a program; a second signal ends the process at once. SIGPIPE is ignored
                                    // from then on
bool interrupted();                 // a signal has come
void throw_if_interrupted();
void request_interrupt();  // as if a signal had come (tests)
void clear_interrupt();    // (tests)

}  // namespace mapweave
