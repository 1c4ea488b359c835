#pragma once
// Incremental candidate selection: what a merge compares that knows the previous one (FusionInput::teams). Each
// keyframe that is new since is compared once, with the keyframes of all other maps that look most like it. So what a
// merge costs grows with what is new, not with the pairs of maps.

#include "claimed_sightings.h"

#include <map>

namespace mapweave::fusion {

class IncrementalCandidates {
 public:
  // All outlive it but the pool.
  IncrementalCandidates(const std::vector<PreviousMerge>& teams, const std::deque<VisualMap>& maps,
                        const ClaimedSightings& claimed, const VisualFusionOptions& options, WorkerPool& pool);
  // Of two maps by number, a < b; nullopt: nothing is known of before, they are not metric, or they are of two teams of
  // which one is adjusted anew. Then all there is may be asked.
  std::optional<VisualQuestions> questions(std::size_t a, std::size_t b) const;

 private:
  struct KeyframeOfMap {
    std::size_t map, keyframe;
  };
  std::vector<KeyframeOfMap> new_keyframes() const;
  std::vector<KeyframeOfMap> most_alike(const KeyframeOfMap& one, const matching::PlaceIndex& index) const;
  bool is_of_team(std::size_t map, std::size_t other) const {
    return team_of_[map] != nullptr && team_of_[map] == team_of_[other];
  }

  const std::deque<VisualMap>& maps_;
  const ClaimedSightings& claimed_;
  const VisualFusionOptions& options_;
  bool is_any_;
  std::vector<const PreviousMerge*> team_of_;  // each map
  std::map<std::pair<std::size_t, std::size_t>, std::vector<VisualQuestion>> questions_;
};

}  // namespace mapweave::fusion
