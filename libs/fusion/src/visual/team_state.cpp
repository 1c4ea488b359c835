#include "team_state.h"
#include "shared_landmarks.h"

#include <mapweave/core/median.h>
#include <mapweave/rig/scale.h>

#include <algorithm>

namespace mapweave::fusion {
namespace {

using Eigen::Vector3d;

// The constraints between its cameras.
std::vector<const Constraint*> rig_of(const VisualMap& member) {
  std::vector<const Constraint*> result;
  const auto is_keyframe = [&](const NodeId& id) { return member.number_of(id) < member.keyframes().size(); };
  for (const auto& [id, constraint] : member.map().constraints)
    if (id.kind == ConstraintKind::extrinsic && is_keyframe(id.from) && is_keyframe(id.to) &&
        constraint.information(0, 0) > 0.0 && constraint.information(5, 5) > 0.0)
      result.push_back(&constraint);
  return result;
}

double middle_depth(const TeamState& team, const TeamKeyframe& keyframe) {
  std::vector<double> depths;
  const Pose3 camera_from_map = inverse(keyframe.content->map_from_camera);
  for (const std::int32_t landmark : keyframe.content->landmark_of_feature)
    if (landmark >= 0)
      depths.push_back(
          transformed(team.members[keyframe.member]->landmarks()[static_cast<std::size_t>(landmark)].point_in_map,
                      camera_from_map)
              .z());
  if (depths.empty()) return 1.0;
  return team.scale_of(keyframe.member) * std::max(0.1, median(std::move(depths)));
}

}  // namespace

TeamState::TeamState(const std::vector<const VisualMap*>& its_members, const std::vector<VisualJoin>& its_joins,
                     const std::vector<Sim3>& where)
    : members(its_members), joins(its_joins), team_from_map(where) {
  for (std::size_t m = 0; m < members.size(); ++m) {
    first_keyframe.push_back(keyframes.size());
    const std::size_t first_landmark = landmark_ids.size();
    for (const VisualMapLandmark& landmark : members[m]->landmarks()) {
      landmark_ids.push_back(landmark.id);
      landmark_member.push_back(m);
      landmark_keyframe.push_back(members[m]->number_of(members[m]->map().landmarks.find(landmark.id)->anchor) +
                                  first_keyframe[m]);
    }
    const Pose3 robot_from_camera = rig::extrinsics_of(members[m]->map());
    for (const MappedKeyframe& keyframe : members[m]->keyframes())
      keyframes.push_back({m, &keyframe, first_landmark, 1.0,
                           rig::moved_with_camera(team_from_map[m], keyframe.map_from_node, robot_from_camera)});
  }
  is_free.assign(keyframes.size(), true);
  for (TeamKeyframe& keyframe : keyframes) keyframe.depth_m = middle_depth(*this, keyframe);
  for (const VisualMap* member : members) rigs.push_back(rig_of(*member));
}

bool TeamState::are_of_one_rig(std::size_t a, std::size_t b) const {
  const SessionId &one = keyframes[a].content->id.session, &other = keyframes[b].content->id.session;
  const auto& rig = rigs[keyframes[a].member];
  return one != other && std::any_of(rig.begin(), rig.end(), [&](const Constraint* rigid) {
           return (rigid->id.from.session == one && rigid->id.to.session == other) ||
                  (rigid->id.from.session == other && rigid->id.to.session == one);
         });
}

void TeamState::place_landmarks() {
  points.clear();
  for (std::size_t i = 0; i < landmark_ids.size(); ++i) {
    const std::size_t member = landmark_member[i];
    const TeamKeyframe& anchor = keyframes[landmark_keyframe[i]];
    const Vector3d point = rig::rescaled(members[member]->map().landmarks.find(landmark_ids[i])->point_in_anchor(),
                                         anchor.content->content->geometry->robot_from_camera, scale_of(member));
    points.push_back(transformed(point, anchor.team_from_node));
  }
}

DisjointSets TeamState::classes(const std::vector<SharedSighting>& found) const {
  DisjointSets result(landmark_ids.size());
  for (const SharedSighting& one : found) {
    const TeamKeyframe& keyframe = keyframes[one.keyframe];
    const std::int32_t own = keyframe.content->landmark_of_feature[one.feature];
    if (own < 0) continue;
    const std::size_t here = keyframe.first_landmark + static_cast<std::size_t>(own);
    const double depth_m = transformed(points[here], inverse(keyframe.team_from_camera())).z();
    if ((points[here] - points[one.landmark]).norm() < kSameDepth * std::max(depth_m, kNearest_m))
      result.join(here, one.landmark);
  }
  return result;
}

}  // namespace mapweave::fusion
