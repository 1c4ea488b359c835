#pragma once
// A robot's own map beside the team map that it became part of: what differs, so that a merge can be undone from the
// team map alone.

#include <mapweave/maps/map_update.h>

namespace mapweave {

// own = member_of(team, member_update(team, own)), bit for bit. Content that the team map holds too is not in the
// update.
MapUpdate member_update(const Map& team, const Map& own);
// Throws what updated() throws.
Map member_of(const Map& team, const MapUpdate&);

}  // namespace mapweave
