// The keyframes of the whole team go down too, with what they hold (CORB-SLAM 2.3, rule 2).

#include "server_state.h"
#include "update_parts.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace mapweave::tiers {
namespace {

constexpr std::size_t kRoomAtFirst = 4;  // keyframes, until the client says how many it keeps
constexpr double kMostBytes = 44e3;      // of one share: a live server's queue may be as short as 64 KB
constexpr double kLandmarkBytes = 75.0, kLightBytes = 90.0, kWholeBytes = 250.0;  // about
constexpr std::uint32_t kLookAgain = 4;  // shares, until what moved is looked for once more
constexpr double kMoved_m = 0.02, kMoved_rad = 0.005, kGrown = 0.01;  // less is not worth a message
constexpr double kLandmarkMoved_m = 0.02;                             // beside its keyframe
constexpr double kHeldShare = 0.7, kHeld_m = 0.5;  // what a client has seems so much nearer than it is
constexpr std::size_t kMostLandmarks = 300;        // of a keyframe

bool has_moved(const SentKeyframe& before, const Pose3& now, double scale) {
  const Pose3 motion = between(before.map_from_camera, now);
  return motion.t.norm() > kMoved_m || 2.0 * motion.q.vec().norm() > kMoved_rad ||
         std::abs(std::log(scale / before.scale)) > kGrown;
}

}  // namespace

std::vector<VisualServer::State::NearKeyframe> VisualServer::State::nearest_of_others(const Client::Part& part,
                                                                                      const Receiver& to) const {
  const std::set<SessionId> not_shared = sessions_not_shared(to.session, to.member);
  const Table<NodeId, Node>& nodes = to.member.component->content().map.nodes;
  std::vector<NearKeyframe> result;
  for (const auto& [map, other] : view->members()) {
    if (other.component != to.member.component) continue;
    for (const TeamView::Member::Placed& one : other.nodes) {
      if (not_shared.count(one.id.session) != 0) continue;
      const Node* node = nodes.find(one.id);
      if (node == nullptr || keyframe_of(*node) == nullptr) continue;
      double apart_m = (one.in_team - to.in_team).norm();
      if (part.keyframes.count(one.id) != 0) apart_m = kHeldShare * apart_m - kHeld_m;
      result.push_back({apart_m, node, other.scale});
    }
  }
  const auto is_nearer = [](const NearKeyframe& a, const NearKeyframe& b) {
    return std::tie(a.apart_m, a.node->id) < std::tie(b.apart_m, b.node->id);
  };
  const std::size_t room = std::min(result.size(), to.room > 0 ? to.room : kRoomAtFirst);
  std::partial_sort(result.begin(), result.begin() + static_cast<std::ptrdiff_t>(room), result.end(), is_nearer);
  result.resize(room);
  return result;
}

std::optional<VisualServer::State::KeyframeInMap> VisualServer::State::in_map_of(const Client::Part& part,
                                                                                 const TeamView::Member& member,
                                                                                 const NearKeyframe& one) {
  const Pose3 team_from_camera = compose(one.node->map_from_node, keyframe_of(*one.node)->geometry->robot_from_camera);
  const Node* beside = nearest(part, member, one.node->map_from_node.t, Frame::team);
  if (beside == nullptr) return std::nullopt;
  const Sim3 map_from_team = inverse(team_from_map_at(beside->id, beside->map_from_node, member));
  return KeyframeInMap{transformed(team_from_camera, map_from_team), one.scale * map_from_team.scale, map_from_team};
}

std::vector<DescribedLandmark> VisualServer::State::new_landmarks_of(const SentKeyframe& sent, const Receiver& to,
                                                                     const NodeId& keyframe,
                                                                     const KeyframeInMap& here) {
  const Pose3 camera_from_map = inverse(here.map_from_camera);
  std::vector<DescribedLandmark> result;
  for (const LandmarkId& id : to.member.component->landmarks_of(keyframe)) {
    if (result.size() >= kMostLandmarks || id.session == to.session) continue;
    const DescribedLandmark* known = to.member.component->landmarks().find(id);
    if (known == nullptr) continue;
    DescribedLandmark landmark = matching::transformed(*known, here.map_from_team);
    if (!matching::problem_with(landmark).empty()) continue;
    const auto before = sent.landmarks.find(id);
    const double moved_m = before == sent.landmarks.end()
                               ? std::numeric_limits<double>::infinity()
                               : (before->second - transformed(landmark.point_in_map, camera_from_map)).norm();
    if (moved_m > std::max(kLandmarkMoved_m, landmark.sigma_m)) result.push_back(std::move(landmark));
  }
  return result;
}

void VisualServer::State::note_sent(SentKeyframe& sent, const SharedKeyframe& shared) const {
  sent.map_from_camera = shared.map_from_camera;
  sent.scale = shared.scale;
  sent.by = views;
  const Pose3 camera_from_map = inverse(shared.map_from_camera);
  for (const DescribedLandmark& landmark : shared.landmarks)
    sent.landmarks[landmark.id] = transformed(landmark.point_in_map, camera_from_map);
}

void VisualServer::State::add_keyframes(Client::Part& part, const Receiver& to, const Budget& budget,
                                        Share& share) const {
  double left = std::min(kMostBytes, budget.bytes);
  if (!(left > 0.0)) return;
  const std::vector<NearKeyframe> wanted = nearest_of_others(part, to);
  std::set<NodeId> kept;
  for (const NearKeyframe& one : wanted) kept.insert(one.node->id);
  for (auto held = part.keyframes.begin(); held != part.keyframes.end();) {
    const bool goes = kept.count(held->first) == 0 && share.dropped.size() < kMostSharedKeyframes;
    if (goes) share.dropped.push_back(held->first);
    held = goes ? part.keyframes.erase(held) : std::next(held);
  }
  part.forget_lacking();
  const auto add = [&](const NodeId& id, SharedKeyframe shared, double bytes) {
    left -= bytes + kLandmarkBytes * static_cast<double>(shared.landmarks.size());
    SentKeyframe& sent = part.keyframes[id];
    note_sent(sent, shared);
    sent.share = part.sent_shares + 1;
    share.keyframes.push_back(std::move(shared));
  };
  const bool looks_again = ++part.keyframe_shares % kLookAgain == 0;
  for (const NearKeyframe& one : wanted) {  // light ones
    const auto held = part.keyframes.find(one.node->id);
    if (held == part.keyframes.end() || !(looks_again || held->second.by != views)) continue;
    if (!(left > 0.0)) break;
    const auto here = in_map_of(part, to.member, one);
    if (!here) continue;
    SharedKeyframe shared{one.node->id, here->map_from_camera, here->scale, std::nullopt, {}};
    if (held->second.by != views) shared.landmarks = new_landmarks_of(held->second, to, one.node->id, *here);
    if (shared.landmarks.empty() && !has_moved(held->second, here->map_from_camera, here->scale))
      held->second.by = views;
    else
      add(one.node->id, std::move(shared), kLightBytes);
  }
  bool owes = false;
  for (const NearKeyframe& one : wanted) {  // the nearest that it lacks
    if (part.keyframes.count(one.node->id) != 0) continue;
    if (owes || share.keyframes.size() >= kMostSharedKeyframes) break;
    const auto here = in_map_of(part, to.member, one);
    if (!here) continue;
    const KeyframeFeatures& features = *keyframe_of(*one.node);
    SharedKeyframe shared{one.node->id, here->map_from_camera, here->scale, features, {}};
    shared.landmarks = new_landmarks_of({}, to, one.node->id, *here);
    const double bytes = kWholeBytes + kFeatureBytes * static_cast<double>(features.points.size()),
                 all = bytes + kLandmarkBytes * static_cast<double>(shared.landmarks.size());
    owes = all > left;
    if (owes && !(left > 0.5 * std::min(all, budget.burst))) break;
    add(one.node->id, std::move(shared), bytes);
  }
}

}  // namespace mapweave::tiers
