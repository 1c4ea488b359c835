#include "gates.h"

#include <mapweave/core/error.h>

#include <nlohmann/json.hpp>

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
  if (!numbers.contains(limit.key)) {
    std::string keys;
    for (const auto& [key, value] : numbers.items()) keys += (keys.empty() ? "" : ", ") + key;
    throw Error(ErrorCode::kUsage, "there is no number '" + limit.key + "'", "--max", "it can be one of: " + keys);
  }
  return limit;
}

}  // namespace

ExitCode report_numbers(const nlohmann::ordered_json& numbers, bool as_json, const std::vector<std::string>& limits) {
  std::vector<Limit> checked;
  for (const std::string& text : limits) checked.push_back(parsed(text, numbers));
  if (as_json)
    std::cout << numbers.dump(2) << '\n';
  else
    for (const auto& [key, value] : numbers.items()) {
      char line[128];
      std::snprintf(line, sizeof line, "%-28s %.6g\n", key.c_str(), value.get<double>());
      std::cout << line;
    }
  ExitCode code = ExitCode::done;
  for (const Limit& limit : checked) {
    const double value = numbers[limit.key].get<double>();
    if (value <= limit.most) continue;
    std::fprintf(stderr, "mapweave: %s is %.6g; at most %.6g was asked for\n", limit.key.c_str(), value, limit.most);
    code = ExitCode::gate_failed;
  }
  return code;
}

}  // namespace mapweave::app
