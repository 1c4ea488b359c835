#pragma once

#include <mapweave/maps/map_update.h>

#include <string>

namespace mapweave::tiers {

// That a map which a client speaks of is one of its own. Throws Error(kBadInput) otherwise.
void expect_own_map(const MapId& map, const ClientId& client, const std::string& where);

// Everything that an update says must be of its own client's run, and of a camera somewhere on Earth; what it borrowed
// alone is of others. Throws Error(kBadInput) otherwise.
void expect_owned(const MapUpdate& update, const SessionId& owner, const std::string& where);

}  // namespace mapweave::tiers
