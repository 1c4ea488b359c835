#pragma once
// Hours of driving by clients with features that publish to a map server and borrow landmarks from it. Each robot is a
// process, and the server is one, so that what each of them holds can be measured; they go on in lockstep, by data
// time.

#include <mapweave/simulation/world.h>
#include <mapweave/tiers/visual_server.h>

namespace mapweave::endurance {

// Prints every five minutes of data. `options`: its robots' cameras hand over features; all robots are in the first
// building.
void drive_team(const simulation::WorldOptions& options, const tiers::ServerOptions& sharing);

}  // namespace mapweave::endurance
