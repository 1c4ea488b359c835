#include <mapweave/scheduling/latency_model.h>

#include <mapweave/scheduling/json_fields.h>

#include <mapweave/core/files.h>
#include <mapweave/core/ids.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <limits>

namespace mapweave::scheduling {
namespace {

using Json = nlohmann::json;

// The fields of a struct, by name; `above`: 0 itself would divide.
struct Field {
  const char* name;
  double* value;
  bool above;
};
std::vector<Field> fields_of(LatencyModel& model) {
  return {{"scans", &model.scans, false},
          {"pack_s_per_scan", &model.pack_s_per_scan, false},
          {"robot_bytes_fixed", &model.robot_bytes_fixed, false},
          {"scan_bytes", &model.scan_bytes, false},
          {"robot_bytes_per_s", &model.robot_bytes_per_s, true},
          {"robot_delay_s", &model.robot_delay_s, false},
          {"slam_s_per_scan", &model.slam_s_per_scan, false},
          {"map_bytes_per_scan", &model.map_bytes_per_scan, false},
          {"map_bytes_fixed", &model.map_bytes_fixed, false},
          {"edge_bytes_per_map_byte", &model.edge_bytes_per_map_byte, false},
          {"cloud_delay_s", &model.cloud_delay_s, false}};
}
std::vector<std::pair<const char*, FusionTime*>> fusions_of(LatencyModel& model) {
  return {{"edge_fusion", &model.edge_fusion}, {"cloud_fusion", &model.cloud_fusion}};
}
std::vector<Field> fields_of(FusionTime& fusion) {
  return {{"fixed_s", &fusion.fixed_s, false},
          {"per_scan_s", &fusion.per_scan_s, false},
          {"per_scan_pair_s", &fusion.per_scan_pair_s, false},
          {"per_shared_scan_s", &fusion.per_shared_scan_s, false}};
}

void read(const Json& object, const std::vector<Field>& fields, const std::string& where, const std::string& prefix) {
  constexpr double kLargest = 1e15;
  for (const Field& field : fields)
    if (const auto found = object.find(field.name); found != object.end())
      *field.value = number(*found, 0.0, kLargest, field.above, where, prefix + field.name);
}

const auto kFusionFields = {"fixed_s", "per_scan_s", "per_scan_pair_s", "per_shared_scan_s"};

FusionTime read_fusion(const Json& object, FusionTime fusion, const std::string& where, const std::string& key) {
  expect_object(object, kFusionFields, where, key);
  read(object, fields_of(fusion), where, key + ".");
  return fusion;
}

void read_edges(const Json& edges, const std::string& where, LatencyModel& model) {
  constexpr double kLargest = 1e15;
  if (!edges.is_object()) refuse("an object was expected: what each edge is like, by its name", where, "edges", "");
  for (const auto& [id, own] : edges.items()) {
    const std::string key = "edges." + id;
    if (!is_valid_name(id)) refuse("this cannot be the name of an edge", where, key, "");
    expect_object(own, {"slam_s_per_scan", "bytes_per_map_byte", "fusion"}, where, key);
    EdgeLatency& edge = model.edges[id];
    for (const auto& [name, value] : {std::make_pair("slam_s_per_scan", &edge.slam_s_per_scan),
                                      std::make_pair("bytes_per_map_byte", &edge.bytes_per_map_byte)})
      if (own.contains(name)) *value = number(own[name], 0.0, kLargest, false, where, key + "." + name);
    if (own.contains("fusion")) edge.fusion = read_fusion(own["fusion"], model.edge_fusion, where, key + ".fusion");
  }
}

nlohmann::ordered_json fusion_json(FusionTime fusion) {
  nlohmann::ordered_json json;
  for (const Field& field : fields_of(fusion)) json[field.name] = *field.value;
  return json;
}

}  // namespace

LatencyModel parse_model(std::string_view json, const std::string& where) {
  const Json root = parse_json(json, where);
  expect_object(root,
                {"scans", "pack_s_per_scan", "robot_bytes_fixed", "scan_bytes", "robot_bytes_per_s", "robot_delay_s",
                 "slam_s_per_scan", "map_bytes_per_scan", "map_bytes_fixed", "edge_bytes_per_map_byte", "cloud_delay_s",
                 "edge_fusion", "cloud_fusion", "edges"},
                where, "");
  LatencyModel model;
  read(root, fields_of(model), where, "");
  for (const auto& [name, fusion] : fusions_of(model)) {
    if (root.contains(name)) *fusion = read_fusion(root[name], *fusion, where, name);
  }
  if (root.contains("edges")) read_edges(root["edges"], where, model);
  return model;
}

LatencyModel read_model(const std::filesystem::path& path) {
  constexpr std::uint64_t kMostBytes = 1 << 20;
  return parse_model(read_file(path, kMostBytes), path.string());
}

std::string model_json(const LatencyModel& model) {
  LatencyModel copy = model;
  nlohmann::ordered_json root;
  for (const Field& field : fields_of(copy)) root[field.name] = *field.value;
  for (const auto& [name, fusion] : fusions_of(copy)) root[name] = fusion_json(*fusion);
  for (const auto& [id, edge] : model.edges) {
    nlohmann::ordered_json& own = root["edges"][id] = nlohmann::ordered_json::object();
    if (edge.slam_s_per_scan) own["slam_s_per_scan"] = *edge.slam_s_per_scan;
    if (edge.bytes_per_map_byte) own["bytes_per_map_byte"] = *edge.bytes_per_map_byte;
    if (edge.fusion) own["fusion"] = fusion_json(*edge.fusion);
  }
  return root.dump(2) + "\n";
}

Latency::Latency(const Problem& problem, const LatencyModel& model) : problem_(problem), model_(model) {
  for (const EdgeResources& edge : problem.edges) {
    const auto found = model.edges.find(edge.id.str());
    const EdgeLatency own = found != model.edges.end() ? found->second : EdgeLatency();
    edge_models_.push_back({own.slam_s_per_scan.value_or(model.slam_s_per_scan),
                            own.bytes_per_map_byte.value_or(model.edge_bytes_per_map_byte),
                            own.fusion.value_or(model.edge_fusion)});
  }
  for (std::uint32_t robot = 0; robot < problem.robots.size(); ++robot) {
    map_bytes_.push_back(model.map_bytes_fixed + model.map_bytes_per_scan * scans(robot));
    for (const Neighbour& other : problem.overlaps.neighbours(robot))
      if (other.vertex < robot) all_shared_ += shared_scans(robot, other);
  }
}

// A weight above a half is no overlap degree: it counts as a map that is shared as a whole.
double Latency::shared_scans(std::uint32_t robot, const Neighbour& other) const {
  return std::min(0.5, other.weight) * (scans(robot) + scans(other.vertex));
}

double Latency::shared_scans(const std::vector<std::uint32_t>& robots) const {
  double shared = 0.0;
  for (const std::uint32_t robot : robots)
    for (const Neighbour& other : problem_.overlaps.neighbours(robot))
      if (other.vertex < robot && std::binary_search(robots.begin(), robots.end(), other.vertex))
        shared += shared_scans(robot, other);
  return shared;
}

double Latency::shared_part(std::uint32_t robot, std::uint32_t other, double degree) const {
  const double mine = map_bytes_[robot], theirs = map_bytes_[other];
  return mine > 0.0 ? std::min({1.0, degree * (mine + theirs) / mine, theirs / mine}) : 0.0;
}

LatencyTerms::RobotTerms Latency::robot_terms(std::uint32_t robot, std::uint32_t edge) const {
  const auto link = problem_.links.find({robot, edge});
  const RobotLink wire =
      link != problem_.links.end() ? link->second : RobotLink{model_.robot_bytes_per_s, model_.robot_delay_s};
  const auto& known = problem_.edge_of;
  const double times = robot < known.size() && known[robot] && *known[robot] != edge ? 2.0 : 1.0;
  const double bytes = model_.robot_bytes_fixed + scans(robot) * model_.scan_bytes;
  return {robot, scans(robot) * model_.pack_s_per_scan, times * bytes / wire.bytes_per_s + wire.delay_s,
          times * scans(robot) * edge_models_[edge].slam_s_per_scan / problem_.edges[edge].speed};
}

double Latency::fused_bytes(const std::vector<std::uint32_t>& robots) const {
  double all = 0.0, largest = 0.0;
  for (const std::uint32_t robot : robots) {
    double fresh = map_bytes_[robot];
    largest = std::max(largest, fresh);
    const auto neighbours = problem_.overlaps.neighbours(robot);
    auto other = robots.begin();
    for (const Neighbour& neighbour : neighbours) {
      if (neighbour.vertex >= robot) break;
      other = std::lower_bound(other, robots.end(), neighbour.vertex);
      if (other != robots.end() && *other == neighbour.vertex)
        fresh *= 1.0 - shared_part(robot, neighbour.vertex, neighbour.weight);
    }
    all += fresh;
  }
  return std::max(all, largest);
}

LatencyTerms::EdgeTerms Latency::edge_terms(const std::vector<std::uint32_t>& robots, std::uint32_t edge) const {
  LatencyTerms::EdgeTerms terms;
  if (robots.empty()) return terms;
  FusedScans fused;
  double bytes = 0.0;
  for (const std::uint32_t robot : robots) {
    terms.robots.push_back(robot_terms(robot, edge));
    fused.add(scans(robot));
    bytes += sent_bytes(robot, edge);
  }
  if (edge_fusion(edge).per_shared_scan_s > 0.0) fused.shared = shared_scans(robots);
  terms.fusion_s = edge_fusion(edge).seconds(fused) / problem_.edges[edge].speed;
  terms.transfer_s = bytes / problem_.edges[edge].bandwidth_bytes_per_s + cloud_delay_s(edge);
  return terms;
}

double Latency::computing_seconds(const std::vector<std::uint32_t>& robots, std::uint32_t edge) const {
  return edge_terms(robots, edge).computing_seconds();
}

double Latency::edge_seconds(const std::vector<std::uint32_t>& robots, std::uint32_t edge) const {
  return edge_terms(robots, edge).seconds();
}

LatencyTerms Latency::terms(const std::vector<std::vector<std::uint32_t>>& robots_at) const {
  LatencyTerms terms;
  std::vector<double> scans_at;
  for (std::uint32_t edge = 0; edge < robots_at.size(); ++edge) {
    terms.edges.push_back(edge_terms(robots_at[edge], edge));
    double& of_edge = scans_at.emplace_back();
    for (const std::uint32_t robot : robots_at[edge]) of_edge += scans(robot);
  }
  terms.fusion_s = cloud_seconds(scans_at);
  return terms;
}

double Latency::cloud_seconds(const std::vector<double>& scans_at) const {
  FusedScans fused;
  double used = 0.0, slowest = std::numeric_limits<double>::infinity();
  for (std::uint32_t edge = 0; edge < scans_at.size(); ++edge) {
    fused.add(scans_at[edge]);
    if (scans_at[edge] == 0.0) continue;
    used += 1.0;
    slowest = std::min(slowest, problem_.edges[edge].speed);
  }
  if (problem_.cloud.edges_judge && used > 0.0) fused.share_out(used * slowest / problem_.cloud.speed);
  fused.shared = all_shared_;
  return model_.cloud_fusion.seconds(fused) / problem_.cloud.speed;
}

double LatencyTerms::EdgeTerms::computing_seconds() const {
  double slowest = 0.0;
  for (const RobotTerms& robot : robots) slowest = std::max(slowest, robot.seconds());
  return slowest + fusion_s;
}

double LatencyTerms::total_seconds() const {
  double last = 0.0;
  for (const EdgeTerms& edge : edges) last = std::max(last, edge.seconds());
  return last + fusion_s;
}

}  // namespace mapweave::scheduling
