// Rounds as JSON and in words.

#include "report_parts.h"

#include <mapweave/core/format.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/runtime/rounds.h>
#include <mapweave/scheduling/json_fields.h>

#include <string>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::ordered_json;
using scheduling::member;
using scheduling::refuse;

Json joint_json(const RoundWork::Fused& fused) {
  Json joint = Json::array();
  for (const auto& maps : fused.joint) joint.push_back(names_json(maps));
  return joint;
}

Json first_joint_json(const std::optional<RoundsTimeline::Joint>& joint) {
  if (!joint) return {};
  return {{"tier", joint->tier.str()},
          {"maps", names_json(joint->maps)},
          {"at_seconds", joint->at_s},
          {"ready_seconds", joint->ready_s}};
}

std::string joined(const std::vector<MapId>& ids) {
  std::string text;
  for (const MapId& id : ids) text += (text.empty() ? "" : " + ") + id.str();
  return text;
}

Json tier_json(const RoundWork::Fused& fused, const RoundsTimeline::Ready* ready) {
  Json pairs = Json::array();
  for (const RoundWork::Pair& pair : fused.pairs)
    pairs.push_back({{"a", pair.a.str()},
                     {"b", pair.b.str()},
                     {"decision", to_text(pair.decision)},
                     {"reason", to_text(pair.reason)},
                     {"probability", pair.probability}});
  Json line = {{"tier", fused.tier.str()}, {"maps", fused.maps},   {"joint", joint_json(fused)},
               {"pairs", pairs},           {"bytes", fused.bytes}, {"fusing_cpu_seconds", fused.fusing_s}};
  if (ready != nullptr) {
    line["ready_seconds"] = ready->is_left_out ? Json() : Json(ready->ready_s);
    line["left_out"] = ready->is_left_out;
  }
  return line;
}

Json robots_json(const RoundWork& round) {
  Json robots = Json::array();
  for (const RoundWork::Sent& sent : round.robots)
    robots.push_back({{"id", sent.robot.str()}, {"to", sent.to.str()}, {"bytes", sent.bytes}});
  return robots;
}

double at_least_0(const nlohmann::json& object, const char* field, const std::string& where) {
  constexpr double kMost = 1e15;
  const std::string key = "timeline.rounds";
  return scheduling::number(member(object, field, where, key), 0.0, kMost, false, where, key + "." + field);
}

const nlohmann::json& list(const nlohmann::json& object, const char* field, const std::string& where) {
  const nlohmann::json& value = member(object, field, where, "timeline.rounds");
  if (!value.is_array()) refuse("a list was expected", where, std::string("timeline.rounds.") + field, "");
  return value;
}

RoundWork::Fused read_fused(const nlohmann::json& line, const std::string& where) {
  const std::string key = "timeline.rounds.tiers";
  RoundWork::Fused fused;
  fused.tier = TierId(scheduling::name(member(line, "tier", where, key), where, key));
  fused.fusing_s = at_least_0(line, "fusing_cpu_seconds", where);
  fused.bytes = static_cast<std::uint64_t>(at_least_0(line, "bytes", where));
  fused.speed = at_least_0(line, "speed", where);
  if (!(fused.speed > 0.0)) refuse("a speed above 0 was expected", where, key + ".speed", "");
  fused.maps = static_cast<std::size_t>(at_least_0(line, "maps", where));
  for (const nlohmann::json& maps : list(line, "joint", where)) {
    if (!maps.is_array()) refuse("a list was expected", where, key + ".joint", "");
    std::vector<MapId> ids;
    for (const nlohmann::json& id : maps) ids.emplace_back(scheduling::name(id, where, key + ".joint"));
    fused.joint.push_back(std::move(ids));
  }
  return fused;
}

}  // namespace

Json rounds_timeline_json(const RoundsTimeline& timeline, const std::vector<RoundWork>& rounds) {
  Json tiers = Json::array(), lines = Json::array();
  for (const RoundsTimeline::Tier& tier : timeline.tiers)
    tiers.push_back({{"tier", tier.tier.str()},
                     {"previews", tier.fused},
                     {"left_out", tier.left_out},
                     {"oldest_seconds", tier.most_age_s},
                     {"slowest_seconds", tier.slowest_s},
                     {"fusing_cpu_seconds", tier.fusing_cpu_s},
                     {"bytes", tier.bytes}});
  for (std::size_t i = 0; i < rounds.size(); ++i) {
    Json of_tiers = Json::array();
    for (std::size_t k = 0; k < rounds[i].fused.size(); ++k) {
      const RoundWork::Fused& fused = rounds[i].fused[k];
      const RoundsTimeline::Ready& ready = timeline.rounds.at(i).at(k);
      of_tiers.push_back({{"tier", fused.tier.str()},
                          {"fusing_cpu_seconds", fused.fusing_s},
                          {"bytes", fused.bytes},
                          {"speed", fused.speed},
                          {"maps", fused.maps},
                          {"joint", joint_json(fused)},
                          {"ready_seconds", ready.is_left_out ? Json() : Json(ready.ready_s)},
                          {"left_out", ready.is_left_out}});
    }
    lines.push_back({{"at_seconds", rounds[i].at_s}, {"robots", robots_json(rounds[i])}, {"tiers", of_tiers}});
  }
  return {{"first_joint", first_joint_json(timeline.first_joint)}, {"tiers", tiers}, {"rounds", lines}};
}

std::vector<RoundWork> read_rounds(const nlohmann::json& rounds, const std::string& where) {
  if (!rounds.is_object()) refuse("an object was expected", where, "timeline.rounds", "");
  std::vector<RoundWork> result;
  for (const nlohmann::json& line : list(rounds, "rounds", where)) {
    RoundWork round;
    round.at_s = at_least_0(line, "at_seconds", where);
    for (const nlohmann::json& robot : list(line, "robots", where)) {
      const std::string key = "timeline.rounds.robots";
      const nlohmann::json& to = member(robot, "to", where, key);
      const bool is_cloud = to.is_string() && to.get_ref<const std::string&>().empty();
      round.robots.push_back({RobotId(scheduling::name(member(robot, "id", where, key), where, key)),
                              is_cloud ? TierId() : TierId(scheduling::name(to, where, key)),
                              static_cast<std::uint64_t>(at_least_0(robot, "bytes", where))});
    }
    for (const nlohmann::json& fused : list(line, "tiers", where)) round.fused.push_back(read_fused(fused, where));
    result.push_back(std::move(round));
  }
  return result;
}

std::string rounds_json_text(const std::vector<RoundWork>& rounds, const RoundsTimeline* timeline,
                             const std::map<std::size_t, std::string>& pictures) {
  std::string text =
      "{\n  \"first_joint\": " + json_text(timeline != nullptr ? first_joint_json(timeline->first_joint) : Json(), -1) +
      ",\n  \"rounds\": [";
  for (std::size_t i = 0; i < rounds.size(); ++i) {
    Json tiers = Json::array();
    for (std::size_t k = 0; k < rounds[i].fused.size(); ++k)
      tiers.push_back(tier_json(rounds[i].fused[k], timeline != nullptr ? &timeline->rounds.at(i).at(k) : nullptr));
    const auto picture = pictures.find(i);
    const Json line = {{"at_seconds", rounds[i].at_s},
                       {"robots", robots_json(rounds[i])},
                       {"tiers", tiers},
                       {"picture", picture != pictures.end() ? Json(picture->second) : Json()}};
    text += (i == 0 ? "\n    " : ",\n    ") + json_text(line, -1);
  }
  return text + "\n  ]\n}\n";
}

std::string in_words(const RoundsTimeline& timeline, std::size_t rounds) {
  if (rounds == 0) return "";
  std::string text = format("rounds: %zu while the robots drove; ", rounds);
  if (const auto& joint = timeline.first_joint)
    text += format("first joint map: %s, at %s %.1f s after the team's start, of %.1f s of data\n",
                   joined(joint->maps).c_str(), joint->tier.str().c_str(), joint->ready_s, joint->at_s);
  else
    text += "no two maps were joined before the robots had ended\n";
  for (const RoundsTimeline::Tier& tier : timeline.tiers) {
    text += format("rounds at %s: %zu previews, never older than %.1f s; %.2f s of processor time",
                   tier.tier.str().c_str(), tier.fused, tier.most_age_s, tier.fusing_cpu_s);
    if (tier.bytes > 0) text += format(", %.2f MB to the cloud", static_cast<double>(tier.bytes) / 1e6);
    text += "\n";
  }
  return text;
}

std::vector<std::string> notes_of(const RoundsTimeline& timeline) {
  std::vector<std::string> notes;
  for (const RoundsTimeline::Tier& tier : timeline.tiers)
    if (tier.left_out > 0)
      notes.push_back(
          format("rounds come faster than %s fuses: it would have left out %zu of %zu, since one takes up "
                 "to %.2g s; a longer cloud.rounds.period_s, or more new area, spares what they cost",
                 tier.tier.str().c_str(), tier.left_out, tier.left_out + tier.fused, tier.slowest_s));
  return notes;
}

}  // namespace mapweave::runtime
