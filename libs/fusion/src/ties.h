#pragma once
// What witnesses say, as constraints between nodes of two maps.

#include "map_pair.h"
#include "visual_witness.h"

namespace mapweave::fusion {

// scale_a, scale_b: by which the maps are rescaled to metres.
Constraint tie_of(const VisualWitness&, const VisualMap& a, const VisualMap& b, double scale_a, double scale_b);
Constraint tie_of(const Witness&, const PreparedMap& a, const PreparedMap& b);
// To those that the map has.
void add_all(Map&, std::vector<Constraint>);

}  // namespace mapweave::fusion
