#pragma once
// What witnesses say, as constraints between nodes of two maps.

#include "map_pair.h"
#include "visual_witness.h"

namespace mapweave::fusion {

Constraint tie_of(const VisualWitness&, const VisualMap& a, const VisualMap& b);
Constraint tie_of(const Witness&, const PreparedMap& a, const PreparedMap& b);
// To those that the map has.
void add_all(Map&, std::vector<Constraint>);

}  // namespace mapweave::fusion
