#include <mapweave/scheduling/problem.h>

#include <mapweave/scheduling/json_fields.h>

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/nearest_name.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <limits>
#include <set>
#include <unordered_map>

namespace mapweave::scheduling {
namespace {

using Json = nlohmann::json;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kSlowest_bytes_per_s = 1e-3;  // a slower link never delivers anything
constexpr std::uint32_t kMostRobots = 1'000'000;

// Names in their order, and back.
class Names {
 public:
  Names(const char* kind, const std::string& where) : kind_(kind), where_(where) {}
  void add(const std::string& name, const std::string& key) {
    if (!index_.emplace(name, static_cast<std::uint32_t>(index_.size())).second)
      refuse(std::string(kind_) + " '" + name + "' stands there twice", where_, key, "ids are unique");
    names_.push_back(name);
  }
  std::uint32_t find(const Json& value, const std::string& key) const {
    const std::string given = name(value, where_, key);
    if (const auto found = index_.find(given); found != index_.end()) return found->second;
    constexpr std::size_t kFew = 10000;  // looking for the nearest takes time
    const auto nearest = names_.size() <= kFew ? nearest_name(given, names_) : std::nullopt;
    refuse(std::string("there is no ") + kind_ + " '" + given + "'", where_, key,
           nearest ? "did you mean '" + *nearest + "'?" : std::string("name it in '") + kind_ + "s'");
  }

 private:
  const char* kind_;
  std::string where_;
  std::vector<std::string> names_;
  std::unordered_map<std::string, std::uint32_t> index_;
};

std::string at(const char* list, std::size_t index) { return std::string(list) + "[" + std::to_string(index) + "]"; }

const Json& list_of(const Json& object, const char* list, const std::string& where) {
  const Json& value = member(object, list, where, "");
  if (!value.is_array()) refuse(std::string("a list was expected, not ") + value.type_name(), where, list, "");
  return value;
}

void expect_items(const Json& value, std::size_t count, const char* what, const std::string& where,
                  const std::string& key) {
  if (!value.is_array() || value.size() != count)
    refuse(std::string("a list ") + what + " was expected", where, key, "");
}

EdgeResources edge_of(const Json& value, const std::string& where, const std::string& key) {
  expect_object(value, {"id", "bandwidth_bytes_per_s", "speed", "capacity", "delay_s"}, where, key);
  EdgeResources edge;
  edge.id = TierId(name(member(value, "id", where, key), where, key + ".id"));
  edge.bandwidth_bytes_per_s = number(member(value, "bandwidth_bytes_per_s", where, key), kSlowest_bytes_per_s,
                                      kInfinity, false, where, key + ".bandwidth_bytes_per_s");
  if (value.contains("speed")) edge.speed = number(value["speed"], 0.0, kInfinity, true, where, key + ".speed");
  if (value.contains("delay_s")) edge.delay_s = number(value["delay_s"], 0.0, 1e9, false, where, key + ".delay_s");
  if (value.contains("capacity") && !value["capacity"].is_null()) {
    const double capacity = number(value["capacity"], 0.0, 1e9, false, where, key + ".capacity");
    if (capacity != static_cast<std::uint32_t>(capacity))
      refuse(value["capacity"].dump() + " robots are no whole number", where, key + ".capacity", "null: no bound");
    edge.capacity = static_cast<std::uint32_t>(capacity);
  }
  return edge;
}

CloudResources cloud_of(const Json& value, const std::string& where) {
  expect_object(value, {"speed", "edges_judge"}, where, "cloud");
  CloudResources cloud;
  if (value.contains("speed")) cloud.speed = number(value["speed"], 0.0, kInfinity, true, where, "cloud.speed");
  if (value.contains("edges_judge")) {
    if (!value["edges_judge"].is_boolean()) refuse("true or false was expected", where, "cloud.edges_judge", "");
    cloud.edges_judge = value["edges_judge"].get<bool>();
  }
  return cloud;
}

OverlapGraph overlaps_of(const Json& list, std::size_t count, const Names& robots, const std::string& where) {
  std::vector<OverlapLink> links;
  links.reserve(list.size());
  std::set<std::pair<std::uint32_t, std::uint32_t>> seen;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::string key = at("overlaps", i);
    expect_items(list[i], 3, "[robot, robot, overlap degree]", where, key);
    const std::uint32_t a = robots.find(list[i][0], key), b = robots.find(list[i][1], key);
    if (a == b) refuse("robot '" + list[i][0].get<std::string>() + "' overlaps with itself", where, key, "remove it");
    if (!seen.emplace(std::minmax(a, b)).second)
      refuse("'" + list[i][0].get<std::string>() + "' and '" + list[i][1].get<std::string>() + "' stand there twice",
             where, key, "give each pair once, in either order");
    constexpr double kLargest = 1e12;  // far from where sums lose their digits
    links.push_back({a, b, number(list[i][2], 0.0, kLargest, false, where, key)});
  }
  return OverlapGraph(count, links);
}

void read_scans(const Json& object, const Names& robots, Problem& problem, const std::string& where) {
  if (!object.is_object())
    refuse(std::string("an object was expected, not ") + object.type_name(), where, "robot_scans", "");
  for (const auto& [robot, scans] : object.items())
    problem.scans[robots.find(robot, "robot_scans")] = number(scans, 0.0, 1e12, false, where, "robot_scans." + robot);
}

void read_links(const Json& list, const Names& robots, const Names& edges, Problem& problem, const std::string& where) {
  if (!list.is_array()) refuse(std::string("a list was expected, not ") + list.type_name(), where, "links", "");
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::string key = at("links", i);
    expect_items(list[i], 4, "[robot, edge, bytes per second, delay in seconds]", where, key);
    const std::pair between(robots.find(list[i][0], key), edges.find(list[i][1], key));
    const RobotLink link{number(list[i][2], kSlowest_bytes_per_s, kInfinity, false, where, key),
                         number(list[i][3], 0.0, 1e9, false, where, key)};
    if (!problem.links.emplace(between, link).second)
      refuse("the link from '" + list[i][0].get<std::string>() + "' to '" + list[i][1].get<std::string>() +
                 "' stands there twice",
             where, key, "keep one of them");
  }
}

}  // namespace

Problem parse_problem(std::string_view json, const std::string& where) {
  const Json root = parse_json(json, where);
  expect_object(root, {"robots", "overlaps", "edges", "cloud", "robot_scans", "links"}, where, "");
  Problem problem;
  Names robots("robot", where), edges("edge", where);
  const Json& listed = list_of(root, "robots", where);
  if (listed.empty()) refuse("there are no robots", where, "robots", "name at least one");
  if (listed.size() > kMostRobots)
    refuse("there are more than a million robots", where, "robots", "plan for fewer at a time");
  for (std::size_t i = 0; i < listed.size(); ++i) {
    const std::string id = name(listed[i], where, at("robots", i));
    robots.add(id, at("robots", i));
    problem.robots.emplace_back(id);
  }
  const Json& edges_listed = list_of(root, "edges", where);
  if (edges_listed.empty())
    refuse("there are no edges", where, "edges", "name at least one edge; `mapweave run` needs none to map on board");
  for (std::size_t i = 0; i < edges_listed.size(); ++i) {
    problem.edges.push_back(edge_of(edges_listed[i], where, at("edges", i)));
    edges.add(problem.edges.back().id.str(), at("edges", i));
  }
  problem.overlaps = overlaps_of(list_of(root, "overlaps", where), problem.robots.size(), robots, where);
  if (root.contains("cloud")) problem.cloud = cloud_of(root["cloud"], where);
  problem.scans.resize(problem.robots.size());
  if (root.contains("robot_scans")) read_scans(root["robot_scans"], robots, problem, where);
  if (root.contains("links")) read_links(root["links"], robots, edges, problem, where);
  group_sizes(problem, where);
  return problem;
}

Problem read_problem(const std::filesystem::path& path) {
  constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 28;
  return parse_problem(read_file(path, kMostBytes), path.string());
}

std::vector<std::uint32_t> group_sizes(const Problem& problem, const std::string& where) {
  const auto robots = static_cast<std::uint32_t>(problem.robots.size());
  std::vector<std::uint32_t> rooms;
  std::uint64_t all = 0;
  for (const EdgeResources& edge : problem.edges) {
    rooms.push_back(std::min(edge.capacity.value_or(robots), robots));
    all += rooms.back();
  }
  if (all < robots)
    refuse("the edges' capacities hold " + std::to_string(all) + " of " + std::to_string(robots) + " robots", where,
           "edges", "raise capacities, or add an edge");
  // The smallest rooms first: each takes its share of those who are left, or is full.
  std::sort(rooms.begin(), rooms.end());
  std::vector<std::uint32_t> sizes;
  std::uint32_t left = robots;
  for (std::size_t i = 0; i < rooms.size(); ++i) {
    const std::uint32_t size = std::min(rooms[i], left / static_cast<std::uint32_t>(rooms.size() - i));
    left -= size;
    if (size > 0) sizes.push_back(size);
  }
  std::sort(sizes.rbegin(), sizes.rend());
  return sizes;
}

}  // namespace mapweave::scheduling
