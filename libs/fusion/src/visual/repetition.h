#pragma once
// Rooms may be alike to the last picture on the wall, and then witnesses that agree with each other say nothing
// (DECISIONS.md, 38).

#include "visual_pair.h"

namespace mapweave::fusion {

// A few of the witnesses, of different keyframes and the most probable first, are asked whether their places look like
// others in their own maps. Empty where hardly any does.
VisualRepetition repetition_within(const VisualMap& a, const VisualMap& b, std::vector<const VisualWitness*> clique,
                                   const FusionOptions& options, VisualJudge& judge, std::vector<Hash>& judged);

// What the witnesses and their rivals see alike: one map has it in two places.
VisualRepetition repetition_between(const VisualMap& a, const VisualMap& b,
                                    const std::vector<const VisualWitness*>& clique,
                                    const std::vector<const VisualWitness*>& rivals);

// Whether too many witnesses stand where it looks as elsewhere; known: keyframes of each map, from other pairs.
bool rests_on(const std::set<std::size_t>& known_of_a, const std::set<std::size_t>& known_of_b, const VisualMap& a,
              const VisualMap& b, const std::vector<VisualWitness>& witnesses);

}  // namespace mapweave::fusion
