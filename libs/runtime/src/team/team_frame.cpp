#include "given_maps.h"

#include <mapweave/core/format.h>
#include <mapweave/core/nearest_name.h>
#include <mapweave/fusion/team_frame.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>

namespace mapweave::runtime {
namespace {

using Kind = FrameRequest::Kind;

std::optional<double> number(const std::string& text) {
  std::size_t used = 0;
  double value = NAN;
  try {
    value = std::stod(text, &used);
  } catch (const std::exception&) {
    return std::nullopt;
  }
  return used == text.size() && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

class Choosing {
 public:
  Choosing(const FrameChoice& choice, const std::vector<const Map*>& own, fusion::FusionResult& result)
      : choice_(choice), own_(own), result_(result) {
    if (choice.request.kind != Kind::named) return;
    const auto called = std::find_if(choice.given.begin(), choice.given.end(),
                                     [&](const GivenMap& one) { return one.name == choice.request.name; });
    if (called != choice.given.end()) preferred_ = &*called;
    if (preferred_ != nullptr) return;
    const auto map = std::find_if(own.begin(), own.end(), [&](const Map* one) { return is_called(*one); });
    if (map != own.end()) preferred_ = &as_given(**map, choice.request.name);
  }

  TeamFrame choose(std::size_t team) {
    const GivenMap& given = giver(team);
    TeamFrame frame;
    frame.of = given.name;
    if (&given == preferred_) frame.kind = Kind::named;
    keep(team, given, frame);
    const bool has_first = &given == &choice_.given.front();
    std::optional<double> walls_rad;
    if (choice_.request.kind == Kind::walls) {
      frame.kind = Kind::walls;
      walls_rad = fusion::direction_of_walls(result_.components[team].map);
      frame.has_no_walls = !walls_rad;
    }
    if (walls_rad) {
      move(team, Pose2(0.0, 0.0, -*walls_rad), frame);
    } else if (choice_.request.kind == Kind::given && has_first) {
      frame.kind = Kind::given;
      move(team, choice_.request.team_from_first, frame);
    } else {
      frame.continued = given.identity;
    }
    return frame;
  }

 private:
  bool is_called(const Map& map) const {
    const auto robots = map.robots();
    return map.id.str() == choice_.request.name || (robots.size() == 1 && robots.front().str() == choice_.request.name);
  }

  const GivenMap& as_given(const Map& map, const std::string& name) { return made_.emplace_back(given_map(map, name)); }
  const Map& own_map(const MapId& id) const {
    return **std::find_if(own_.begin(), own_.end(), [&](const Map* one) { return one->id == id; });
  }

  bool has(std::size_t team, const GivenMap::Member& member) const {
    const auto& members = result_.components[team].members;
    return std::binary_search(members.begin(), members.end(), member.map) && !member.poses.empty();
  }

  // Of a given team that is apart now, the frame stays with the first of its maps.
  bool has_frame_of(const GivenMap& given, std::size_t team) const {
    for (const GivenMap::Member& member : given.members)
      for (std::size_t other = 0; other < result_.components.size(); ++other)
        if (has(other, member)) return other == team;
    return false;
  }

  const GivenMap& giver(std::size_t team) {
    if (preferred_ != nullptr && has_frame_of(*preferred_, team)) return *preferred_;
    for (const GivenMap& given : choice_.given)
      if (has_frame_of(given, team)) return given;
    for (const GivenMap& given : choice_.given)
      for (const GivenMap::Member& member : given.members)
        if (has(team, member)) return as_given(own_map(member.map), member.map.str());
    return as_given(own_map(result_.components[team].members.front()), result_.components[team].members.front().str());
  }

  // The first place of the given map goes where that has it. Poses that are as given but for rounding stay.
  void keep(std::size_t team, const GivenMap& given, TeamFrame& frame) {
    constexpr double kNothing = 1e-9;
    const fusion::Component& component = result_.components[team];
    std::optional<Pose3> shift;
    double sum_m2 = 0.0;
    std::size_t count = 0;
    for (const GivenMap::Member& member : given.members) {
      if (!has(team, member)) continue;
      const bool is_rescaled = component.scales.contains(member.map);
      const Map& map = own_map(member.map);
      for (const auto& [place, pose] : member.poses) {
        const Node* node = component.map.nodes.find((map.nodes.begin() + static_cast<std::ptrdiff_t>(place))->first);
        if (node == nullptr) continue;
        if (!shift) {
          shift = compose(pose, inverse(node->map_from_node));
          frame.by = member.map;
        }
        if (is_rescaled) break;
        const double moved_m = (compose(*shift, node->map_from_node).t - pose.t).norm();
        sum_m2 += moved_m * moved_m;
        frame.most_moved_m = std::max(frame.most_moved_m, moved_m);
        ++count;
      }
    }
    if (!shift) return;
    if (count > 0) frame.moved_m = std::sqrt(sum_m2 / static_cast<double>(count));
    if (!component.map.submaps.empty()) shift = spatial(planar(*shift));
    if (shift->t.norm() > kNothing || shift->q.vec().norm() > kNothing) fusion::move_frame(result_, team, *shift);
  }

  void move(std::size_t team, const Pose2& team_from_given, TeamFrame& frame) {
    frame.team_from_given = team_from_given;
    fusion::move_frame(result_, team, spatial(team_from_given));
  }

  const FrameChoice& choice_;
  const std::vector<const Map*>& own_;
  fusion::FusionResult& result_;
  const GivenMap* preferred_ = nullptr;
  std::deque<GivenMap> made_;  // of robots' own maps that were given in a team
};

}  // namespace

FrameRequest parse_frame(const std::string& text, const std::vector<std::string>& names, const RequestPlace& place) {
  FrameRequest request;
  if (text.empty()) return request;
  if (std::find(names.begin(), names.end(), text) != names.end()) return {Kind::named, text};
  if (text == "walls") return {Kind::walls};
  if (text.find(',') != std::string::npos) {
    constexpr double kFarthest_m = 1e6, kMostYaw_rad = 7.0;
    std::vector<double> values;
    for (std::size_t begin = 0; begin <= text.size();) {
      const std::size_t end = std::min(text.find(',', begin), text.size());
      if (const auto value = number(text.substr(begin, end - begin))) values.push_back(*value);
      begin = end + 1;
    }
    const bool has_three = values.size() == 3 && std::count(text.begin(), text.end(), ',') == 2;
    if (!has_three || std::abs(values[0]) > kFarthest_m || std::abs(values[1]) > kFarthest_m ||
        std::abs(values[2]) > kMostYaw_rad)
      throw Error(place.code, "'" + text + "' is no frame: three numbers are expected, x,y,yaw", place.where,
                  "write where the first map's frame lies in the team's, in metres and radians, as 3.5,-1,1.57");
    return {Kind::given, "", Pose2(values[0], values[1], values[2])};
  }
  std::string list;
  for (const std::string& one : names) list += (list.empty() ? "" : ", ") + one;
  const auto nearest = nearest_name(text, names);
  throw Error(place.code, "no map or robot is called '" + text + "'; there are: " + list, place.where,
              nearest ? "did you mean '" + *nearest + "'?" : "name one of these, or write walls, or x,y,yaw");
}

std::string in_words(const TeamFrame& frame) {
  const Pose2& pose = frame.team_from_given;
  std::string text = "the frame is that of " + frame.of;
  if (frame.has_no_walls) text += " (no direction of walls stands out)";
  if (frame.kind == Kind::walls && !frame.has_no_walls)
    text += format(", turned by %.2f degrees: axes along the walls", pose.phi * 180.0 / M_PI);
  else if (frame.kind == Kind::given)
    text += format(", moved: its origin lies at (%.3f m, %.3f m), yaw %.4f rad", pose.x, pose.y, pose.phi);
  if (frame.most_moved_m > 5e-4)
    text += format("; within it the places of %s moved by %.3f m (RMS), at most %.3f m", frame.of.c_str(),
                   frame.moved_m, frame.most_moved_m);
  if (frame.continued.version > 0)
    text += "; map " + frame.continued.id + ", version " + std::to_string(frame.continued.version + 1);
  return text;
}

std::vector<std::string> with_names_of(const std::vector<GivenMap>& given, const std::vector<Map>& maps,
                                       std::vector<std::string> names) {
  for (const GivenMap& one : given) names.push_back(one.name);
  for (const Map& map : maps) {
    names.push_back(map.id.str());
    if (const auto robots = map.robots(); robots.size() == 1) names.push_back(robots.front().str());
  }
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

GivenMap given_map(const Map& own, const std::string& name, const MapIdentity& identity) {
  GivenMap given{name, identity, {{own.id, {}}}};
  std::size_t place = 0;
  for (const auto& entry : own.nodes) given.members.front().poses.emplace_back(place++, entry.second.map_from_node);
  return given;
}

void keep(const TeamFrame& frame, std::map<std::string, std::string>& metadata) {
  metadata["frame"] = in_words(frame);
  metadata["frame_kept_by"] = frame.by.str();
}

void keep(const MapIdentity& identity, std::map<std::string, std::string>& metadata) {
  metadata["map_id"] = identity.id;
  metadata["map_version"] = std::to_string(identity.version);
}

MapId frame_kept_by(const std::map<std::string, std::string>& metadata) {
  const auto text = metadata.find("frame_kept_by");
  return text == metadata.end() ? MapId() : MapId(text->second);
}

MapIdentity next_version(const MapIdentity& continued, const Hash& content) {
  constexpr std::size_t kLetters = 16;
  if (continued.version > 0) return {continued.id, continued.version + 1, content};
  return {to_hex(content).substr(0, kLetters), 1, content};
}

std::vector<TeamFrame> choose_frames(const FrameChoice& choice, const std::vector<const Map*>& own,
                                     fusion::FusionResult& result) {
  Choosing choosing(choice, own, result);
  std::vector<TeamFrame> frames;
  for (std::size_t team = 0; team < result.components.size(); ++team) frames.push_back(choosing.choose(team));
  return frames;
}

}  // namespace mapweave::runtime
