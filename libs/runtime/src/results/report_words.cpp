#include "report_parts.h"

#include <mapweave/core/format.h>
#include <mapweave/maps/reasons.h>

#include <algorithm>
#include <map>
#include <tuple>

namespace mapweave::runtime {

const fusion::PairAudit* audit_of(const FusionReport& fusion, const Verdict& verdict) {
  const auto audit = std::find_if(fusion.audits.begin(), fusion.audits.end(), [&](const fusion::PairAudit& one) {
    return one.a == verdict.a && one.b == verdict.b;
  });
  return audit == fusion.audits.end() ? nullptr : &*audit;
}

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

namespace {

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

std::string in_words(const CoordinationReport& report, const std::optional<Timeline>& timeline) {
  std::string text;
  for (const tiers::CoordinatorDecision& decision : report.decisions)
    if (!decision.moves.empty())
      text += format("coordinator at %.0f s ", decision.at_s) + runtime::in_words(decision) + "\n";
  if (timeline && !report.decisions.empty())
    text += format("coordinator: map expected complete after %.3g s, was complete after %.3g s\n",
                   report.decisions.back().expected_s, timeline->total_s);
  return text;
}

}  // namespace

std::string in_words(const tiers::CoordinatorDecision& decision, const char* nowhere) {
  std::string text, because;
  for (const std::string& why : decision.because) because += (because.empty() ? "" : ", ") + why;
  text += "(" + because + "):";
  for (const auto& move : decision.moves)
    text += format("%s %s to %s", &move == &decision.moves.front() ? "" : ",", move.robot.str().c_str(),
                   move.to.empty() ? nowhere : move.to.str().c_str());
  if (decision.unknown.size() == decision.edge_of.size())
    text += "; blindly, since no map and no route is known";
  else if (!decision.unknown.empty())
    text += format("; of %zu robots neither map nor route is known", decision.unknown.size());
  text += format("; map expected complete after %.3g s", decision.expected_s);
  if (decision.is_new_plan && decision.at_s > 0.0) text += format(" instead of %.3g s", decision.staying_s);
  return text;
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
