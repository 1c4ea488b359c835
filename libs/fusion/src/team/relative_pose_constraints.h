#pragma once
// Relative-pose constraints between nodes of two maps, from witnesses.

#include "decision/prepared_map.h"
#include "visual/visual_witness.h"

namespace mapweave::fusion {

// scale_a, scale_b: by which the maps are rescaled to metres.
Constraint constraint_of(const VisualWitness&, const VisualMap& a, const VisualMap& b, double scale_a, double scale_b);
Constraint constraint_of(const Witness&, const PreparedMap& a, const PreparedMap& b);
// To those that the map has.
void add_constraints(Map&, std::vector<Constraint>);

}  // namespace mapweave::fusion
