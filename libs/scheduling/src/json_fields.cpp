#include <mapweave/scheduling/json_fields.h>

#include <mapweave/core/error.h>
#include <mapweave/core/ids.h>
#include <mapweave/core/nearest_name.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

namespace mapweave::scheduling {

using Json = nlohmann::json;

void refuse(const std::string& what, const std::string& where, const std::string& key, const std::string& remedy) {
  throw Error(ErrorCode::kBadInput, what, key.empty() ? where : where + ": " + key, remedy);
}

Json parse_json(std::string_view text, const std::string& where) {
  std::vector<std::set<std::string>> keys;  // of the objects that are open
  const auto watch = [&](int depth, Json::parse_event_t event, Json& parsed) {
    constexpr int kDeepest = 16;
    if (depth > kDeepest)
      refuse("lists and objects stand in each other more than 16 deep", where, "", "see the README of libs/scheduling");
    if (event == Json::parse_event_t::object_start) keys.emplace_back();
    if (event == Json::parse_event_t::object_end) keys.pop_back();
    if (event == Json::parse_event_t::key && !keys.back().insert(parsed.get<std::string>()).second)
      refuse("the key stands there twice", where, parsed.get<std::string>(), "keep one of them");
    return true;
  };
  try {
    return Json::parse(text, watch);
  } catch (const Json::exception& error) {
    std::string what = error.what();  // "[json.exception.parse_error.101] parse error at line 1, column 2: ..."
    if (const auto end = what.find("] "); end != std::string::npos) what.erase(0, end + 2);
    throw Error(ErrorCode::kCorrupt, "this is not JSON: " + what, where, "mapweave plan --help shows what is expected");
  }
}

void expect_object(const Json& value, std::initializer_list<const char*> known, const std::string& where,
                   const std::string& key) {
  if (!value.is_object()) refuse(std::string("an object was expected, not ") + value.type_name(), where, key, "");
  const std::vector<std::string> names(known.begin(), known.end());
  for (const auto& [given, ignored] : value.items()) {
    if (std::find(names.begin(), names.end(), given) != names.end()) continue;
    std::string all;
    for (const auto& one : names) all += (all.empty() ? "" : ", ") + one;
    const auto nearest = nearest_name(given, names);
    refuse("unknown key '" + given.substr(0, 64) + "'", where, key,
           nearest ? "did you mean '" + *nearest + "'?" : "known keys: " + all);
  }
}

const Json& member(const Json& object, const char* name, const std::string& where, const std::string& key) {
  const auto found = object.find(name);
  if (found == object.end()) refuse(std::string("the key '") + name + "' is missing", where, key, "");
  return *found;
}

double number(const Json& value, double low, double high, bool above_low, const std::string& where,
              const std::string& key) {
  char range[80];
  if (std::isinf(high))
    std::snprintf(range, sizeof range, above_low ? "above %g" : "of %g or more", low);
  else
    std::snprintf(range, sizeof range, "from %g to %g", low, high);
  if (!value.is_number())
    refuse(std::string("a number ") + range + " was expected, not " + value.type_name(), where, key, "");
  const double given = value.get<double>();
  if (!std::isfinite(given) || given < low || given > high || (above_low && given == low))
    refuse(value.dump() + " is not a number " + range, where, key, "");
  return given;
}

double field(const Json& object, const char* name, double most, const std::string& where, const std::string& key) {
  if (!object.is_object()) refuse("an object was expected", where, key, "");
  return number(member(object, name, where, key), 0.0, most, false, where, key + "." + name);
}

std::string name(const Json& value, const std::string& where, const std::string& key) {
  if (!value.is_string()) refuse(std::string("a name was expected, not ") + value.type_name(), where, key, "");
  const auto text = value.get<std::string>();
  if (!is_valid_name(text))
    refuse("'" + text.substr(0, 64) + "' is not a name", where, key,
           "1 to 64 letters, digits, '_', '-' or '.', not beginning with '.'");
  return text;
}

}  // namespace mapweave::scheduling
