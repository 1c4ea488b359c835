#include "loop_closer.h"

#include <mapweave/graph/spatial_graph.h>

#include <algorithm>
#include <map>

namespace mapweave::visual {
namespace {

constexpr int kSharedInGraph = 60;      // landmarks that tie two keyframes in the essential graph
constexpr std::size_t kCompanions = 4;  // keyframes that speak with the one that looks alike

std::map<int, int> covisible(const LandmarkMap& map, int number) {
  std::map<int, int> shared;
  for (int id : map.keyframe(number).landmarks)
    for (const Observation& o : map.landmark(id).seen) ++shared[o.keyframe];
  shared.erase(number);
  return shared;
}

std::vector<int> with_companions(const LandmarkMap& map, int number, std::size_t most) {
  std::vector<std::pair<int, int>> order;
  for (const auto& [other, count] : covisible(map, number)) order.emplace_back(-count, other);
  std::sort(order.begin(), order.end());
  std::vector<int> result{number};
  for (const auto& [count, other] : order)
    if (result.size() <= most) result.push_back(other);
  return result;
}

}  // namespace

std::optional<FoundLoop> find_loop(LandmarkMap& map, LandmarkFinder& finder, const std::vector<matching::SimilarPlace>& alike,
                                   const Pyramid& picture, const ClientOptions& options) {
  const int newest = static_cast<int>(map.keyframes.size()) - 1;
  const matching::OrbFeatures& features = map.keyframe(newest).features;
  const auto near = covisible(map, newest);
  for (const matching::SimilarPlace& place : alike) {
    const int earlier = static_cast<int>(place.id.index);
    if (near.count(earlier) > 0) continue;
    std::vector<int> among;
    for (int number : with_companions(map, earlier, kCompanions))
      if (near.count(number) == 0 && number != newest) among.push_back(number);
    const auto view = find_place(map, among, features);
    if (!view) continue;
    const std::vector<Match> found = finder.find(map, among, picture, *view, Motion(), options.tracking);
    std::vector<Sighting> sightings;
    for (const Match& match : found) sightings.push_back(map.sighting_of(match, options.tracking.sigma_px));
    const PoseFromPoints pose = pose_from_points(sightings, map.camera, *view, map.flaws, options.tracking.gate_sigmas);
    if (pose.count < options.tracking.least_landmarks || 2 * pose.count < static_cast<int>(found.size())) continue;
    FoundLoop loop;
    loop.earlier = earlier, loop.view = pose.view;
    for (std::size_t i = 0; i < found.size(); ++i)
      if (pose.fits[i]) loop.matches.push_back(found[i]);
    return loop;
  }
  return std::nullopt;
}

void close_loop(LandmarkMap& map, const FoundLoop& loop) {
  const auto newest = static_cast<std::uint32_t>(map.keyframes.size() - 1);
  std::vector<Pose3> poses;
  for (const Keyframe& keyframe : map.keyframes) poses.push_back(pose_of(keyframe.view));
  std::vector<graph::SpatialEdge> edges;
  const auto tie = [&](std::uint32_t from, std::uint32_t to, const Pose3& from_from_to, double landmarks) {
    graph::SpatialEdge edge{from, to, from_from_to, landmarks * Eigen::Matrix<double, 6, 6>::Identity()};
    edges.push_back(edge);
  };
  for (std::uint32_t number = 1; number < poses.size(); ++number) {
    bool to_the_last = false;
    for (const auto& [other, count] : covisible(map, static_cast<int>(number))) {
      const auto from = static_cast<std::uint32_t>(other);
      if (from > number || (count < kSharedInGraph && from + 1 != number)) continue;
      tie(from, number, between(poses[from], poses[number]), count);
      to_the_last = to_the_last || from + 1 == number;
    }
    if (!to_the_last) tie(number - 1, number, between(poses[number - 1], poses[number]), 10.0);
  }
  const Pose3 map_from_newest = pose_of(loop.view);
  tie(static_cast<std::uint32_t>(loop.earlier), newest, between(poses[static_cast<std::size_t>(loop.earlier)], map_from_newest),
      10.0 * static_cast<double>(loop.matches.size()));
  const graph::SpatialSolution solution = graph::solve(poses, edges);

  std::vector<View> before;
  for (Keyframe& keyframe : map.keyframes) before.push_back(keyframe.view);
  for (std::size_t i = 0; i < before.size(); ++i) map.keyframes[i].view = view_of(solution.poses[i]);
  for (Landmark& landmark : map.landmarks) {
    if (landmark.gone || landmark.seen.empty()) continue;
    const auto anchor = static_cast<std::size_t>(landmark.seen.front().keyframe);
    landmark.point = map.keyframes[anchor].view.inverse() * (before[anchor] * landmark.point);
  }
}

}  // namespace mapweave::visual
