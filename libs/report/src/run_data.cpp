#include "run_data.h"

namespace mapweave::report {

Json robots_json(const std::vector<std::string>& robots, const Json& summary) {
  Json list = Json::array();
  for (const std::string& name : robots) {
    Json robot = {{"name", name}};
    if (summary.is_object())
      for (const Json& reported : summary.value("robots", Json::array())) {
        if (!reported.is_object() || reported.value("id", "") != name) continue;
        for (const char* key : {"edge", "scans", "log_seconds", "wall_seconds", "cpu_seconds", "mapped", "trouble"})
          if (reported.contains(key)) robot[key] = rounded(reported[key], 3);
        for (const Json& camera : reported.value("cameras", Json::array())) {
          Json line = Json::object();
          for (const char* key : {"label", "kind", "frames", "tracked", "lost", "keyframes", "landmarks", "loops",
                                  "tracking_mean_ms", "sent_bytes", "heard_bytes"})
            if (camera.contains(key)) line[key] = rounded(camera[key], 2);
          robot["cameras"].push_back(line);
        }
      }
    list.push_back(robot);
  }
  return list;
}

Json summary_data(const Json& summary) {
  if (!summary.is_object()) return {};
  Json data = Json::object();
  for (const char* key : {"notes", "interrupted", "exit_code", "wall_seconds", "peak_rss_bytes"})
    if (summary.contains(key)) data[key] = rounded(summary[key], 3);
  const auto team = summary.find("team");
  data["teams"] = team != summary.end() && team->is_object() ? team->value("members", Json::array()) : Json::array();
  return data;
}

std::string shell_word(const std::string& text) {
  static constexpr std::string_view kPlain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=:,./@%";
  if (!text.empty() && text.find_first_not_of(kPlain) == std::string::npos) return text;
  std::string quoted = "'";
  for (const char letter : text) quoted += letter == '\'' ? std::string("'\\''") : std::string(1, letter);
  return quoted + "'";
}

std::vector<std::string> commands(const Json& manifest, const Json& options) {
  if (!manifest.is_object()) return {};
  const std::string verb = manifest.value("verb", "");
  std::string inputs;
  for (const Json& input : manifest.value("inputs", Json::array())) inputs += " " + shell_word(input.value("path", ""));
  std::string settings;
  for (const Json& option : options) {
    const std::string name = option.value("name", ""), value = option.value("value", "");
    const bool is_of_list = name.compare(0, 7, "robots.") == 0 || name.compare(0, 6, "edges.") == 0;
    if (!is_of_list && name.find(".links.") == std::string::npos)
      settings += " --set " + shell_word(name + "=" + value);
  }
  if (verb == "run")
    return {"# in this folder; config.yaml holds all options and the full paths of the logs",
            "mapweave run config.yaml --out again"};
  if (verb == "slam") {
    std::string robot, log = inputs;  // of the inputs, others may be words and maps that it began with
    for (const Json& option : options) {
      if (option.value("name", "") == "robots.0.id") robot = " --robot " + shell_word(option.value("value", ""));
      if (option.value("name", "") == "robots.0.log") log = " " + shell_word(option.value("value", ""));
    }
    return {"mapweave slam" + log + robot + settings + " --out again"};
  }
  if (verb == "merge")
    return {
        "# paths are as they were given; what was said of pairs (--refuse, --anchor, --without) has to be said again",
        "mapweave merge" + inputs + settings + " --out again"};
  return {};
}

}  // namespace mapweave::report
