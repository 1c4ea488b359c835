#pragma once
// Ctrl-C, SIGTERM and a terminal that goes away (SIGHUP) become an Error(kInterrupted) at the next safe point, so that what is finished can
// be saved.

namespace mapweave {

void install_interrupt_handlers();  // once, by a program; a second signal ends the process at once. SIGPIPE is ignored from then on
bool interrupted();                 // a signal has come
void throw_if_interrupted();
void request_interrupt();  // as if a signal had come (tests)
void clear_interrupt();    // (tests)

}  // namespace mapweave
