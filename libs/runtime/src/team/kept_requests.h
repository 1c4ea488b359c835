#pragma once
// What was said when a team was made: its stores keep it, so that what is merged of them again still knows it.

#include <mapweave/fusion/fuse.h>

#include <functional>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace mapweave::runtime {

struct KeptRequests {
  std::set<std::pair<MapId, MapId>> refused;       // the lower id first
  std::map<Hash, std::pair<MapId, MapId>> vetoed;  // judgements that are not believed, each of two maps
  std::vector<fusion::MapPrior> priors;
  std::vector<std::string> options;  // that decide and are not as by default: "fusion.merge_probability=0.9"
  std::string vocabulary;            // hash of the one that was given; empty: the shipped one
};

KeptRequests kept_requests(const fusion::FusionInput&, const fusion::FusionOptions&);
KeptRequests kept_requests(std::vector<fusion::MapPrior>, const fusion::FusionOptions&);

// Those of `vetoed` that the result knows, with the maps that they are of.
std::map<Hash, std::pair<MapId, MapId>> vetoes_of(const std::set<Hash>& vetoed, const std::vector<const Map*>& maps,
                                                  const fusion::FusionResult&);

// Puts what concerns any of these maps into the metadata of their store; nothing where nothing was said.
void keep(const KeptRequests&, const std::vector<MapId>& maps, std::map<std::string, std::string>& metadata);
// What a store keeps; nothing of one that keeps none. Throws Error(kCorrupt) for what is no such text.
KeptRequests kept_in(const std::map<std::string, std::string>& metadata, const std::string& where);

// The same of maps that have other names here.
KeptRequests renamed(const KeptRequests&, const std::function<MapId(const MapId&)>& name_of);

// A note where the team was made with another vocabulary than a merge of `options` works with.
void note_vocabulary(const KeptRequests&, const fusion::FusionOptions& options, std::vector<std::string>& notes);
// Adds what concerns two maps of the input, unless a prior of the same two is there already. A note for each.
void apply(const KeptRequests&, fusion::FusionInput&, std::vector<std::string>& notes);

}  // namespace mapweave::runtime
