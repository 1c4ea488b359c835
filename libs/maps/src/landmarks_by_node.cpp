#include <mapweave/maps/landmarks_by_node.h>

#include <algorithm>

namespace mapweave {

void LandmarksByNode::add(const NodeId& node, const LandmarkId& landmark) {
  Indices& indices = landmarks_[node][landmark.session];
  const auto place = std::lower_bound(indices.begin(), indices.end(), landmark.index);
  if (place == indices.end() || *place != landmark.index) indices.insert(place, landmark.index);
}

void LandmarksByNode::remove(const NodeId& node, const LandmarkId& landmark) {
  const auto sessions = landmarks_.find(node);
  if (sessions == landmarks_.end()) return;
  const auto known = sessions->second.find(landmark.session);
  if (known == sessions->second.end()) return;
  Indices& indices = known->second;
  const auto place = std::lower_bound(indices.begin(), indices.end(), landmark.index);
  if (place != indices.end() && *place == landmark.index) indices.erase(place);
  if (indices.empty()) sessions->second.erase(known);
  if (sessions->second.empty()) landmarks_.erase(sessions);
}

std::vector<LandmarkId> LandmarksByNode::at(const NodeId& node) const {
  std::vector<LandmarkId> result;
  if (const auto sessions = landmarks_.find(node); sessions != landmarks_.end())
    for (const auto& [session, indices] : sessions->second)
      for (const std::uint32_t index : indices) result.push_back({session, index});
  return result;
}

}  // namespace mapweave
