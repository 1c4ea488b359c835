#include <mapweave/scheduling/profile.h>

#include <mapweave/scheduling/json_fields.h>

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/ids.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>

namespace mapweave::scheduling {
namespace {

using Json = nlohmann::json;
constexpr double kMost = 1e12;  // seconds or bytes: more are no measurement

struct Sample {
  double at, value;
  std::vector<double> basis;
};

struct OwnSamples {  // of one edge
  std::vector<Sample> slam_s, bytes, fusion_s;
};

struct Samples {
  std::vector<Sample> packing_s, sensed_bytes, slam_s, map_bytes, edge_bytes, edge_fusion_s, cloud_fusion_s;
  std::map<std::string, OwnSamples> own;
  double scans = 0.0, robots = 0.0;
  std::vector<std::string> notes;
  bool cameras = false;
};

const Json& list(const Json& root, const char* name, const std::string& where) {
  const Json& value = member(root, name, where, "");
  if (!value.is_array()) refuse("a list was expected", where, name, "is this the summary of `mapweave run`?");
  return value;
}

std::string text(const Json& object, const char* name, const std::string& where, const std::string& key) {
  if (!object.is_object()) refuse("an object was expected", where, key, "");
  const Json& value = member(object, name, where, key);
  if (!value.is_string()) refuse("a text was expected", where, key + "." + name, "");
  return value.get<std::string>();
}

struct RobotOfRun {
  double scans = 0.0;
  bool mapped = false, cameras = false;
  std::string edge;
};

std::map<std::string, RobotOfRun> robots_of(const Json& root, const std::string& where) {
  std::map<std::string, RobotOfRun> robots;
  for (const Json& given : list(root, "robots", where)) {
    RobotOfRun robot;
    robot.scans = field(given, "scans", kMost, where, "robots");
    const Json& mapped = member(given, "mapped", where, "robots");
    if (!mapped.is_boolean()) refuse("true or false was expected", where, "robots.mapped", "");
    robot.mapped = mapped.get<bool>();
    robot.cameras = given.contains("cameras");
    if (given.contains("edge")) robot.edge = text(given, "edge", where, "robots");
    const std::string id = name(member(given, "id", where, "robots"), where, "robots.id");
    if (!robots.emplace(id, robot).second) refuse("robot '" + id + "' stands there twice", where, "robots", "");
  }
  return robots;
}

Sample of_fusion(const FusedScans& fused, double seconds) {
  return {fused.scans, seconds, {1.0, fused.scans, fused.pairs, fused.shared}};
}

void add_robot(const Json& line, const RobotOfRun& robot, bool offload, const std::string& where, Samples& samples) {
  constexpr const char* kKey = "timeline.robots";
  const double scans = robot.scans, packing_s = field(line, "packing_cpu_seconds", kMost, where, kKey),
               mapping_s = field(line, "mapping_cpu_seconds", kMost, where, kKey),
               sensed_bytes = field(line, "sensed_bytes", kMost, where, kKey),
               map_bytes = field(line, "map_bytes", kMost, where, kKey);
  if (!robot.mapped || scans == 0.0) return;
  samples.scans += scans;
  samples.robots += 1.0;
  samples.slam_s.push_back({scans, mapping_s, {scans}});
  if (offload && !robot.edge.empty()) samples.own[robot.edge].slam_s.push_back(samples.slam_s.back());
  if (offload) samples.packing_s.push_back({scans, packing_s, {scans}});
  if (robot.cameras) return;  // what they sent and hold of cameras is no matter of scans
  if (offload) samples.sensed_bytes.push_back({scans, sensed_bytes, {scans}});
  samples.map_bytes.push_back({scans, map_bytes, {1.0, scans}});
}

std::vector<std::tuple<std::string, std::string, double>> overlaps_of(const Json& timeline, const std::string& where) {
  std::vector<std::tuple<std::string, std::string, double>> overlaps;
  if (!timeline.contains("overlaps")) return overlaps;  // of a program that did not record them
  for (const Json& given : list(timeline, "overlaps", where)) {
    constexpr const char* kKey = "timeline.overlaps";
    if (!given.is_array() || given.size() != 3)
      refuse("two robots and their overlap degree were expected", where, kKey, "");
    overlaps.emplace_back(name(given[0], where, kKey), name(given[1], where, kKey),
                          number(given[2], 0.0, 0.5, false, where, kKey));
  }
  return overlaps;
}

void add_run(const std::filesystem::path& folder, Samples& samples) {
  const std::filesystem::path path = folder / "summary.json";
  constexpr std::uint64_t kMostBytes = 1 << 26;
  const std::string where = path.string();
  const Json root = parse_json(read_file(path, kMostBytes), where);
  if (!root.is_object()) refuse("an object was expected", where, "", "");
  const auto robots = robots_of(root, where);
  if (!root.contains("timeline")) {
    samples.notes.push_back(where +
                            " has no timeline, which only runs of teams to their end have: nothing is learnt from it");
    return;
  }
  const Json& timeline = root["timeline"];
  if (!timeline.is_object()) refuse("an object was expected", where, "timeline", "");
  const std::string mode = text(timeline, "mode", where, "timeline");
  if (mode != "offload" && mode != "onboard" && mode != "cloud-only")
    refuse("there is no mode '" + mode.substr(0, 64) + "'", where, "timeline.mode", "offload, onboard, cloud-only");
  std::map<std::string, double> map_bytes;  // by edge
  for (const Json& line : list(timeline, "robots", where)) {
    const auto robot = robots.find(text(line, "id", where, "timeline.robots"));
    if (robot == robots.end()) refuse("a robot that is not among the robots of the run", where, "timeline.robots", "");
    add_robot(line, robot->second, mode == "offload", where, samples);
    map_bytes[robot->second.edge] += field(line, "map_bytes", kMost, where, "timeline.robots");
  }
  const bool cloud_only = mode == "cloud-only";
  std::map<std::string, FusedScans> at;  // by edge; where there are none, by robot
  std::map<std::string, bool> sees;      // has a robot with cameras
  bool anybody_sees = false;
  FusedScans all;
  for (const auto& [a, b, degree] : overlaps_of(timeline, where)) {
    const auto one = robots.find(a), other = robots.find(b);
    if (one == robots.end() || other == robots.end())
      refuse("a robot that is not among the robots of the run", where, "timeline.overlaps", "");
    const double shared = degree * (one->second.scans + other->second.scans);
    all.shared += shared;
    if (!cloud_only && one->second.edge == other->second.edge) at[one->second.edge].shared += shared;
  }
  for (const auto& [id, robot] : robots) {
    if (!robot.mapped) continue;
    const std::string& where_fused = cloud_only ? id : robot.edge;
    at[where_fused].add(robot.scans);
    sees[where_fused] = sees[where_fused] || robot.cameras;
    anybody_sees = anybody_sees || robot.cameras;
  }
  samples.cameras = samples.cameras || anybody_sees;
  double longest_judging_s = 0.0;
  for (const Json& line : list(timeline, "edges", where)) {
    longest_judging_s = std::max(longest_judging_s, field(line, "judging_cpu_seconds", kMost, where, "timeline.edges"));
    const std::string id = text(line, "id", where, "timeline.edges");
    const double seconds = field(line, "fusing_cpu_seconds", kMost, where, "timeline.edges");
    const double bytes = field(line, "bytes", kMost, where, "timeline.edges");
    if (const auto fused = at.find(id); fused != at.end() && fused->second.scans > 0.0 && !sees[id]) {
      samples.edge_fusion_s.push_back(of_fusion(fused->second, seconds));
      samples.edge_bytes.push_back({map_bytes[id], bytes, {map_bytes[id]}});
      samples.own[id].fusion_s.push_back(samples.edge_fusion_s.back());
      samples.own[id].bytes.push_back(samples.edge_bytes.back());
    }
  }
  const double seconds = longest_judging_s + field(member(timeline, "cloud", where, "timeline"), "fusing_cpu_seconds",
                                                   kMost, where, "timeline.cloud");
  for (const auto& [ignored, fused] : at) all.add(fused.scans);
  if (longest_judging_s > 0.0) all.share_out(static_cast<double>(at.size()));
  if (all.scans > 0.0 && !anybody_sees) samples.cloud_fusion_s.push_back(of_fusion(all, seconds));
}

// Fits seconds (or bytes) to their basis, and adds a few predictions. Nothing without samples.
std::optional<std::vector<double>> fitted(const std::string& name, const std::string& unit, std::vector<Sample> samples,
                                          Profile& profile, const char* basis = "scans") {
  if (samples.empty()) {
    profile.notes.push_back(name + " is not measured by these runs: its default stands");
    return std::nullopt;
  }
  std::stable_sort(samples.begin(), samples.end(), [](const Sample& a, const Sample& b) { return a.at < b.at; });
  Eigen::MatrixXd rows(static_cast<Eigen::Index>(samples.size()),
                       static_cast<Eigen::Index>(samples.front().basis.size()));
  Eigen::VectorXd measured(static_cast<Eigen::Index>(samples.size()));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    for (std::size_t k = 0; k < samples[i].basis.size(); ++k)
      rows(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = samples[i].basis[k];
    measured[static_cast<Eigen::Index>(i)] = samples[i].value;
  }
  ProfiledTerm term{name, basis, unit, fit_relative(rows, measured), 0.0, {}, {}};
  std::vector<double> off;
  for (std::size_t i = 0; i < samples.size(); ++i)
    if (samples[i].value > 0.0) off.push_back(std::abs(term.regression.residuals[i]) / samples[i].value);
  std::sort(off.begin(), off.end());
  if (!off.empty()) term.median_off = off[off.size() / 2];
  for (const Sample& sample : samples)
    term.samples.push_back({sample.at, sample.value, term.regression.interval(sample.basis)});
  for (const Sample* shown : {&samples.front(), &samples[samples.size() / 2], &samples.back()})
    if (term.shown.empty() || shown->at > term.shown.back().at)
      term.shown.push_back({shown->at, term.regression.at(shown->basis), term.regression.interval(shown->basis)});
  profile.terms.push_back(term);
  return term.regression.coefficients;
}

std::vector<double> coefficients_of(const std::vector<Sample>& samples) {
  const auto rows = static_cast<Eigen::Index>(samples.size()),
             columns = static_cast<Eigen::Index>(samples.front().basis.size());
  Eigen::MatrixXd basis(rows, columns);
  Eigen::VectorXd measured(rows);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Sample& sample = samples[static_cast<std::size_t>(i)];
    for (Eigen::Index k = 0; k < columns; ++k) basis(i, k) = sample.basis[static_cast<std::size_t>(k)];
    measured[i] = sample.value;
  }
  return fit_relative(basis, measured).coefficients;
}

// What its own runs say, where there are enough of them. All parts of fusion by themselves take many; fewer say how
// many times as long as on all edges it takes there.
EdgeLatency own_of(const OwnSamples& own, const LatencyModel& model) {
  constexpr std::size_t kEnough = 3, kEnoughForAllParts = 12;  // the same for each of the four parts
  EdgeLatency edge;
  if (own.slam_s.size() >= kEnough) edge.slam_s_per_scan = coefficients_of(own.slam_s).front();
  if (own.bytes.size() >= kEnough) edge.bytes_per_map_byte = coefficients_of(own.bytes).front();
  if (own.fusion_s.size() >= kEnoughForAllParts) {
    const std::vector<double> found = coefficients_of(own.fusion_s);
    edge.fusion = FusionTime{found[0], found[1], found[2], found[3]};
  } else if (own.fusion_s.size() >= kEnough) {
    std::vector<Sample> times = own.fusion_s;
    const FusionTime& all = model.edge_fusion;
    for (Sample& sample : times) {
      const std::vector<double>& parts = sample.basis;
      sample.basis = {all.fixed_s * parts[0] + all.per_scan_s * parts[1] + all.per_scan_pair_s * parts[2] +
                      all.per_shared_scan_s * parts[3]};
      if (!(sample.basis.front() > 0.0)) return edge;
    }
    const double factor = coefficients_of(times).front();
    edge.fusion = FusionTime{factor * all.fixed_s, factor * all.per_scan_s, factor * all.per_scan_pair_s,
                             factor * all.per_shared_scan_s};
  }
  return edge;
}

}  // namespace

Profile profile_runs(const std::vector<std::filesystem::path>& folders) {
  Samples samples;
  for (const auto& folder : folders) add_run(folder, samples);
  if (!folders.empty() && samples.notes.size() == folders.size())
    throw Error(ErrorCode::kBadInput, "no run has a timeline", folders.front().string(),
                "give folders of results of `mapweave run` that came to its end");
  Profile profile;
  profile.notes = samples.notes;
  if (samples.cameras)
    profile.notes.push_back("some robots have cameras: nothing is learnt of fusing their maps, nor of what they send");
  LatencyModel& model = profile.model;
  if (samples.robots > 0.0) model.scans = samples.scans / samples.robots;
  if (const auto found = fitted("packing", "s", samples.packing_s, profile)) model.pack_s_per_scan = found->front();
  if (const auto found = fitted("what robots send", "bytes", samples.sensed_bytes, profile))
    model.scan_bytes = found->front();
  if (const auto found = fitted("SLAM", "s", samples.slam_s, profile)) model.slam_s_per_scan = found->front();
  if (const auto found = fitted("size of a robot's map", "bytes", samples.map_bytes, profile)) {
    model.map_bytes_fixed = (*found)[0];
    model.map_bytes_per_scan = (*found)[1];
  }
  if (const auto found = fitted("what edges send", "bytes", samples.edge_bytes, profile, "bytes of its robots' maps"))
    model.edge_bytes_per_map_byte = found->front();
  if (const auto found = fitted("fusion on an edge", "s", samples.edge_fusion_s, profile))
    model.edge_fusion = {(*found)[0], (*found)[1], (*found)[2], (*found)[3]};
  if (const auto found = fitted("fusion in the cloud", "s", samples.cloud_fusion_s, profile))
    model.cloud_fusion = {(*found)[0], (*found)[1], (*found)[2], (*found)[3]};
  for (const auto& [id, own] : samples.own)
    if (const EdgeLatency edge = own_of(own, model); edge.slam_s_per_scan || edge.bytes_per_map_byte || edge.fusion)
      model.edges[id] = edge;
  return profile;
}

}  // namespace mapweave::scheduling
