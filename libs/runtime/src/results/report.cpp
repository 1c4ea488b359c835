#include "report_parts.h"

#include <mapweave/core/hash.h>
#include <mapweave/maps/alignment.h>
#include <mapweave/maps/reasons.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <map>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::ordered_json;

std::size_t pairs(const FusionReport& fusion, Decision decision) {
  std::size_t count = 0;
  for (const Verdict& verdict : fusion.verdicts) count += verdict.decision == decision;
  return count;
}

bool is_planar(const Sim3& motion) {
  constexpr double kNothing = 1e-9;
  return std::abs(motion.pose.t.z()) < kNothing && std::abs(motion.pose.q.x()) < kNothing &&
         std::abs(motion.pose.q.y()) < kNothing && std::abs(motion.scale - 1.0) < kNothing;
}

// a_from_b the other way round.
Json b_from_a(const Sim3& a_from_b) {
  if (is_planar(a_from_b)) {
    const Pose2 pose = inverse(planar(a_from_b.pose));
    return {{"x", pose.x}, {"y", pose.y}, {"yaw", pose.phi}};
  }
  const Eigen::Quaterniond q = a_from_b.pose.q.conjugate();
  const Eigen::Vector3d t = q * a_from_b.pose.t / -a_from_b.scale;
  return {{"t", {t.x(), t.y(), t.z()}}, {"q", {q.x(), q.y(), q.z(), q.w()}}, {"scale", 1.0 / a_from_b.scale}};
}

// The same, planar also where the scale differs.
Json b_from_a_with_scale(const Sim3& a_from_b) {
  if (!is_planar({a_from_b.pose, 1.0})) return b_from_a(a_from_b);
  const Pose2 pose = planar(inverse(a_from_b).pose);
  Json json = {{"x", pose.x}, {"y", pose.y}, {"yaw", pose.phi}};
  if (a_from_b.scale != 1.0) json["scale"] = 1.0 / a_from_b.scale;
  return json;
}

// Of b_from_a. Rows: x, y, yaw of a planar alignment, else all six.
Json covariance(const Alignment& a_from_b) {
  const Alignment alignment = is_planar(a_from_b.a_from_b) ? inverse(a_from_b) : a_from_b;
  const std::vector<int> rows =
      is_planar(alignment.a_from_b) ? std::vector<int>{0, 1, 5} : std::vector<int>{0, 1, 2, 3, 4, 5};
  Json matrix = Json::array();
  for (const int row : rows) {
    Json line = Json::array();
    for (const int column : rows) line.push_back(alignment.covariance(row, column));
    matrix.push_back(line);
  }
  return matrix;
}

Json hypothesis_json(const PairHypothesis& hypothesis) {
  Json contradictions = Json::array();
  for (const PairHypothesis::ContradictedWall& place : hypothesis.contradictions)
    contradictions.push_back({{"x_m", place.x_m}, {"y_m", place.y_m}, {"length_m", place.length_m}});
  return {{"sense", to_text(hypothesis.sense)},
          {"b_from_a", b_from_a_with_scale(hypothesis.a_from_b)},
          {"probability", 1.0 / (1.0 + std::exp(-hypothesis.log_odds))},
          {"log_odds", hypothesis.log_odds},
          {"prior_log_odds", hypothesis.prior_log_odds},
          {"matches", hypothesis.matches},
          {"coinciding_m", hypothesis.coinciding_m},
          {"distinctive_m", hypothesis.distinctive_m},
          {"wider_m", hypothesis.wider_m},
          {"contradicted_m", hypothesis.contradicted_m},
          {"unclear_m", hypothesis.unclear_m},
          {"counted_unclear_m", hypothesis.counted_unclear_m},
          {"by_chance_m", hypothesis.by_chance_m},
          {"support_m", hypothesis.support_m},
          {"overlap", hypothesis.overlap},
          {"elsewhere", hypothesis.elsewhere},
          {"of_teams", hypothesis.is_of_teams},
          {"taken_apart", hypothesis.is_taken_apart},
          {"contradictions", contradictions}};
}

Json prior_json(const PriorCheck& prior) {
  return {{"a_from_b", {{"x", prior.a_from_b.x}, {"y", prior.a_from_b.y}, {"yaw", prior.a_from_b.phi}}},
          {"sigma_m", prior.sigma_m},
          {"sigma_rad", prior.sigma_rad},
          {"contradicted", prior.is_contradicted},
          {"off_m", prior.off_m ? Json(*prior.off_m) : Json()},
          {"off_rad", prior.off_rad ? Json(*prior.off_rad) : Json()},
          {"coinciding_m", prior.coinciding_m},
          {"contradicted_m", prior.contradicted_m},
          {"because", in_words(prior)}};
}

Json audit_json(const fusion::PairAudit* audit) {
  if (audit == nullptr) return {};
  Json conflicts = Json::array();
  for (const auto& conflict : audit->conflicts)
    conflicts.push_back({{"x_m", conflict.x_m}, {"y_m", conflict.y_m}, {"length_m", conflict.length_m}});
  return {{"coinciding_m", audit->coinciding_m},
          {"contradicted_m", audit->contradicted_m},
          {"unclear_m", audit->unclear_m},
          {"conflicts", conflicts},
          {"taken_apart", audit->is_ghost}};
}

Json merge_json(const TeamMerge& merge) {
  return {{"of", names_json(merge.of)}, {"with", names_json(merge.with)}, {"probability", merge.probability}};
}

Json verdict_json(const TierId& tier, const Verdict& verdict, const fusion::PairAudit* audit) {
  Json witnesses = Json::array();
  for (const Hash& witness : verdict.witnesses) witnesses.push_back(to_hex(witness));
  Json hypotheses = Json::array();
  for (const PairHypothesis& hypothesis : verdict.hypotheses) hypotheses.push_back(hypothesis_json(hypothesis));
  return {{"tier", tier.str()},
          {"words", in_words(verdict)},
          {"a", verdict.a.str()},
          {"b", verdict.b.str()},
          {"kind", verdict.kind},
          {"accepted", verdict.decision == Decision::accepted},
          {"decision", to_text(verdict.decision)},
          {"reason", to_text(verdict.reason)},
          {"because", in_words(verdict.reason)},
          {"detail", verdict.detail},
          {"proposer", verdict.proposer},
          {"probability", verdict.probability},
          {"b_from_a", verdict.alignment ? b_from_a(verdict.alignment->a_from_b) : Json()},
          {"covariance", verdict.alignment ? covariance(*verdict.alignment) : Json()},
          {"overlap", verdict.overlap},
          {"conflict", verdict.conflict},
          {"second_best", verdict.second_best},
          {"witnesses", witnesses},
          {"in_one_map", verdict.in_one_map.has_value()},
          {"connected_through", verdict.in_one_map ? names_json(verdict.in_one_map->through) : Json::array()},
          {"team_b_from_a", verdict.in_one_map ? b_from_a_with_scale(verdict.in_one_map->a_from_b) : Json()},
          {"merge", verdict.merge ? merge_json(*verdict.merge) : Json()},
          {"audit", audit_json(audit)},
          {"hypotheses", hypotheses},
          {"prior", verdict.prior ? prior_json(*verdict.prior) : Json()},
          {"seconds", verdict.seconds}};
}

Json pose_json(const Pose3& pose) {
  if (is_planar({pose, 1.0})) {
    const Pose2 flat = planar(pose);
    return {{"x", flat.x}, {"y", flat.y}, {"yaw", flat.phi}};
  }
  const Eigen::Quaterniond& q = pose.q;
  return {{"t", {pose.t.x(), pose.t.y(), pose.t.z()}}, {"q", {q.x(), q.y(), q.z(), q.w()}}};
}

// Which frame a team has, and where its members' map frames lie in it.
Json frame_json(const TeamFrame& frame, const Table<MapId, Pose3>& team_from_maps) {
  static constexpr const char* kKinds[] = {"first", "named", "walls", "given"};
  Json members = Json::object();
  for (const auto& [map, pose] : team_from_maps) members[map.str()] = pose_json(pose);
  return {{"of", frame.of},
          {"kind", kKinds[static_cast<std::size_t>(frame.kind)]},
          {"words", in_words(frame)},
          {"kept_by", frame.by.str()},
          {"team_from_given", pose_json(spatial(frame.team_from_given))},
          {"moved_m", frame.moved_m},
          {"most_moved_m", frame.most_moved_m},
          {"team_from_maps", members}};
}

// How many merges each proposer found: of teams of laser maps, of pairs of others.
Json proposers_json(const FusionReport& fusion) {
  std::map<std::pair<std::vector<MapId>, std::vector<MapId>>, std::string> found;
  for (const Verdict& verdict : fusion.verdicts) {
    if (verdict.decision != Decision::accepted) continue;
    if (verdict.merge)
      found[{verdict.merge->of, verdict.merge->with}] = verdict.merge->proposer;
    else
      found[{{verdict.a}, {verdict.b}}] = verdict.proposer;
  }
  std::map<std::string, std::size_t> counts;
  for (const auto& [maps, proposer] : found) ++counts[proposer];
  return counts;
}

Json fusion_json(const FusionReport& fusion) {
  Json members = Json::array(), frames = Json::array();
  for (const auto& component : fusion.components) members.push_back(names_json(component));
  for (std::size_t i = 0; i < fusion.frames.size(); ++i)
    frames.push_back(frame_json(fusion.frames[i], fusion.team_from_maps[i]));
  return {{"components", fusion.components.size()},
          {"merged_pairs", pairs(fusion, Decision::accepted)},
          {"refused_pairs", pairs(fusion, Decision::refused)},
          {"deferred_pairs", pairs(fusion, Decision::deferred)},
          {"proposers", proposers_json(fusion)},
          {"members", members},
          {"frames", frames}};
}

Json coordination_json(const CoordinationReport& report, const std::optional<Timeline>& timeline) {
  Json decisions = Json::array();
  for (const tiers::CoordinatorDecision& decision : report.decisions) decisions.push_back(json_of(decision));
  Json json = {{"method", report.method},
               {"at", report.at},
               {"summary_bytes", report.summary_bytes},
               {"summary_seconds", report.summary_s},
               {"cpu_seconds", report.cpu_seconds},
               {"decisions", decisions}};
  // The last decision speaks of all that was sensed: what it expected, and what came.
  if (timeline && !report.decisions.empty()) {
    json["expected_seconds"] = report.decisions.back().expected_s;
    json["came_seconds"] = timeline->total_s;
  }
  return json;
}

Json camera_json(const CameraReport& camera) {
  Json loop_seconds = Json::array();  // of data: found, applied
  for (const CameraReport::Loop& loop : camera.loops) loop_seconds.push_back({loop.found_s, loop.applied_s});
  Json json = {{"label", camera.label},
               {"kind", camera.kind},
               {"frames", camera.frames},
               {"tracked", camera.tracked},
               {"lost", camera.lost},
               {"longest_loss_seconds", camera.longest_loss_s},
               {"sent_bytes", camera.sent_bytes},
               {"heard_bytes", camera.received_bytes},
               {"borrowed_landmarks", camera.borrowed},
               {"keyframes", camera.keyframes},
               {"landmarks", camera.landmarks},
               {"loops", camera.loops.size()},
               {"loop_seconds", loop_seconds},
               {"sessions", camera.sessions},
               {"tracking_mean_ms", camera.tracking_mean_ms},
               {"tracking_p99_ms", camera.tracking_p99_ms},
               {"keyframe_mean_ms", camera.keyframe_mean_ms},
               {"packing_mean_ms", camera.packing_mean_ms},
               {"readout_seconds", camera.readout_s},
               {"inverse_depth_offset", camera.inverse_depth_offset}};
  if (camera.passed_on_bytes > 0) json["passed_on_bytes"] = camera.passed_on_bytes;
  for (const CameraReport::Traffic& traffic : camera.traffic)  // second of data, sent, received
    json["traffic"].push_back({traffic.second, traffic.sent_bytes, traffic.received_bytes});
  if (camera.forgotten > 0) {
    json["forgotten_keyframes"] = camera.forgotten;
    json["kept_keyframes"] = camera.kept;
  }
  if (camera.shared_keyframes > 0)
    json["shared_keyframes"] = {{"kept", camera.shared_keyframes},
                                {"dropped", camera.dropped_shared},
                                {"found_again", camera.found_by_shared},
                                {"loops", camera.loops_on_shared}};
  return json;
}

Json pose_json(const rig::FusedPoseReport& pose) {
  double all_s = 0.0;
  for (const auto& source : pose.sources) all_s += source.led_s;
  Json sources = Json::array();
  for (const auto& source : pose.sources)
    sources.push_back({{"name", source.name},
                       {"poses", source.poses},
                       {"seconds", source.led_s},
                       {"share", all_s > 0.0 ? source.led_s / all_s : 0.0}});
  return {{"sources", sources},
          {"failovers", pose.failovers},
          {"returns", pose.returns},
          {"jumps", pose.jumps},
          {"largest_jump_m", pose.largest_jump_m},
          {"largest_jump_rad", pose.largest_jump_rad},
          {"longest_on_wheels_seconds", pose.longest_on_wheels_s},
          {"longest_gap_seconds", pose.longest_gap_s},
          {"scale", pose.scale ? Json(*pose.scale) : Json()},
          {"metric", pose.is_metric}};
}

// What rounds cost; when their previews were there, the timeline says.
Json rounds_summary_json(const RoundsReport& report, const Work& work) {
  std::uint64_t bytes = 0;
  for (const RoundWork& round : work.rounds)
    for (const RoundWork::Fused& fused : round.fused) bytes += fused.bytes;
  return {{"rounds", work.rounds.size()},
          {"recorded_seconds", report.recorded_s},
          {"bytes_to_cloud", bytes},
          {"cpu_seconds", report.cpu_seconds}};
}

}  // namespace

ExitCode Report::exit_code() const {
  if (interrupted) return ExitCode::interrupted;
  for (const RobotReport& robot : robots)
    if (robot.trouble) return mapweave::exit_code(robot.trouble->code());
  return team.components.size() > 1 ? ExitCode::stayed_apart : ExitCode::done;
}

Json summary_json(const Report& report) {
  Json robots = Json::array(), edges = Json::array(), stages = Json::array();
  for (const RobotReport& robot : report.robots) {
    Json line = {{"id", robot.id.str()},
                 {"scans", robot.scans},
                 {"log_seconds", robot.log_seconds},
                 {"wall_seconds", robot.wall_seconds},
                 {"cpu_seconds", robot.cpu_seconds},
                 {"real_time_factor", robot.real_time_factor()},
                 {"mapped", robot.mapped}};
    for (const CameraReport& camera : robot.cameras) line["cameras"].push_back(camera_json(camera));
    if (!robot.rig.cameras.empty())
      line["rig"] = {{"cameras", robot.rig.cameras},
                     {"extrinsic_constraints", robot.rig.constraints},
                     {"apart_before_m", robot.rig.apart_before_m},
                     {"apart_after_m", robot.rig.apart_after_m},
                     {"optimised", robot.rig.optimised}};
    if (robot.pose) line["pose"] = pose_json(*robot.pose);
    if (!robot.edge.empty()) line["edge"] = robot.edge.str();
    if (robot.is_cut_short) line["cut_short"] = true;
    if (robot.trouble) line["trouble"] = robot.trouble->what();
    robots.push_back(line);
  }
  for (const FusionReport& edge : report.edges) {
    Json line = {{"id", edge.tier.str()}};
    line.update(fusion_json(edge));
    edges.push_back(line);
  }
  for (const StageReport& stage : report.stages)
    stages.push_back({{"tier", stage.tier.str()}, {"name", stage.name}, {"seconds", stage.seconds}});
  Json summary = {{"robots", robots},
                  {"edges", edges},
                  {"team", fusion_json(report.team)},
                  {"notes", report.notes},
                  {"interrupted", report.interrupted},
                  {"exit_code", static_cast<int>(report.exit_code())},
                  {"wall_seconds", report.wall_seconds},
                  {"peak_rss_bytes", report.peak_rss_bytes},
                  {"stages", stages}};
  if (report.coordination) summary["coordinator"] = coordination_json(*report.coordination, report.timeline);
  if (report.rounds) {
    summary["rounds"] = rounds_summary_json(*report.rounds, report.work);
    if (report.coordination) summary["coordinator"]["rounds"] = summary["rounds"];
  }
  for (const PassedOn& edge : passed_on(report))
    summary["sharing"].push_back(
        {{"edge", edge.edge.str()}, {"sent_bytes", edge.sent_bytes}, {"received_bytes", edge.received_bytes}});
  if (report.timeline) summary["timeline"] = timeline_json(*report.timeline, report.work);
  return summary;
}

Json merges_json(const Report& report) {
  Json merges = Json::array();
  for (const FusionReport& edge : report.edges)
    for (const Verdict& verdict : edge.verdicts)
      merges.push_back(verdict_json(edge.tier, verdict, audit_of(edge, verdict)));
  for (const Verdict& verdict : report.team.verdicts)
    merges.push_back(verdict_json(report.team.tier, verdict, audit_of(report.team, verdict)));
  return merges;
}

Json names_json(const std::vector<MapId>& ids) {
  Json names = Json::array();
  for (const MapId& id : ids) names.push_back(id.str());
  return names;
}

Json json_of(const tiers::CoordinatorDecision& decision) {
  Json moves = Json::array(), placement = Json::object();
  for (const auto& move : decision.moves)
    moves.push_back({{"robot", move.robot.str()}, {"from", move.from.str()}, {"to", move.to.str()}});
  for (const auto& [robot, edge] : decision.edge_of) placement[robot.str()] = edge.str();
  Json unknown = Json::array();
  for (const RobotId& robot : decision.unknown) unknown.push_back(robot.str());
  return {{"at_seconds", decision.at_s},
          {"because", decision.because},
          {"new_plan", decision.is_new_plan},
          {"moves", moves},
          {"placement", placement},
          {"expected_seconds", decision.expected_s},
          {"staying_seconds", decision.staying_s},
          {"lower_bound_seconds", decision.lower_bound_s},
          {"cut_weight", decision.cut_weight},
          {"unknown", unknown},
          {"algorithm_seconds", decision.algorithm_s}};
}

}  // namespace mapweave::runtime
