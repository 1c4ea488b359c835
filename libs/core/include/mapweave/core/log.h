#pragma once
// The program's log, on stderr: what an operator wants to know later. Results never go here.

#include <string>
#include <string_view>

namespace mapweave {

enum class LogLevel { debug, info, warning, error };
void log(LogLevel level, std::string_view message);  // thread-safe
void set_log_level(LogLevel lowest);
LogLevel log_level_from_text(std::string_view text);  // throws Error kUsage

}  // namespace mapweave
