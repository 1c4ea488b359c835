#include <mapweave/runtime/report.h>

#include <mapweave/core/format.h>
#include <mapweave/core/hash.h>
#include <mapweave/maps/alignment.h>
#include <mapweave/maps/reasons.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

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
  for (const PairHypothesis::Place& place : hypothesis.contradictions)
    contradictions.push_back({{"x_m", place.x_m}, {"y_m", place.y_m}, {"length_m", place.length_m}});
  return {{"sense", to_text(hypothesis.sense)},
          {"b_from_a", b_from_a_with_scale(hypothesis.a_from_b)},
          {"probability", 1.0 / (1.0 + std::exp(-hypothesis.log_odds))},
          {"log_odds", hypothesis.log_odds},
          {"prior_log_odds", hypothesis.prior_log_odds},
          {"matches", hypothesis.matches},
          {"coinciding_m", hypothesis.coinciding_m},
          {"distinctive_m", hypothesis.distinctive_m},
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

// Of the two maps, where one came to be.
const fusion::PairAudit* audit_of(const FusionReport& fusion, const Verdict& verdict) {
  const auto audit = std::find_if(fusion.audits.begin(), fusion.audits.end(), [&](const fusion::PairAudit& one) {
    return one.a == verdict.a && one.b == verdict.b;
  });
  return audit == fusion.audits.end() ? nullptr : &*audit;
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

Json names_json(const std::vector<MapId>& ids) {
  Json names = Json::array();
  for (const MapId& id : ids) names.push_back(id.str());
  return names;
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

Json fusion_json(const FusionReport& fusion) {
  Json members = Json::array(), frames = Json::array();
  for (const auto& component : fusion.components) members.push_back(names_json(component));
  for (std::size_t i = 0; i < fusion.frames.size(); ++i)
    frames.push_back(frame_json(fusion.frames[i], fusion.team_from_maps[i]));
  return {{"components", fusion.components.size()},
          {"merged_pairs", pairs(fusion, Decision::accepted)},
          {"refused_pairs", pairs(fusion, Decision::refused)},
          {"deferred_pairs", pairs(fusion, Decision::deferred)},
          {"members", members},
          {"frames", frames}};
}

Json coordination_json(const CoordinationReport& report, const std::optional<Timeline>& timeline) {
  Json decisions = Json::array();
  for (const tiers::CoordinatorDecision& decision : report.decisions) {
    Json moves = Json::array(), placement = Json::object();
    for (const auto& move : decision.moves)
      moves.push_back({{"robot", move.robot.str()}, {"from", move.from.str()}, {"to", move.to.str()}});
    for (const auto& [robot, edge] : decision.edge_of) placement[robot.str()] = edge.str();
    Json unknown = Json::array();
    for (const RobotId& robot : decision.unknown) unknown.push_back(robot.str());
    decisions.push_back({{"at_seconds", decision.at_s},
                         {"because", decision.because},
                         {"new_plan", decision.is_new_plan},
                         {"moves", moves},
                         {"placement", placement},
                         {"expected_seconds", decision.expected_s},
                         {"staying_seconds", decision.staying_s},
                         {"lower_bound_seconds", decision.lower_bound_s},
                         {"cut_weight", decision.cut_weight},
                         {"unknown", unknown},
                         {"algorithm_seconds", decision.algorithm_s}});
  }
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

// What edges send each other of their cameras' maps, while they drive: up to the cloud once, and down to each other one
// that has cameras.
struct PassedOn {
  TierId edge;
  std::uint64_t sent_bytes = 0, received_bytes = 0;
};
std::vector<PassedOn> passed_on(const Report& report) {
  std::map<TierId, std::uint64_t> sent;
  std::uint64_t all = 0;
  for (const RobotReport& robot : report.robots)
    for (const CameraReport& camera : robot.cameras) {
      sent[robot.edge] += camera.passed_on_bytes;
      all += camera.passed_on_bytes;
    }
  std::vector<PassedOn> result;
  if (all > 0)
    for (const auto& [edge, bytes] : sent) result.push_back({edge, bytes, all - bytes});
  return result;
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
  if (camera.forgotten > 0) {
    json["forgotten_keyframes"] = camera.forgotten;
    json["kept_keyframes"] = camera.kept;
  }
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

std::string in_words(const rig::FusedPoseReport& pose) {
  if (pose.failovers == 0) return "";
  std::string text = "  pose (robot.tum):";
  double all_s = 0.0;
  for (const auto& source : pose.sources) all_s += source.led_s;
  for (const auto& source : pose.sources)
    text += format("%s %.0f %% of the time by %s", &source == &pose.sources.front() ? "" : ",",
                   all_s > 0.0 ? 100.0 * source.led_s / all_s : 0.0, source.name.c_str());
  return text + format("; %zu failovers, at most %.1f s on wheels alone\n", pose.failovers, pose.longest_on_wheels_s);
}

std::string in_words(const RobotReport& robot) {
  const std::string pace =
      format(" of %.0f s in %.1f s (%.*f x real time)%s\n", robot.log_seconds, robot.wall_seconds,
             robot.real_time_factor() < 9.5 ? 1 : 0, robot.real_time_factor(), robot.mapped ? "" : "; no map");
  if (robot.cameras.empty())
    return format("robot %s: %llu scans", robot.id.str().c_str(), static_cast<unsigned long long>(robot.scans)) + pace +
           (robot.pose ? in_words(*robot.pose) : "");
  std::string text;
  for (const CameraReport& camera : robot.cameras) {
    text += format("robot %s, camera %s (%s): %llu frames%s", robot.id.str().c_str(), camera.label.c_str(),
                   camera.kind.c_str(), static_cast<unsigned long long>(camera.frames), pace.c_str());
    text += format("  %llu tracked, %llu lost; %llu keyframes, %llu landmarks, %llu loops closed; %.1f ms a frame\n",
                   static_cast<unsigned long long>(camera.tracked), static_cast<unsigned long long>(camera.lost),
                   static_cast<unsigned long long>(camera.keyframes), static_cast<unsigned long long>(camera.landmarks),
                   static_cast<unsigned long long>(camera.loops.size()), camera.tracking_mean_ms);
  }
  if (robot.pose) text += in_words(*robot.pose);
  return text;
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

std::string in_words(const CoordinationReport& report, const std::optional<Timeline>& timeline) {
  std::string text;
  for (const tiers::CoordinatorDecision& decision : report.decisions) {
    if (decision.moves.empty()) continue;
    std::string because;
    for (const std::string& why : decision.because) because += (because.empty() ? "" : ", ") + why;
    text += format("coordinator at %.0f s (%s):", decision.at_s, because.c_str());
    for (const auto& move : decision.moves)
      text += format("%s %s to %s", &move == &decision.moves.front() ? "" : ",", move.robot.str().c_str(),
                     move.to.empty() ? "itself, on board" : move.to.str().c_str());
    if (decision.unknown.size() == decision.edge_of.size())
      text += "; blindly, since no map and no route is known";
    else if (!decision.unknown.empty())
      text += format("; of %zu robots neither map nor route is known", decision.unknown.size());
    text += format("; map expected complete after %.3g s", decision.expected_s);
    if (decision.is_new_plan && decision.at_s > 0.0) text += format(" instead of %.3g s", decision.staying_s);
    text += "\n";
  }
  if (timeline && !report.decisions.empty())
    text += format("coordinator: map expected complete after %.3g s, was complete after %.3g s\n",
                   report.decisions.back().expected_s, timeline->total_s);
  return text;
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

// Where a map that was merged showed something twice.
std::string in_words(const fusion::PairAudit& audit) {
  if (!audit.is_ghost || audit.conflicts.empty()) return "";
  return format(
      "; merged, they would show walls twice: %.0f m, the longest at (%.0f, %.0f) in the map of %s (conflicts.png)",
      audit.contradicted_m, audit.conflicts.front().x_m, audit.conflicts.front().y_m, audit.a.str().c_str());
}

// Of a pair that matched, but of which one map was taken out of its team since it shows walls twice with a third one;
// else empty.
std::string taken_apart_in_words(const FusionReport& fusion, const Verdict& verdict) {
  if (verdict.decision != Decision::refused || verdict.reason != Reason::inconsistent) return "";
  for (const fusion::PairAudit& audit : fusion.audits) {
    if (!audit.is_ghost) continue;
    for (const auto& [one, other] : {std::tie(audit.a, audit.b), std::tie(audit.b, audit.a)})
      if (one == verdict.a || one == verdict.b)
        return verdict.a.str() + " + " + verdict.b.str() + ": kept apart: " + std::string(in_words(verdict.reason)) +
               " (they matched, but " + one.str() + " shows walls twice with " + other.str() + ")";
  }
  return "";
}

std::string in_words(const FusionReport& fusion, const std::string& who) {
  std::string text;
  for (const Verdict& verdict : fusion.verdicts) {
    const fusion::PairAudit* audit = audit_of(fusion, verdict);
    const std::string taken_apart = taken_apart_in_words(fusion, verdict);
    text += who + ": " + (taken_apart.empty() ? in_words(verdict) : taken_apart) +
            (audit != nullptr ? in_words(*audit) : "") + "\n";
    if (verdict.prior)
      text += "note: " + verdict.a.str() + " + " + verdict.b.str() + ": " + in_words(*verdict.prior) + "\n";
  }
  return text;
}

// The frames that somebody who looks at a merged map has to know.
std::string frames_in_words(const FusionReport& team) {
  std::string text;
  for (std::size_t i = 0; i < team.frames.size(); ++i) {
    const bool is_plain = team.components[i].size() == 1 && team.frames[i].kind != FrameRequest::Kind::walls &&
                          team.frames[i].kind != FrameRequest::Kind::given;
    if (is_plain && team.frames.size() > 1) continue;
    text += i == 0 ? "team" : "team-" + std::to_string(i);
    text += ": " + in_words(team.frames[i]) + "\n";
  }
  return text;
}

std::string in_words(const Report& report, const std::string& asked) {
  const std::string& folder = report.saved_at.empty() ? asked : report.saved_at;
  std::string text;
  for (const RobotReport& robot : report.robots) {
    text += in_words(robot);
    if (robot.trouble)
      text += format("robot %s: its stream ended early: %s\n", robot.id.str().c_str(), robot.trouble->what());
  }
  if (report.coordination) text += in_words(*report.coordination, report.timeline);
  if (report.timeline && report.timeline->rounds) text += in_words(*report.timeline->rounds, report.work.rounds.size());
  for (const FusionReport& edge : report.edges) text += in_words(edge, "edge " + edge.tier.str());
  for (const PassedOn& edge : passed_on(report))
    text += format("edge %s: sent the cloud %.2f MB of camera maps for other edges, received %.2f MB of theirs\n",
                   edge.edge.str().c_str(), 1e-6 * static_cast<double>(edge.sent_bytes),
                   1e-6 * static_cast<double>(edge.received_bytes));
  for (const EdgeWork& edge : report.work.edges)
    if (edge.thinning.scans > 0)
      text +=
          format("edge %s: sent %zu of %zu scans to the cloud, which leave out %.1f %% of the walls\n",
                 edge.id.str().c_str(), edge.thinning.kept, edge.thinning.scans, 100.0 * edge.thinning.walls_left_out);
  text += in_words(report.team, report.team.tier.str());
  text += frames_in_words(report.team);
  for (const PushWork& push : report.work.pushes)
    text += format("robot %s received the team's map (%.0f kB); its next run begins with it: --map %s/robots/%s\n",
                   push.robot.str().c_str(), 1e-3 * static_cast<double>(push.bytes), folder.c_str(),
                   push.robot.str().c_str());
  for (const std::string& note : report.notes) text += "note: " + note + "\n";
  if (report.interrupted) text += "interrupted: what was finished is saved\n";
  const std::size_t components = report.team.components.size();
  if (components > 1) {
    text += format("the maps form %zu separate teams:", components);
    for (std::size_t i = 0; i < components; ++i) {
      text += i == 0 ? " " : "; ";
      for (std::size_t j = 0; j < report.team.components[i].size(); ++j)
        text += (j == 0 ? "" : " + ") + report.team.components[i][j].str();
    }
    text += "\n";
  }
  text += format("took %.1f s, at most %.0f MB\nresults: %s\n", report.wall_seconds,
                 static_cast<double>(report.peak_rss_bytes) / 1e6, folder.c_str());
  if (!report.picture.empty()) text += "picture: " + folder + "/" + report.picture + "\n";
  return text;
}

}  // namespace mapweave::runtime
