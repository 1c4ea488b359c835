// https://prometheus.io/docs/instrumenting/exposition_formats/ (text format, version 0.0.4)

#include <mapweave/core/format.h>
#include <mapweave/runtime/live_status.h>

#include <nlohmann/json.hpp>

#include <utility>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::ordered_json;
using Labels = std::vector<std::pair<const char*, std::string>>;

std::string escaped(const std::string& value) {
  std::string text;
  for (const char letter : value) {
    if (letter == '\n') {
      text += "\\n";
      continue;
    }
    if (letter == '\\' || letter == '"') text += '\\';
    text += letter;
  }
  return text;
}

struct Metric {
  const char* key;  // of `counts`
  const char* help;
  bool is_counter;
};

constexpr Metric kOfTier[] = {
    {"previews", "Merges of the maps so far.", true},
    {"preview_maps", "Maps in the last preview.", false},
    {"waiting_bytes", "Bytes said that the other end has not stored.", false},
    {"refused", "Hellos refused: unknown names, names that are here, other configurations or versions.", true},
    {"unreadable", "Messages that could not be decoded.", true},
    {"repeated", "Messages that came again.", true},
    {"records", "Records read from the recording.", true},
    {"recorded_seconds", "Length of the recording read so far.", false},
    {"scans", "Scans read from the recording.", true},
    {"lost_scans", "Scans there was no room for.", true},
    {"messages", "Messages said.", true},
    {"confirmed", "Messages that the edge has stored.", true},
    {"sent_bytes", "Bytes sent, repetitions too.", true},
    {"moves", "Of a robot: how often it was given to another edge; of the coordinator: all of them.", true},
    {"mapping_seconds", "Wall time in which scans were mapped, of all robots.", true},
    {"decisions", "Decisions of the coordinator.", true},
    {"expected_seconds", "Until the team's map would be there, as the coordinator expects, were nothing mapped before.",
     false},
    {"actual_seconds", "The same as it was, once the map is written: the longest mapping, and the merging after it.",
     false},
    {"cameras", "Cameras that share while they drive: of a robot; that have come to an edge's camera map server.",
     false},
    {"cameras_on_wire", "Cameras to which the camera map server answers.", false},
    {"camera_sent_bytes", "Bytes that cameras, or the camera map server, have sent each other.", true},
    {"camera_received_bytes", "Bytes that cameras, or the camera map server, have received of each other.", true},
    {"shared_keyframes", "Keyframes of others that a robot's cameras kept, at most.", false},
    {"borrowed_landmarks", "Landmarks of others that a robot's cameras saw at a time, at most.", false},
    {"camera_updates", "Updates of cameras' maps that came.", true},
    {"camera_views", "How often cameras said where they are.", true},
    {"camera_shares", "How often something was shared with a camera.", true},
    {"camera_places", "How often lost cameras asked where they are.", true},
    {"camera_refused", "Messages of cameras that were refused.", true},
    {"camera_merges", "Merges of the cameras' maps.", true},
    {"plan", "Number of the coordinator's plan that is followed, or of the coordinator its own.", false}};

constexpr Metric kOfLink[] = {
    {"taken", "Messages that came, in order.", true},
    {"stored", "Messages that cannot be lost any more.", true},
    {"begun", "How often the other end began.", true},
    {"mapped", "Messages that the mapper has taken.", true},
    {"scans", "Scans mapped.", true},
    {"lost_scans", "Scans that the robot had no room for.", true},
    {"queue_bytes", "Bytes that wait to be mapped.", false},
    {"speed", "Of an edge's processor, as the coordinator counts it.", false},
    {"bytes_per_second", "What the link to the other end carried when it was measured.", false},
    {"wire_refused", "Parts of the wire that came and belong to no message.", true},
    {"wire_missed", "Messages of the wire that never came.", true},
    {"wire_sent_again", "Parts of the wire that nobody confirmed in time.", true},
    {"wire_full_seconds", "For so long the broker has had no room for what is sent.", false}};

class MetricsText {
 public:
  // The samples that follow are of this metric; nothing is written where none does.
  void begin(std::string name, const char* help, bool is_counter) {
    name_ = "mapweave_" + std::move(name) + (is_counter ? "_total" : "");
    head_ = "# HELP " + name_ + " " + help + "\n# TYPE " + name_ + (is_counter ? " counter\n" : " gauge\n");
  }
  void add(const Labels& labels, const Json& value) {
    std::string line = name_;
    for (std::size_t i = 0; i < labels.size(); ++i)
      line += std::string(i == 0 ? "{" : ",") + labels[i].first + "=\"" + escaped(labels[i].second) + "\"";
    if (!labels.empty()) line += "}";
    text_ += std::exchange(head_, {}) + line + " " + number(value) + "\n";
  }
  std::string take() { return std::move(text_); }

 private:
  static std::string number(const Json& value) {
    if (value.is_boolean()) return value.get<bool>() ? "1" : "0";
    return value.is_number_float() ? format("%.9g", value.get<double>()) : std::to_string(value.get<std::int64_t>());
  }
  std::string name_, head_, text_;
};

Labels labels_of(const Json& tier) { return {{"role", tier["role"]}, {"tier", tier["name"]}}; }

Labels labels_of(const Json& tier, const Json& link) {
  return {{"role", tier["role"]}, {"tier", tier["name"]}, {"peer_role", link["role"]}, {"peer", link["name"]}};
}

void add_program(MetricsText& text, const Json& status) {
  text.begin("info", "What runs here; always 1.", false);
  text.add({{"program", status["program"]}, {"name", status["name"]}, {"version", status["version"]}}, 1);
  text.begin("healthy", "1: /healthz answers 200; 0: it answers 503.", false);
  text.add({}, status["is_healthy"]);
  text.begin("up_seconds", "Seconds since the program began.", false);
  text.add({}, status["up_seconds"]);
  const Json& process = status["process"];
  text.begin("process_cpu_seconds", "Processor time of all threads.", true);
  text.add({}, process["cpu_seconds"]);
  text.begin("process_resident_bytes", "Resident memory.", false);
  text.add({}, process["resident_bytes"]);
  text.begin("process_peak_resident_bytes", "Most resident memory so far, of the largest helper process too.", false);
  text.add({}, process["peak_resident_bytes"]);
}

void add_tiers(MetricsText& text, const Json& tiers) {
  text.begin("done", "1: the tier's work is done.", false);
  for (const Json& tier : tiers) text.add(labels_of(tier), tier["is_done"]);
  text.begin("findings", "What is wrong now, by level.", false);
  for (const Json& tier : tiers)
    for (const char* level : {"error", "warning"}) {
      Labels labels = labels_of(tier);
      labels.emplace_back("level", level);
      std::size_t count = 0;
      for (const Json& finding : tier["findings"]) count += finding["level"] == level ? 1 : 0;
      text.add(labels, count);
    }
  text.begin("joined_maps", "Maps that are one with others in the last preview.", false);
  for (const Json& tier : tiers) {
    if (!tier["counts"].contains("previews")) continue;
    std::size_t count = 0;
    for (const Json& members : tier["joint"]) count += members.size();
    text.add(labels_of(tier), count);
  }
  for (const Metric& metric : kOfTier) {
    text.begin(metric.key, metric.help, metric.is_counter);
    for (const Json& tier : tiers)
      if (tier["counts"].contains(metric.key)) text.add(labels_of(tier), tier["counts"][metric.key]);
  }
}

void add_links(MetricsText& text, const Json& tiers) {
  const auto add = [&](const char* name, const char* help, bool is_counter, auto&& value_of) {
    text.begin(std::string("link_") + name, help, is_counter);
    for (const Json& tier : tiers)
      for (const Json& link : tier["links"]) {
        const Json value = value_of(link);
        if (!value.is_null()) text.add(labels_of(tier, link), value);
      }
  };
  add("on_wire", "1: the other end is on the wire.", false, [](const Json& link) { return link["is_on_wire"]; });
  add("needed", "1: something of the other end is awaited.", false, [](const Json& link) { return link["is_needed"]; });
  add("silent_seconds", "Seconds since the other end said something; none while it never did.", false,
      [](const Json& link) { return link["silent_seconds"]; });
  for (const Metric& metric : kOfLink)
    add(metric.key, metric.help, metric.is_counter,
        [&](const Json& link) { return link["counts"].contains(metric.key) ? link["counts"][metric.key] : Json(); });
}

}  // namespace

std::string metrics_text(const Json& status) {
  MetricsText text;
  add_program(text, status);
  add_tiers(text, status["tiers"]);
  add_links(text, status["tiers"]);
  return text.take();
}

}  // namespace mapweave::runtime
