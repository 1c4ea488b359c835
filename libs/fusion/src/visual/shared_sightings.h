#pragma once
// Which keyframes of a team show landmarks of other members.

#include "shared_landmarks.h"
#include "team_state.h"

namespace mapweave::fusion {

class SharedSightings {
 public:
  explicit SharedSightings(const TeamState& team) : team_(team) {}  // which outlives it

  // Where the team lies now; forgets what was found before. by: members whose keyframes look; empty: all.
  void find(double radius_px, const std::vector<std::size_t>& by = {});
  const std::vector<SharedSighting>& found() const { return found_; }

 private:
  std::vector<SoughtLandmark> expected(std::size_t number, const std::vector<std::size_t>& neighbours,
                                       std::vector<std::size_t>& asked_by) const;

  const TeamState& team_;
  std::vector<FeaturesByPlace> features_;  // of each keyframe, once they were looked for
  std::vector<SharedSighting> found_;
};

}  // namespace mapweave::fusion
