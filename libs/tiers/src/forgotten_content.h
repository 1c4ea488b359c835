#pragma once
// What was taken out of a map (UpdateInbox::take_out), put back where it lies now.

#include <mapweave/maps/map_update.h>

#include <map>
#include <vector>

namespace mapweave::tiers {

// Landmarks that lost the keyframe which they hung on are left out.
void put_back(Map& map, const std::vector<MapUpdate>& taken_out, const std::map<NodeId, Pose3>& poses);

}  // namespace mapweave::tiers
