#include "gates.h"

#include <mapweave/core/error.h>
#include <mapweave/runtime/json_text.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>

namespace mapweave::app {
namespace {

struct Limit {
  std::string key;
  double most;
};

Limit parsed(const std::string& text, const nlohmann::ordered_json& numbers) {
  const auto equals = text.find('=');
  std::size_t used = 0;
  Limit limit{text.substr(0, equals), 0.0};
  try {
    if (equals != std::string::npos) limit.most = std::stod(text.substr(equals + 1), &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used == 0 || equals + 1 + used != text.size() || std::isnan(limit.most))
    throw Error(ErrorCode::kUsage, "'" + text + "' is no limit", "--max",
                "write KEY=NUMBER, as in translation_mean_m=0.05");
  if (!numbers.contains(limit.key) || !numbers[limit.key].is_number()) {
    std::string keys;
    for (const auto& [key, value] : numbers.items())
      if (value.is_number()) keys += (keys.empty() ? "" : ", ") + key;
    throw Error(ErrorCode::kUsage, "there is no number '" + limit.key + "'", "--max", "it can be one of: " + keys);
  }
  return limit;
}

// 5 where a number is larger than its limit.
ExitCode checked(const std::string& name, const nlohmann::ordered_json& numbers, const std::vector<Limit>& limits) {
  ExitCode code = ExitCode::done;
  for (const Limit& limit : limits) {
    const double value = numbers[limit.key].get<double>();
    if (value <= limit.most) continue;
    std::fprintf(stderr, "mapweave: %s%s is %.6g; at most %.6g was asked for\n",
                 name.empty() ? "" : (name + ": ").c_str(), limit.key.c_str(), value, limit.most);
    code = ExitCode::gate_failed;
  }
  return code;
}

std::vector<Limit> parsed(const std::vector<std::string>& texts, const nlohmann::ordered_json& numbers) {
  std::vector<Limit> limits;
  for (const std::string& text : texts) limits.push_back(parsed(text, numbers));
  return limits;
}

}  // namespace

ExitCode report_numbers(const nlohmann::ordered_json& numbers, bool as_json, const std::vector<std::string>& limits) {
  const std::vector<Limit> parsed_limits = parsed(limits, numbers);
  if (as_json)
    std::cout << runtime::json_text(numbers) << '\n';
  else
    for (const auto& [key, value] : numbers.items()) {
      char line[128];
      std::snprintf(line, sizeof line, "%-28s %.6g\n", key.c_str(), value.get<double>());
      std::cout << line;
    }
  return checked("", numbers, parsed_limits);
}

ExitCode report_table(const std::vector<NumberRow>& rows, const std::vector<std::string>& columns,
                      const nlohmann::ordered_json& json, bool as_json, const std::vector<std::string>& limits) {
  std::vector<std::vector<Limit>> parsed_limits;
  for (const NumberRow& row : rows)
    parsed_limits.push_back(row.is_checked ? parsed(limits, row.numbers) : std::vector<Limit>());
  if (as_json) std::cout << runtime::json_text(json) << '\n';
  std::size_t widest = 0;
  for (const NumberRow& row : rows) widest = std::max(widest, row.name.size());
  const auto print = [&](const std::string& name, const auto& cell) {
    std::cout << name << std::string(widest - name.size(), ' ');
    for (const std::string& column : columns) {
      const std::string text = cell(column);
      std::cout << "  " << std::string(std::max(column.size(), text.size()) - text.size(), ' ') << text;
    }
    std::cout << '\n';
  };
  if (!as_json) print("", [](const std::string& column) { return column; });
  for (const NumberRow& row : rows)
    if (!as_json)
      print(row.name, [&](const std::string& column) {
        char text[32] = "-";
        if (row.numbers.contains(column)) std::snprintf(text, sizeof text, "%.6g", row.numbers[column].get<double>());
        return std::string(text);
      });
  ExitCode code = ExitCode::done;
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (checked(rows[i].name, rows[i].numbers, parsed_limits[i]) != ExitCode::done) code = ExitCode::gate_failed;
  return code;
}

}  // namespace mapweave::app
