#pragma once
// What a program of a deployment says of itself: one JSON for its page, its metrics, its health, and for who asks it
// over a wire.

#include <mapweave/runtime/live_cloud.h>
#include <mapweave/runtime/live_coordinator.h>

#include <nlohmann/json_fwd.hpp>

#include <string>
#include <vector>

namespace mapweave::runtime {

struct StatusTerms {
  double patience_s = 15.0;  // LiveOptions: who is silent for so long is missing
  double up_s = 0.0;         // time since the program began
};

// A tier: {role, name, state, is_done, counts: {name: number}, joint: [[map]], links: [...], findings: [...]}; of an
// edge and the cloud also newest_scan_s: {robot: stamp of its newest scan in the last preview}; of the cloud also
// apart: [text], why pairs of maps are not joined yet, and is_sealing; of an edge also ended: [robot], whose maps are
// finished; of a coordinator also groups: {edge: [robot]}, and last, its last moves in words.
// A link is what the tier knows of another one that it speaks with: {role, name, is_on_wire, is_needed (something of
// it is awaited), silent_seconds (null: it never said anything), counts}. A finding: {level: error or warning, what,
// remedy}; an error is what nothing but somebody's help ends.
nlohmann::ordered_json tier_status(const LiveCloudCounts&, const StatusTerms&);
nlohmann::ordered_json tier_status(const TierId& edge, const LiveEdgeCounts&, const StatusTerms&);
nlohmann::ordered_json tier_status(const RobotId& robot, const TierId& its_edge, const LiveRobotCounts&,
                                   const StatusTerms&);

nlohmann::ordered_json tier_status(const LiveCoordinatorCounts&, const StatusTerms&);

// Of a program with these tiers: {program, name, version, up_seconds, is_healthy, problems: [text] (the errors of all
// tiers), process: {cpu_seconds, resident_bytes, peak_resident_bytes}, tiers}. program: cloud, edge, robot,
// coordinator, demo.
nlohmann::ordered_json program_status(const std::string& program, const std::string& name,
                                      std::vector<nlohmann::ordered_json> tiers, const StatusTerms&);

// All numbers of a program_status() in the text format of Prometheus (0.0.4).
std::string metrics_text(const nlohmann::ordered_json& status);

}  // namespace mapweave::runtime
