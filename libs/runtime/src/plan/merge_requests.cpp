#include <mapweave/runtime/merge_requests.h>

#include <mapweave/core/error.h>
#include <mapweave/core/nearest_name.h>

#include <algorithm>
#include <cmath>

namespace mapweave::runtime {
namespace {

bool is_called(const Map& map, const std::string& name) {
  if (map.id.str() == name) return true;
  const auto robots = map.robots();
  return robots.size() == 1 && robots.front().str() == name;
}

// Maps called so; where none is, those of the robot called so.
std::vector<MapId> maps_called(const std::string& name, const std::vector<Map>& maps, const std::string& option) {
  std::vector<MapId> found;
  for (const Map& map : maps)
    if (is_called(map, name)) found.push_back(map.id);
  if (!found.empty()) return found;
  std::vector<std::string> names;
  for (const Map& map : maps) names.push_back(map.id.str());
  std::sort(names.begin(), names.end());
  std::string list;
  for (const std::string& one : names) list += (list.empty() ? "" : ", ") + one;
  const auto nearest = nearest_name(name, names);
  throw Error(ErrorCode::kUsage, "unknown robot '" + name + "'; the maps have: " + list, option,
              nearest ? "did you mean '" + *nearest + "'?" : "name one of these");
}

// The one map that a prior is about.
MapId map_called(const std::string& name, const std::vector<Map>& maps, const std::string& option) {
  const auto found = maps_called(name, maps, option);
  for (const MapId& id : found)
    if (id.str() == name) return id;
  if (found.size() > 1)
    throw Error(ErrorCode::kUsage, "robot '" + name + "' has " + std::to_string(found.size()) + " maps", option,
                "name one of them, as in '" + found.front().str() + "'");
  return found.front();
}

bool is_known(const StartedMap& one) { return one.start.sigma_m > 0.0 && !one.map->nodes.empty(); }

constexpr const char* kAnchorForm =
    "write A,B,x,y,yaw[,sigma] in metres and radians, as in --anchor alpha,beta,3.5,-1,1.57,0.5";

double number_in(const std::string& text, const std::string& what, double low, double high) {
  std::size_t used = 0;
  double value = NAN;
  try {
    value = std::stod(text, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used != text.size() || text.empty() || !std::isfinite(value))
    throw Error(ErrorCode::kUsage, "its " + what + " is '" + text + "', not a number", "--anchor", kAnchorForm);
  if (value < low || value > high)
    throw Error(ErrorCode::kUsage, "its " + what + " is " + text + ", which is out of range", "--anchor", kAnchorForm);
  return value;
}

}  // namespace

Anchor parse_anchor(std::string_view text) {
  std::vector<std::string> parts(1);
  for (const char letter : text) {
    if (letter == ',')
      parts.emplace_back();
    else
      parts.back() += letter;
  }
  constexpr std::size_t kFewest = 5, kMost = 7;
  if (parts.size() < kFewest || parts.size() > kMost || parts[0].empty() || parts[1].empty())
    throw Error(ErrorCode::kUsage,
                "'" + std::string(text) + "' has " + std::to_string(parts.size()) + " parts; 5 to 7 are expected",
                "--anchor", kAnchorForm);
  // A full turn and what is written beyond it; a sigma that divides, and below which nobody measures.
  constexpr double kFarthest_m = 1e6, kMostYaw_rad = 7.0, kLeastSigma = 1e-3;
  Anchor anchor;
  anchor.a = parts[0];
  anchor.b = parts[1];
  anchor.a_from_b.x = number_in(parts[2], "x", -kFarthest_m, kFarthest_m);
  anchor.a_from_b.y = number_in(parts[3], "y", -kFarthest_m, kFarthest_m);
  anchor.a_from_b.phi = number_in(parts[4], "yaw", -kMostYaw_rad, kMostYaw_rad);
  if (parts.size() > 5) anchor.sigma_m = number_in(parts[5], "sigma", kLeastSigma, kFarthest_m);
  if (parts.size() > 6) anchor.sigma_rad = number_in(parts[6], "sigma of the yaw", kLeastSigma, kMostYaw_rad);
  return anchor;
}

std::pair<std::string, std::string> parse_pair(std::string_view text, const RequestPlace& place) {
  const std::size_t comma = text.find(',');
  if (comma == std::string_view::npos || comma == 0 || comma + 1 == text.size() ||
      text.find(',', comma + 1) != std::string_view::npos)
    throw Error(place.code, "'" + std::string(text) + "' is no pair of names", place.where,
                place.code == ErrorCode::kUsage ? "write A,B as in --refuse alpha,beta"
                                                : "write each pair in quotes, as in refuse: [\"alpha,beta\"]");
  return {std::string(text.substr(0, comma)), std::string(text.substr(comma + 1))};
}

std::optional<Hash> hash_in_hex(std::string_view text) {
  Hash hash;
  if (text.size() != 2 * hash.bytes.size()) return std::nullopt;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char letter = text[i];
    const bool is_number = letter >= '0' && letter <= '9';
    if (!is_number && (letter < 'a' || letter > 'f')) return std::nullopt;
    const int digit = is_number ? letter - '0' : letter - 'a' + 10;
    hash.bytes[i / 2] = static_cast<std::uint8_t>(hash.bytes[i / 2] << 4U | digit);
  }
  return hash;
}

Hash parse_veto(std::string_view text) {
  if (const auto hash = hash_in_hex(text)) return *hash;
  throw Error(ErrorCode::kUsage, "'" + std::string(text) + "' is no judgement", kVetoFlag,
              "write the 64 digits of one of `witnesses` in merges.json");
}

std::vector<Map> without(std::vector<Map> maps, const std::vector<std::string>& names) {
  std::vector<MapId> gone;
  for (const std::string& name : names)
    for (const MapId& id : maps_called(name, maps, "--without")) gone.push_back(id);
  const auto is_gone = [&](const Map& map) { return std::find(gone.begin(), gone.end(), map.id) != gone.end(); };
  maps.erase(std::remove_if(maps.begin(), maps.end(), is_gone), maps.end());
  if (maps.empty()) throw Error(ErrorCode::kUsage, "no map is left", "--without", "keep one of them");
  return maps;
}

void apply(const MergeRequests& requests, fusion::FusionInput& input, const std::string& refused_at) {
  input.vetoed.insert(requests.vetoed.begin(), requests.vetoed.end());
  for (const auto& [one, other] : requests.refused)
    for (const MapId& a : maps_called(one, input.maps, refused_at))
      for (const MapId& b : maps_called(other, input.maps, refused_at)) {
        if (a == b)
          throw Error(ErrorCode::kUsage, "'" + one + "' and '" + other + "' are one map", refused_at, "name two maps");
        input.refused.insert(std::minmax(a, b));
      }
  for (const Anchor& anchor : requests.anchors) {
    const MapId a = map_called(anchor.a, input.maps, "--anchor"), b = map_called(anchor.b, input.maps, "--anchor");
    if (a == b)
      throw Error(ErrorCode::kUsage, "'" + anchor.a + "' and '" + anchor.b + "' are one map", "--anchor",
                  "name two maps");
    for (const fusion::MapPrior& other : input.priors)
      if (std::minmax(other.a, other.b) == std::minmax(a, b))
        throw Error(ErrorCode::kUsage, "there are two priors of '" + anchor.a + "' and '" + anchor.b + "'", "--anchor",
                    "give the better one");
    input.priors.push_back({a, b, anchor.a_from_b, anchor.sigma_m, anchor.sigma_rad});
  }
}

std::vector<fusion::MapPrior> priors_of_starts(const std::vector<StartedMap>& maps) {
  std::vector<fusion::MapPrior> priors;
  const auto world_from_map = [](const StartedMap& one) {
    const auto first = std::min_element(one.map->nodes.begin(), one.map->nodes.end(),
                                        [](const auto& l, const auto& r) { return l.second.stamp < r.second.stamp; });
    return compose(Pose2{one.start.x_m, one.start.y_m, one.start.yaw_rad},
                   inverse(planar(first->second.map_from_node)));
  };
  for (auto a = maps.begin(); a != maps.end(); ++a)
    for (auto b = std::next(a); b != maps.end(); ++b) {
      if (!is_known(*a) || !is_known(*b)) continue;
      fusion::MapPrior prior{a->map->id, b->map->id, between(world_from_map(*a), world_from_map(*b))};
      const double swing_m =
          std::hypot(prior.a_from_b.x, prior.a_from_b.y) * std::max(a->start.sigma_rad, b->start.sigma_rad);
      prior.sigma_m = std::hypot(std::hypot(a->start.sigma_m, b->start.sigma_m), swing_m);
      prior.sigma_rad = std::hypot(a->start.sigma_rad, b->start.sigma_rad);
      priors.push_back(prior);
    }
  return priors;
}

std::optional<std::string> start_alone(const std::vector<StartedMap>& maps) {
  const auto known = std::find_if(maps.begin(), maps.end(), is_known);
  if (maps.size() < 2 || known == maps.end() || std::count_if(maps.begin(), maps.end(), is_known) > 1)
    return std::nullopt;
  return "where " + known->map->id.str() +
         " began is known, but of no other robot: alone it says nothing of how maps lie to each other";
}

}  // namespace mapweave::runtime
