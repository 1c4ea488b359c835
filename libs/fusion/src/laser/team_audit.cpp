#include "team_audit.h"

#include "region_displacement.h"

#include <algorithm>
#include <map>
#include <tuple>

namespace mapweave::fusion {
namespace {

// What may have moved of a region: a share of what coincides, and both faces of a partition.
constexpr double kMovedShare = 0.4, kMoved_m = 12.0;
constexpr double kLookedAt_m = 2.5;    // in doubt, from which a region is laid elsewhere
constexpr double kDoubtedShare = 0.1;  // of what coincides, from which a smaller place in it is, too

// Whether a region is contradicted by things that moved, among walls that lie where they should.
bool shows_what_moved(const RegionAgreement& region, RegionDisplacement& displacement) {
  return in_doubt_m(region) < std::min(kMoved_m, kMovedShare * region.coinciding_m) &&
         !displacement.better_place(region);
}

bool is_ghost_in_small(const RegionAgreement& square, const GhostBounds& bounds) {
  return square.contradicted_m > std::max(bounds.small_length_m, bounds.small_share * square.coinciding_m);
}

}  // namespace

bool is_ghost(const RegionAgreement& region, const GhostBounds& bounds) {
  return in_doubt_m(region) > std::max(bounds.length_m, bounds.share * region.coinciding_m);
}

TeamAudit audit(const std::vector<std::vector<PlacedSubmap>>& maps, const std::vector<double>& walls_m,
                const SightOf& sight_of, const std::function<bool(std::size_t, std::size_t)>& may_show_ghosts,
                const GhostBounds& bounds) {
  std::map<std::pair<std::size_t, std::size_t>, AuditedPair> pairs;
  std::map<std::pair<std::size_t, std::size_t>, double> most_m;  // ghosts of a pair in one region
  std::vector<double> ghosts_m(maps.size(), 0.0);
  RegionDisplacement displacement(maps, sight_of);
  for (const RegionAgreement& region : compare_by_region(maps, sight_of)) {
    AuditedPair& pair = pairs[{region.a, region.b}];
    pair.a = region.a;
    pair.b = region.b;
    pair.coinciding_m += region.coinciding_m;
    pair.contradicted_m += region.contradicted_m;
    pair.unclear_m += region.unclear_m;
    pair.contradictions.insert(pair.contradictions.end(), region.contradictions.begin(), region.contradictions.end());
    if (!may_show_ghosts(region.a, region.b)) continue;
    const RegionAgreement around = region.in(region.centred), small = region.in(region.most_doubted);
    const bool is_one =
        (is_ghost(region, bounds) && is_ghost(around, bounds) && !shows_what_moved(around, displacement)) ||
        is_ghost_in_small(small, bounds);
    if (!is_one) continue;
    pair.ghosts_m += in_doubt_m(region);
    if (double& most = most_m[{region.a, region.b}]; in_doubt_m(region) > most) {
      most = in_doubt_m(region);
      pair.ghost_x_m = region.x_m;
      pair.ghost_y_m = region.y_m;
    }
    ghosts_m[region.a] += in_doubt_m(region);
    ghosts_m[region.b] += in_doubt_m(region);
  }
  TeamAudit result;
  for (auto& entry : pairs) {
    std::stable_sort(entry.second.contradictions.begin(), entry.second.contradictions.end(),
                     [](const Contradiction& l, const Contradiction& r) { return l.length_m > r.length_m; });
    result.pairs.push_back(std::move(entry.second));
  }
  for (std::size_t m = 0; m < maps.size(); ++m) {
    if (ghosts_m[m] <= 0.0) continue;
    if (!result.taken_out || std::make_pair(ghosts_m[m], -walls_m[m]) >
                                 std::make_pair(ghosts_m[*result.taken_out], -walls_m[*result.taken_out]))
      result.taken_out = m;
  }
  return result;
}

BentRegions bent_regions(const std::vector<std::vector<PlacedSubmap>>& maps, const SightOf& sight_of,
                         const std::function<bool(std::size_t, std::size_t)>& may_be_bent, PlaceSizes sizes) {
  BentRegions result;
  RegionDisplacement displacement(maps, sight_of);
  for (const RegionAgreement& region : compare_by_region(maps, sight_of)) {
    result.in_doubt_m += in_doubt_m(region);
    if (in_doubt_m(region) < kLookedAt_m || !may_be_bent(region.a, region.b)) continue;
    std::vector<RegionAgreement> places{region};
    if (sizes == PlaceSizes::all)
      for (const RegionAgreement& place : {region.in(region.centred), region.in(region.most_doubted)})
        if (in_doubt_m(place) >= kDoubtedShare * place.coinciding_m) places.push_back(place);
    for (const RegionAgreement& place : places)
      if (const auto moved = displacement.better_place(place)) {
        result.regions.push_back({region.a, region.b, place.x_m, place.y_m, *moved});
        break;
      }
  }
  return result;
}

}  // namespace mapweave::fusion
