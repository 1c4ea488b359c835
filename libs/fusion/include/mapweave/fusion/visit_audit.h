#pragma once
// The audit of one robot's map: whether it saw the same walls when it came back to a place.

#include <mapweave/maps/map.h>

#include <optional>

namespace mapweave::fusion {

// Walls that stand double, or where an earlier or later visit saw that nothing stands.
struct DoubledWalls {
  double length_m = 0.0;        // of all places
  double x_m = 0.0, y_m = 0.0;  // the middle of the region where most of them are, map frame
  Stamp first, then;            // when the two visits began that disagree most
};

// Of a map of scans: its path is cut into stretches, which are compared as the robots of a team are
// (laser/team_audit.h). Nothing where all agree, but for what moved. Deterministic.
std::optional<DoubledWalls> audit_visits(const Map& map);

}  // namespace mapweave::fusion
