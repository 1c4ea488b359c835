#pragma once
// What witnesses say, as constraints between nodes of two maps; and how keyframes of one lie to each other.

#include "map_pair.h"
#include "visual_witness.h"

#include <mapweave/fusion/bind.h>

namespace mapweave::fusion {

// scale_a, scale_b: how many times as long the lengths of the maps become.
Constraint tie_of(const VisualWitness&, const VisualMap& a, const VisualMap& b, double scale_a, double scale_b);
Constraint tie_of(const Witness&, const PreparedMap& a, const PreparedMap& b);
// In the plane.
Constraint constraint_of(ConstraintKind kind, const NodeId& from, const NodeId& to, const Pose3& from_from_to, double sigma_m,
                         double sigma_rad);
// Between keyframes that see the same, as they lie in the map, which is metric.
std::vector<Constraint> steps_of(const Map&, const BindOptions&);
// To those that the map has.
void add_all(Map&, std::vector<Constraint>);

}  // namespace mapweave::fusion
