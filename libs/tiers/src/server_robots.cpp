#include "owned_update.h"
#include "server_state.h"

#include <mapweave/core/stamped_pose.h>
#include <mapweave/rig/robot_pose.h>

#include <algorithm>

namespace mapweave::tiers {
namespace {

// In times as long as clients let pass between two views.
constexpr double kSilentAfter = 2.0;
constexpr std::int64_t kRemembered = 8;
constexpr std::int64_t kStepsBetween = 5;

constexpr double kFastest_m_per_s = 2.0;  // where a camera says it went faster, its rig cameras are waited for

struct Cameras {
  std::map<SensorId, std::vector<StampedPose>> trajectories;  // in the team, by stamp
  int speaking = 0;
  Stamp first, last;  // of the newest poses of those that are
};

// At a moment up to which all who speak have come. Each reported its poses at times of its own, and a robot turns in
// between: they are compared as if they had spoken together, and often.
std::optional<rig::RobotPoseAnswer> fused(const Cameras& cameras, Stamp end, double period_s) {
  rig::RobotTrajectoryOptions policy;
  policy.longest_gap_s = 0.5 * period_s;
  policy.hand_over_s = kSilentAfter * period_s;
  rig::RobotPose robot(policy);
  const auto step_ns = static_cast<std::int64_t>(1e9 * period_s) / kStepsBetween;
  for (std::int64_t step = kRemembered * kStepsBetween; step >= 0; --step) {
    const Stamp stamp{end.ns - step * step_ns};
    for (const auto& [camera, trajectory] : cameras.trajectories)
      if (const auto pose = pose_at(trajectory, stamp, kSilentAfter * period_s)) robot.add(camera, {stamp, *pose});
  }
  return robot.now();
}

// On from there as a camera moved that is believed there and has come farther.
StampedPose gone_on(const StampedPose& from, const Cameras& cameras, double period_s) {
  const rig::RobotTrajectoryOptions policy;
  StampedPose best = from;
  for (const auto& [camera, trajectory] : cameras.trajectories) {
    const StampedPose& newest = trajectory.back();
    if (newest.stamp <= best.stamp) continue;
    const auto then = pose_at(trajectory, from.stamp, kSilentAfter * period_s);
    if (!then) continue;
    const Pose3 off = between(*then, from.map_from_robot), since = between(*then, newest.map_from_robot);
    if (off.t.norm() > policy.doubt_m || off.q.angularDistance(Eigen::Quaterniond::Identity()) > policy.doubt_rad)
      continue;
    if (since.t.norm() > kFastest_m_per_s * seconds_between(from.stamp, newest.stamp)) continue;
    best = {newest.stamp, compose(from.map_from_robot, since)};
  }
  return best;
}

}  // namespace

std::optional<VisualServer::State::RobotPlace> VisualServer::State::in_team(const TeamView& team, const Client& client,
                                                                            const MapId& client_map,
                                                                            const Pose3& map_from_robot) {
  const auto part = client.parts.find(client_map);
  const TeamView::Member* member = part == client.parts.end() ? nullptr : team.member(part->second.name);
  const Node* near = member == nullptr ? nullptr : nearest(part->second, *member, map_from_robot.t, Frame::map);
  if (near == nullptr) return std::nullopt;
  const Sim3 team_from_map = team_from_map_at(near->id, near->map_from_node, *member);
  return RobotPlace{member->component,
                    carried(team_from_map, map_from_robot, keyframe_of(*near)->geometry->robot_from_camera), near->id};
}

void VisualServer::note(const SessionId& from, const ClientView& view) {
  Client& client = state_->client(from);
  expect_own_map(view.map, from.client, name_of(from));
  client.note(view);
}

std::optional<RobotInTeam> VisualServer::robot(const RobotId& robot) const {
  const State& state = *state_;
  if (!state.view) return std::nullopt;
  const double period_s = 1.0 / state.options.share_rate_hz;
  std::map<SensorId, const Client*> clients;  // the newest runs
  for (const State::Entry* entry : state.rig_cameras({robot, {}})) clients[entry->first.client.sensor] = &entry->second;
  std::map<const TeamView::Component*, Cameras> all;
  std::vector<std::pair<Stamp, Cameras*>> newest;  // of each camera, and where
  for (const auto& [camera, client] : clients) {
    Cameras* where = nullptr;
    for (const ClientView& view : client->seen_at)
      if (const auto place = State::in_team(*state.view, *client, view.map, view.map_from_robot)) {
        where = &all[place->component];
        where->trajectories[camera].push_back({view.stamp, place->team_from_robot});
      }
    if (where != nullptr) newest.emplace_back(where->trajectories[camera].back().stamp, where);
  }
  if (newest.empty()) return std::nullopt;
  std::sort(newest.begin(), newest.end(), [](const auto& a, const auto& b) { return b.first < a.first; });
  for (const auto& [stamp, where] : newest) {
    if (seconds_between(stamp, newest.front().first) > kSilentAfter * period_s) break;
    if (++where->speaking == 1) where->last = stamp;
    where->first = stamp;
  }
  const TeamView::Component* most = nullptr;
  const auto rank = [&](const TeamView::Component* where) {
    return std::make_pair(all[where].speaking, all[where].last);
  };
  for (const TeamView::Component& one : state.view->components())
    if (all[&one].speaking > 0 && (most == nullptr || rank(most) < rank(&one))) most = &one;
  const Cameras& cameras = all[most];
  const auto agreed = fused(cameras, cameras.first, period_s);
  if (!agreed) return std::nullopt;
  const StampedPose now = gone_on(agreed->pose, cameras, period_s);
  return RobotInTeam{now.stamp, now.map_from_robot, most->content().members.front(), agreed->cameras};
}

}  // namespace mapweave::tiers
