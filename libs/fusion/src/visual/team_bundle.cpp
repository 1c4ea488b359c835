#include "team_bundle.h"
#include "shared_landmarks.h"
#include "team_shape.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace mapweave::fusion {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Between keyframes in a row, of what their client found. Clients know systematic errors of their sensors that a bundle
// of all does not, so there the shapes that they found hardly bend.
constexpr double kStiff = 0.1;
// There a client's systematic error shows against the laser, and the shapes may bend as far as the graph lets them.
constexpr double kStiff_beside_lasers = 1.0;
constexpr double kLeastGain = 3e-3,
                 kRoughGain = 2e-2;   // of an iteration of the bundle of all, in the last round and before
constexpr std::size_t kOfOneMap = 3;  // sightings of a landmark while maps are laid on each other
constexpr auto kAll = static_cast<std::size_t>(-1);

// Of the cameras instead of the nodes.
graph::RelativePoseConstraint of_cameras(const TeamState& team, graph::RelativePoseConstraint constraint) {
  const auto robot_from_camera = [&](std::uint32_t keyframe) {
    return team.keyframes[keyframe].content->content->geometry->robot_from_camera;
  };
  constraint.from_from_to = compose(compose(inverse(robot_from_camera(constraint.from)), constraint.from_from_to),
                                    robot_from_camera(constraint.to));
  return constraint;
}

}  // namespace

TeamBundle::TeamBundle(TeamState& team, const std::vector<ClaimedSighting>& claimed, const VisualFusionOptions& options)
    : team_(team),
      claimed_(claimed),
      options_(options),
      shape_(shape_constraints(team, team.held.empty() ? kStiff : kStiff_beside_lasers)) {}

// Of what was claimed, the new: by keyframes whose features were found to see the same, and where it is expected.
std::vector<TeamBundle::BorneOut> TeamBundle::borne_out(const graph::Bundle& bundle,
                                                        const std::vector<SharedSighting>& found,
                                                        const DisjointSets& same, double radius_px) const {
  std::vector<BorneOut> result;
  if (claimed_.empty()) return result;
  std::set<std::size_t> known;
  for (const SharedSighting& one : found) known.insert(one.keyframe);
  std::set<std::pair<std::size_t, std::size_t>> seen;
  for (const graph::BundleSighting& sighting : bundle.sightings)
    if (known.count(sighting.view) != 0) seen.emplace(sighting.view, sighting.point);
  for (const ClaimedSighting& claim : claimed_) {
    const std::size_t keyframe = team_.first_keyframe[claim.map] + claim.keyframe;
    const std::size_t landmark =
        team_.keyframes[team_.first_keyframe[claim.map_of_landmark]].first_landmark + claim.landmark;
    if (known.count(keyframe) == 0) continue;
    const TeamKeyframe& here = team_.keyframes[keyframe];
    const Vector3d p = transformed(team_.points[landmark], inverse(here.team_from_camera()));
    if (!(p.z() > kNearest_m)) continue;
    if (!((here.content->camera.project(p) - Vector2d(pixels_of(claim.seen.u), pixels_of(claim.seen.v))).norm() <
          radius_px))
      continue;
    const double depth_m = team_.scale_of(here.member) * depth_m_of(claim.seen.inverse_depth);
    if (depth_m > 0.0 && std::abs(depth_m - p.z()) > kSameDepth * p.z()) continue;
    if (seen.emplace(keyframe, same.find(landmark)).second) result.emplace_back(keyframe, landmark, &claim.seen);
  }
  return result;
}

// most: of each landmark, spread over those that there are.
template <class Visit>
void TeamBundle::for_own_sightings(std::size_t most, const Visit& visit) const {
  std::size_t number = 0;
  std::vector<std::pair<std::size_t, const LandmarkSighting*>> own;
  for (std::size_t m = 0; m < team_.members.size(); ++m)
    for (const auto& [id, landmark] : team_.members[m]->map().landmarks) {
      own.clear();
      for (const LandmarkSighting& seen : landmark.seen)
        if (const std::size_t keyframe = team_.members[m]->number_of(seen.node);
            keyframe < team_.members[m]->keyframes().size())
          own.emplace_back(team_.first_keyframe[m] + keyframe, &seen);
      const std::size_t count = own.size(), chosen = std::min(most, count);
      for (std::size_t i = 0; i < count; ++i)
        if (i * chosen / count != (i + 1) * chosen / count) visit(own[i].first, number, *own[i].second);
      ++number;
    }
}

graph::Bundle TeamBundle::empty_bundle() const {
  graph::Bundle bundle;
  const bool is_loose =
      team_.held.empty() && std::find(team_.is_free.begin(), team_.is_free.end(), false) == team_.is_free.end();
  for (std::size_t i = 0; i < team_.keyframes.size(); ++i) {
    bundle.cameras.push_back(team_.keyframes[i].content->camera);
    bundle.views.push_back({view_of(team_.keyframes[i].team_from_camera()), static_cast<std::uint32_t>(i),
                            (i == 0 && is_loose) || !team_.is_free[i]});
  }
  bundle.points = team_.points;
  for (const graph::RelativePoseConstraint& constraint : shape_)
    if (team_.is_free[constraint.from] || team_.is_free[constraint.to])
      bundle.relative_poses.push_back(of_cameras(team_, constraint));
  for (const HeldKeyframe& held : team_.held) {
    const auto keyframe = static_cast<std::uint32_t>(held.keyframe),
               hold = static_cast<std::uint32_t>(bundle.views.size());
    bundle.views.push_back({view_of(held.team_from_camera), keyframe, true});
    bundle.relative_poses.push_back({hold, keyframe, Pose3(), held.sigma_m, held.sigma_rad});
  }
  return bundle;
}

// Of one of the points, which the caller fills in.
graph::BundleSighting TeamBundle::sighting(std::size_t keyframe, const Vector2d& pixel, double sigma_px,
                                           std::uint16_t inverse_depth) const {
  graph::BundleSighting result;
  result.view = static_cast<std::uint32_t>(keyframe);
  result.pixel = pixel;
  result.sigma_px = sigma_px;
  if (inverse_depth != 0) {
    result.inverse_depth = 1.0 / (team_.scale_of(team_.keyframes[keyframe].member) * depth_m_of(inverse_depth));
    const CameraGeometry& camera = *team_.keyframes[keyframe].content->content->geometry;
    result.inverse_depth_sigma =
        camera.baseline_m > 0.0 ? sigma_px / (camera.fx * camera.baseline_m) : options_.inverse_depth_sigma;
  }
  return result;
}

void TeamBundle::adjust(const std::vector<SharedSighting>& found, double radius_px, BundleExtent extent) {
  const DisjointSets same = team_.classes(found);
  std::vector<char> counts(team_.landmark_ids.size(), extent == BundleExtent::all);
  for (const SharedSighting& one : found)
    if (extent != BundleExtent::free || team_.is_free[one.keyframe]) counts[same.find(one.landmark)] = 1;
  graph::Bundle bundle = empty_bundle();
  const auto see = [&](std::size_t keyframe, std::size_t landmark, const Vector2d& pixel, double sigma_px,
                       std::uint16_t inverse_depth) {
    const std::size_t point = same.find(landmark);
    if (counts[point] == 0) return;
    bundle.sightings.push_back(sighting(keyframe, pixel, sigma_px, inverse_depth));
    bundle.sightings.back().point = static_cast<std::uint32_t>(point);
  };
  if (extent == BundleExtent::free)
    for_own_sightings(kAll, [&](std::size_t keyframe, std::size_t landmark, const LandmarkSighting&) {
      if (team_.is_free[keyframe]) counts[same.find(landmark)] = 1;
    });
  for_own_sightings(extent == BundleExtent::shared ? kOfOneMap : kAll,
                    [&](std::size_t keyframe, std::size_t landmark, const LandmarkSighting& seen) {
                      see(keyframe, landmark, {pixels_of(seen.u), pixels_of(seen.v)},
                          options_.sigma_px * (1 << seen.level), seen.inverse_depth);
                    });
  for (const SharedSighting& one : found) {
    const MappedKeyframe& content = *team_.keyframes[one.keyframe].content;
    if (content.landmark_of_feature[one.feature] >= 0) continue;  // the same one, or a mistake
    const matching::FeaturePoint& point = content.points[one.feature];
    see(one.keyframe, one.landmark, {point.u_px, point.v_px},
        2.0 * options_.sigma_px * std::pow(content.content->geometry->level_scale, point.level), 0);
  }
  for (const auto& [keyframe, landmark, seen] : borne_out(bundle, found, same, radius_px))
    see(keyframe, landmark, {pixels_of(seen->u), pixels_of(seen->v)}, 2.0 * options_.sigma_px * (1 << seen->level), 0);
  std::stable_sort(bundle.sightings.begin(), bundle.sightings.end(),
                   [](const auto& a, const auto& b) { return a.point < b.point; });
  graph::BundleOptions adjusting;
  adjusting.least_gain = extent == BundleExtent::shared ? kRoughGain : kLeastGain;
  graph::adjust(bundle, adjusting);
  for (std::size_t i = 0; i < team_.keyframes.size(); ++i) {
    TeamKeyframe& keyframe = team_.keyframes[i];
    const graph::BundleView& moved = bundle.views[i];
    keyframe.team_from_node = compose(moved.fixed ? keyframe.team_from_camera() : pose_of(moved.view),
                                      inverse(keyframe.content->content->geometry->robot_from_camera));
  }
  team_.place_landmarks();
  if (extent == BundleExtent::shared) return;
  for (std::size_t i = 0; i < team_.points.size(); ++i)
    if (counts[same.find(i)] != 0 || extent == BundleExtent::all) team_.points[i] = bundle.points[same.find(i)];
}

}  // namespace mapweave::fusion
