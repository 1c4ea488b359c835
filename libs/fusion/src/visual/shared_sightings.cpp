#include "shared_sightings.h"

#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::size_t kLookedAt = 6;  // keyframes of other maps whose landmarks are looked for in each
constexpr double kSameView_rad = 0.9;
constexpr std::size_t kLeastFound = 12;  // in one keyframe, from all its neighbours

struct ViewingRay {
  Vector3d from, along;  // of a camera, in the team's frame; along: of length 1
};

// Of other members, those that look at the same things, the nearest first.
std::vector<std::size_t> neighbours(const TeamState& team, std::size_t number, const std::vector<ViewingRay>& rays) {
  const TeamKeyframe& here = team.keyframes[number];
  std::vector<std::pair<double, std::size_t>> near;
  for (std::size_t i = 0; i < team.keyframes.size(); ++i) {
    if (team.keyframes[i].member == here.member) continue;
    const double reach = std::min(here.depth_m, team.keyframes[i].depth_m),
                 square = (rays[number].from - rays[i].from).squaredNorm();
    if (!(square < reach * reach)) continue;
    const double turn = std::acos(std::clamp(rays[number].along.dot(rays[i].along), -1.0, 1.0));
    if (turn < kSameView_rad) near.emplace_back(std::sqrt(square) / reach + turn, i);
  }
  std::sort(near.begin(), near.end());
  if (near.size() > kLookedAt) near.resize(kLookedAt);
  std::vector<std::size_t> result;
  for (const auto& entry : near) result.push_back(entry.second);
  return result;
}

}  // namespace

// What the neighbours see of what should be in view. asked_by: of each landmark, the last keyframe that asked for it.
std::vector<SoughtLandmark> SharedSightings::expected(std::size_t number, const std::vector<std::size_t>& neighbours,
                                                      std::vector<std::size_t>& asked_by) const {
  const Pose3 camera_from_team = inverse(team_.keyframes[number].team_from_camera());
  const Pinhole& camera = team_.keyframes[number].content->camera;
  const Eigen::Matrix3d rotation = camera_from_team.q.toRotationMatrix();
  std::vector<SoughtLandmark> sought;
  for (const std::size_t other : neighbours) {
    const TeamKeyframe& from = team_.keyframes[other];
    for (std::size_t f = 0; f < from.content->points.size(); ++f) {
      if (from.content->landmark_of_feature[f] < 0) continue;
      const std::size_t landmark = from.first_landmark + static_cast<std::size_t>(from.content->landmark_of_feature[f]);
      if (asked_by[landmark] == number) continue;
      asked_by[landmark] = number;
      const Vector3d p = rotation * team_.points[landmark] + camera_from_team.t;
      if (!(p.z() > kNearest_m)) continue;
      const Vector2d pixel = camera.project(p);
      if (camera.shows(pixel)) sought.push_back({landmark, pixel, p.z(), &from.content->content->descriptors[f]});
    }
  }
  return sought;
}

void SharedSightings::find(double radius_px, const std::vector<std::size_t>& by) {
  found_.clear();
  std::vector<ViewingRay> rays;
  for (const TeamKeyframe& keyframe : team_.keyframes) {
    const Pose3 camera = keyframe.team_from_camera();
    rays.push_back({camera.t, camera.q * Vector3d::UnitZ()});
  }
  if (features_.empty())
    for (const TeamKeyframe& keyframe : team_.keyframes)
      features_.emplace_back(*keyframe.content, team_.scale_of(keyframe.member));
  constexpr auto kNobody = static_cast<std::size_t>(-1);
  std::vector<std::size_t> asked_by(team_.landmark_ids.size(), kNobody);
  for (std::size_t number = 0; number < team_.keyframes.size(); ++number) {
    if (!by.empty() && !std::binary_search(by.begin(), by.end(), team_.keyframes[number].member)) continue;
    const auto shown = features_[number].find(expected(number, neighbours(team_, number, rays), asked_by), radius_px);
    if (shown.size() < kLeastFound) continue;
    for (const auto& [feature, landmark] : shown) found_.push_back({number, feature, landmark});
  }
}

}  // namespace mapweave::fusion
