#pragma once
// What run and slam write of one robot, and how both take an interruption.

#include "results.h"

namespace mapweave::runtime {

// Its own map, by its laser or its cameras; of both, the cameras' in `folder`/cameras.
void add_robot(Results&, const std::string& folder, const std::string& title, MapOf, const Map&, const CamerasOutcome&);

// What was finished is to be saved in peace: a further signal ends that too. Throws Interrupted where nothing was.
void acknowledge_interruption(Report&, bool anything_finished);

}  // namespace mapweave::runtime
