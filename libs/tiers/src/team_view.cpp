#include "team_view.h"

namespace mapweave::tiers {
namespace {

matching::LandmarkIndex index_of(const Map& map, const std::vector<const Landmark*>& landmarks,
                                 const TeamView::Making& making, WorkerPool& pool) {
  constexpr std::size_t kAtOnce = 512;
  const std::size_t parts = (landmarks.size() + kAtOnce - 1) / kAtOnce;
  const matching::LandmarkDescriber describer(map, making.description);
  const auto known = pool.map(parts, [&](std::size_t part) {
    std::vector<DescribedLandmark> result;
    for (std::size_t i = part * kAtOnce; i < std::min(landmarks.size(), (part + 1) * kAtOnce); ++i)
      if (auto one = describer.described(*landmarks[i])) result.push_back(std::move(*one));
    return result;
  });
  matching::LandmarkIndex index(making.index);
  for (const auto& part : known)
    for (const DescribedLandmark& one : part)
      if (matching::problem_with(one).empty()) index.set(one);
  return index;
}

std::vector<const Landmark*> all_of(const Map& map) {
  std::vector<const Landmark*> result;
  for (const auto& [id, landmark] : map.landmarks) result.push_back(&landmark);
  return result;
}

}  // namespace

TeamView::TeamView(fusion::FusionResult result, const std::vector<Map>& input, Making making, WorkerPool& pool)
    : result_(std::move(result)), making_(std::move(making)) {
  for (const fusion::Component& component : result_.components) {
    components_.emplace_back(component, making_);
    components_.back().make_forgotten(pool);
    if (component.members.size() > 1) components_.back().make_landmarks(pool);  // shared all the time
    for (const Map& map : input) {
      if (!component.team_from_map.contains(map.id)) continue;
      Member& member = members_[map.id];
      member.component = &components_.back();
      if (const double* scale = component.scales.find(map.id)) member.scale = *scale;
      for (const auto& [id, node] : map.nodes) {
        member.published.set(id, node.map_from_node);
        if (const Node* placed = component.map.nodes.find(id))
          member.nodes.push_back({id, node.map_from_node.t, placed->map_from_node.t});
      }
    }
  }
}

TeamView::Component::Component(const fusion::Component& content, const Making& making)
    : content_(content), making_(making) {}

void TeamView::Component::make_forgotten(WorkerPool& pool) {
  std::vector<const Landmark*> landmarks;
  for (const LandmarkId& id : making_.forgotten)
    if (const Landmark* landmark = content_.map.landmarks.find(id)) landmarks.push_back(landmark);
  if (!landmarks.empty()) forgotten_.emplace(index_of(content_.map, landmarks, making_, pool));
}

void TeamView::Component::make_landmarks(WorkerPool& pool) const {
  std::call_once(has_landmarks_,
                 [&] { landmarks_.emplace(index_of(content_.map, all_of(content_.map), making_, pool)); });
}

const matching::LandmarkIndex& TeamView::Component::landmarks() const {
  std::call_once(has_landmarks_, [&] {
    WorkerPool alone(1);
    landmarks_.emplace(index_of(content_.map, all_of(content_.map), making_, alone));
  });
  return *landmarks_;
}

const std::vector<LandmarkId>& TeamView::Component::landmarks_of(const NodeId& keyframe) const {
  std::call_once(has_anchored_, [&] {
    for (const auto& [id, landmark] : content_.map.landmarks) anchored_[landmark.anchor].push_back(id);
  });
  static const std::vector<LandmarkId> none;
  const auto found = anchored_.find(keyframe);
  return found == anchored_.end() ? none : found->second;
}

const fusion::PlaceFinder& TeamView::Component::places(const matching::ChosenVocabulary& vocabulary,
                                                       WorkerPool& pool) const {
  std::call_once(has_places_, [&] { places_.emplace(content_.map, vocabulary, *making_.pictures, pool); });
  return *places_;
}

const TeamView::Member* TeamView::member(const MapId& map) const {
  const auto found = members_.find(map);
  return found == members_.end() ? nullptr : &found->second;
}

Sim3 team_from_map_at(const NodeId& node, const Pose3& map_from_node, const TeamView::Member& member) {
  const Node& placed = *member.component->content().map.nodes.find(node);
  const Eigen::Vector3d& camera = keyframe_of(placed)->geometry->robot_from_camera.t;
  Sim3 result;
  result.scale = member.scale;
  result.pose.q = (placed.map_from_node.q * map_from_node.q.conjugate()).normalized();
  result.pose.t =
      transformed(camera, placed.map_from_node) - member.scale * (result.pose.q * transformed(camera, map_from_node));
  return result;
}

}  // namespace mapweave::tiers
