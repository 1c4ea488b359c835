#pragma once
// Lines on stderr that systemd's journal keeps: it has the time of each, and takes a line's level from its prefix
// (sd-daemon(3)).

#include <mapweave/core/log.h>

#include <string>

namespace mapweave {

// Whether stderr is the journal's own stream, as JOURNAL_STREAM says: not one that was redirected since. Thread-safe.
bool logs_to_journal();
// "<4>" for a warning that goes to the journal; empty anywhere else.
std::string journal_prefix(LogLevel level);

}  // namespace mapweave
