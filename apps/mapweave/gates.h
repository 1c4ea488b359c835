#pragma once
// Numbers of an evaluation, how they are shown, and the limits that the caller sets on them.

#include <mapweave/core/exit_code.h>

#include <nlohmann/json_fwd.hpp>

#include <string>
#include <vector>

namespace mapweave::app {

// Prints the numbers (an object of numbers; JSON, or a line each) and checks each "KEY=VALUE" of `limits`: 0, or 5
// where a number is larger than its limit. Throws Error(kUsage), before anything is printed, for a limit on a key that
// is not there.
ExitCode report_numbers(const nlohmann::ordered_json& numbers, bool as_json, const std::vector<std::string>& limits);

}  // namespace mapweave::app
