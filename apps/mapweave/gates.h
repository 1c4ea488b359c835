#pragma once
// Numbers of an evaluation, how they are shown, and the limits that the caller sets on them.

#include <mapweave/core/exit_code.h>

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

namespace mapweave::app {

// Prints the numbers (an object of numbers; JSON, or a line each) and checks each "KEY=VALUE" of `limits`: 0, or 5
// where a number is larger than its limit. Throws Error(kUsage), before anything is printed, for a limit on a key that
// is not there.
ExitCode report_numbers(const nlohmann::ordered_json& numbers, bool as_json, const std::vector<std::string>& limits);

struct NumberRow {
  std::string name;
  nlohmann::ordered_json numbers;
  bool is_checked = true;  // by the limits
};
// The same of several, as a table with these keys as columns; `json` is what is printed as JSON.
ExitCode report_table(const std::vector<NumberRow>&, const std::vector<std::string>& columns,
                      const nlohmann::ordered_json& json, bool as_json, const std::vector<std::string>& limits);

}  // namespace mapweave::app
