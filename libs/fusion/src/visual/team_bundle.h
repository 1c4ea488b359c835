#pragma once
// The bundle of all keyframes and landmarks of a team.

#include "team_state.h"

#include <tuple>

namespace mapweave::fusion {

// shared: with landmarks that two maps see alone, few sightings each, which lays the maps on each other within their
// shapes; the others stay at their keyframes. free: with those that free keyframes see.
enum class BundleExtent { shared, free, all };

class TeamBundle {
 public:
  // All outlive it. The shapes are those that the members have now.
  TeamBundle(TeamState& team, const std::vector<ClaimedSighting>& claimed, const VisualFusionOptions& options);

  // found: landmarks of other members. radius_px: how far claimed sightings may be off.
  void adjust(const std::vector<SharedSighting>& found, double radius_px, BundleExtent extent);

 private:
  using BorneOut = std::tuple<std::size_t, std::size_t, const LandmarkSighting*>;  // keyframe, landmark, as claimed
  std::vector<BorneOut> borne_out(const graph::Bundle& bundle, const std::vector<SharedSighting>& found,
                                  const DisjointSets& same, double radius_px) const;
  graph::Bundle empty_bundle() const;
  graph::BundleSighting sighting(std::size_t keyframe, const Eigen::Vector2d& pixel, double sigma_px,
                                 std::uint16_t inverse_depth) const;
  template <class Visit>
  void for_own_sightings(std::size_t most, const Visit& visit) const;

  TeamState& team_;
  const std::vector<ClaimedSighting>& claimed_;
  const VisualFusionOptions& options_;
  std::vector<graph::RelativePoseConstraint> shape_;  // of nodes
};

}  // namespace mapweave::fusion
