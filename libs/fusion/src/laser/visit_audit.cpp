#include <mapweave/fusion/visit_audit.h>

#include "team_audit.h"
#include "visits.h"

#include <mapweave/matching/submap_model.h>

#include <memory>

namespace mapweave::fusion {
namespace {

// What is kept of a submap.
struct Place {
  Stamp begin;
  Pose2 map_from_submap, middle;  // middle: of its walls, in the map's frame
  float radius_m;
  std::vector<matching::WallPoint> walls;
  std::shared_ptr<const WallSight> sight;
};

// Each submap begins half-way through the one before it: every second one shows all.
std::vector<Place> places_of(const Map& map) {
  std::vector<Place> places;
  std::size_t frozen = 0;
  for (const auto& [id, submap] : map.submaps) {
    if (!submap.frozen || frozen++ % 2 != 0) continue;
    const matching::SubmapModel model(submap, map.nodes);
    if (model.is_raster()) return {};
    const Node& anchor = *map.nodes.find(submap.anchor());
    const Pose2 pose = planar(anchor.map_from_node);
    places.push_back({anchor.stamp, pose, compose(pose, Pose2{model.centre().x, model.centre().y, 0.0}),
                      model.radius_m(), model.walls(), std::make_shared<const WallSight>(model)});
  }
  return places;
}

}  // namespace

std::optional<DoubledWalls> audit_visits(const Map& map) {
  const std::vector<Place> places = places_of(map);
  std::vector<PlacedSubmap> path;
  for (const Place& place : places)
    path.push_back({path.size(), place.map_from_submap, place.middle.x, place.middle.y,
                    static_cast<double>(place.radius_m), &place.walls});
  const std::vector<std::vector<PlacedSubmap>> visits = visits_of(path);
  std::vector<double> walls_m;
  for (const std::vector<PlacedSubmap>& visit : visits) walls_m.push_back(length_of_walls(visit));
  const auto sight_of = [&](std::size_t number) { return places[number].sight; };
  DoubledWalls result;
  double most_m = 0.0;
  for (const AuditedPair& pair : audit(visits, walls_m, sight_of, are_visits_apart, kGhostBeforeSolution).pairs) {
    result.length_m += pair.ghosts_m;
    if (pair.ghosts_m <= most_m) continue;
    most_m = pair.ghosts_m;
    result.x_m = pair.ghost_x_m;
    result.y_m = pair.ghost_y_m;
    result.first = places[visits[pair.a].front().number].begin;
    result.then = places[visits[pair.b].front().number].begin;
  }
  if (most_m <= 0.0) return std::nullopt;
  return result;
}

}  // namespace mapweave::fusion
