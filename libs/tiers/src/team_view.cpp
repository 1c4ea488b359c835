#include "team_view.h"

namespace mapweave::tiers {
namespace {

matching::LandmarkIndex index_of(const Map& map, const matching::LandmarkIndexOptions& options,
                                 const matching::DescriptionOptions& description, WorkerPool& pool) {
  constexpr std::size_t kAtOnce = 512;
  const auto& landmarks = map.landmarks;
  const std::size_t parts = (landmarks.size() + kAtOnce - 1) / kAtOnce;
  const auto known = pool.map(parts, [&](std::size_t part) {
    std::vector<DescribedLandmark> result;
    const auto first = landmarks.begin() + static_cast<std::ptrdiff_t>(part * kAtOnce);
    const auto last = landmarks.begin() + static_cast<std::ptrdiff_t>(std::min(landmarks.size(), (part + 1) * kAtOnce));
    for (auto entry = first; entry != last; ++entry)
      if (auto one = matching::described(map, entry->second, description)) result.push_back(std::move(*one));
    return result;
  });
  matching::LandmarkIndex index(options);
  for (const auto& part : known)
    for (const DescribedLandmark& one : part)
      if (matching::flaw(one).empty()) index.set(one);
  return index;
}

}  // namespace

TeamView::TeamView(fusion::FusionResult result, const std::vector<Map>& input, const matching::LandmarkIndexOptions& index,
                   const matching::DescriptionOptions& description, fusion::Pictures& pictures, WorkerPool& pool)
    : result_(std::move(result)) {
  for (const fusion::Component& component : result_.components) {
    components_.push_back(
        {&component, index_of(component.map, index, description, pool), fusion::PlaceFinder(component.map, pool, pictures)});
    for (const Map& map : input) {
      if (!component.team_from_map.contains(map.id)) continue;
      Member& member = members_[map.id];
      member.component = &components_.back();
      if (const double* scale = component.scales.find(map.id)) member.scale = *scale;
      for (const auto& [id, node] : map.nodes) {
        member.told.set(id, node.map_from_node);
        if (const Node* placed = component.map.nodes.find(id)) member.nodes.push_back({id, node.map_from_node.t, placed->map_from_node.t});
      }
    }
  }
}

const TeamView::Member* TeamView::member(const MapId& map) const {
  const auto found = members_.find(map);
  return found == members_.end() ? nullptr : &found->second;
}

Sim3 team_from_map_at(const NodeId& node, const Pose3& map_from_node, const TeamView::Member& member) {
  const Node& placed = *member.component->content->map.nodes.find(node);
  const Eigen::Vector3d& camera = keyframe_of(placed)->geometry->robot_from_camera.t;
  Sim3 result;
  result.scale = member.scale;
  result.pose.q = (placed.map_from_node.q * map_from_node.q.conjugate()).normalized();
  result.pose.t = transformed(camera, placed.map_from_node) - member.scale * (result.pose.q * transformed(camera, map_from_node));
  return result;
}

}  // namespace mapweave::tiers
