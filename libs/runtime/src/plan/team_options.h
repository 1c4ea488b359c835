#pragma once
// Options that robots of one team cannot have each for itself.

#include <mapweave/runtime/run_configuration.h>

#include <optional>
#include <string>

namespace mapweave::runtime {

// All after choose_sensors(), unless said otherwise, and after a coordinator chose edges.

// Throws Error(kBadInput), naming two robots, where they share a camera map server (server.share) that would have to
// treat them alike, and their own options say otherwise: options of `rig`, or all of them waiting for each other.
void expect_agreement(const RunConfiguration&, const RunPlan&);
// What maps of lasers alone and of cameras alone have in common is nothing; where no robot has both, a note says so.
std::optional<std::string> note_on_senses(const RunPlan&);

// The same for programs of their own, which do not know yet what the others' robots sense with.
void expect_one_rig(const RunConfiguration&, const RunPlan&);

// By which the camera map server of this edge merges the cameras of each robot; see expect_agreement().
const rig::RigOptions& shared_rig_options(const RunConfiguration&, const RunPlan&, const TierId& edge);

}  // namespace mapweave::runtime
