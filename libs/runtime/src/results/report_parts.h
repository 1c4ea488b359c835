#pragma once
// What a report's words and its JSON both look up in it.

#include <mapweave/runtime/report.h>

#include <vector>

namespace mapweave::runtime {

// Of the two maps, where one came to be.
const fusion::PairAudit* audit_of(const FusionReport&, const Verdict&);

// What edges send each other of their cameras' maps, while they drive: up to the cloud once, and down to each other one
// that has cameras.
struct PassedOn {
  TierId edge;
  std::uint64_t sent_bytes = 0, received_bytes = 0;
};
std::vector<PassedOn> passed_on(const Report&);

nlohmann::ordered_json names_json(const std::vector<MapId>&);

// What a coordinator decided: as in summary.json; and "(maps have grown): alpha to north; map expected complete ...".
nlohmann::ordered_json json_of(const tiers::CoordinatorDecision&);
std::string in_words(const tiers::CoordinatorDecision&, const char* nowhere = "itself, on board");

}  // namespace mapweave::runtime
