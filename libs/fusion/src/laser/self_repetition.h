#pragma once
// Whether what two sides share stands more than once in one of them, as the rooms of a hotel do: then they may as well lie elsewhere.

#include "wall_agreement.h"

namespace mapweave::fusion {

// A part of one side that the other one knows, laid elsewhere on that other one.
struct Repetition {
  double shared_m = 0.0;    // walls of the part that coincide where it lies
  double repeated_m = 0.0;  // the same elsewhere, where hardly any wall is contradicted; 0: nowhere
};

// Of either side's part, the one that repeats more. Parts of more than 300 m of wall are taken to stand only once. Symmetric in its arguments.
Repetition self_repetition(const std::vector<PlacedSubmap>& a, const std::vector<PlacedSubmap>& b, const SightOf& sight_of);

// So much that it decides: at least a third of the part, and as much as the walls of a room.
bool repeats(const Repetition& repetition);

}  // namespace mapweave::fusion
