#include "maps_in_doubt.h"

#include <map>

namespace mapweave::tiers {
namespace {

constexpr double kWorthAsking = 0.05;  // probability

}  // namespace

std::set<MapId> maps_in_doubt(const fusion::FusionResult& result) {
  std::map<MapId, const fusion::Component*> component_of;
  for (const fusion::Component& component : result.components)
    for (const MapId& id : component.members) component_of[id] = &component;
  std::set<MapId> maps;
  for (const Verdict& verdict : result.verdicts) {
    if (verdict.decision == Decision::accepted || verdict.kind != "laser" || verdict.probability < kWorthAsking ||
        !verdict.alignment)
      continue;
    const auto a = component_of.find(verdict.a), b = component_of.find(verdict.b);
    if (a != component_of.end() && b != component_of.end() && a->second != b->second)
      maps.insert({verdict.a, verdict.b});
  }
  return maps;
}

}  // namespace mapweave::tiers
