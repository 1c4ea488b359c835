#pragma once
// What a joining asks that knows the one before it (FusionInput::teams): each keyframe that is new since, once, with the keyframes of all
// other maps that look most like it. So what a joining costs grows with what is new, not with the pairs of maps.

#include "hearsay.h"

#include <map>

namespace mapweave::fusion {

class Growth {
 public:
  // All outlive it but the pool.
  Growth(const std::vector<StandingTeam>& teams, const std::deque<VisualMap>& maps, const Hearsay& hearsay,
         const VisualFusionOptions& options, WorkerPool& pool);
  // Of two maps by number, a < b; nullopt: nothing is known of before, they do not know their lengths, or they are of two teams of which
  // one is adjusted anew. Then all there is may be asked.
  std::optional<VisualQuestions> questions(std::size_t a, std::size_t b) const;

 private:
  struct Picture {
    std::size_t map, keyframe;
  };
  std::vector<Picture> fresh() const;
  std::vector<Picture> most_alike(const Picture& one, const matching::PlaceIndex& index) const;
  bool is_of_team(std::size_t map, std::size_t other) const { return team_of_[map] != nullptr && team_of_[map] == team_of_[other]; }

  const std::deque<VisualMap>& maps_;
  const Hearsay& hearsay_;
  const VisualFusionOptions& options_;
  bool is_any_;
  std::vector<const StandingTeam*> team_of_;  // each map
  std::map<std::pair<std::size_t, std::size_t>, std::vector<VisualQuestion>> questions_;
};

}  // namespace mapweave::fusion
