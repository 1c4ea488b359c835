#include <mapweave/fusion/visit_audit.h>

#include "team_audit.h"

#include <mapweave/matching/submap_model.h>

#include <cmath>
#include <memory>

namespace mapweave::fusion {
namespace {

constexpr double kStretch_m = 40.0;  // of path: drifts less than a ghost is wide, and is little to lay elsewhere

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

struct Stretch {
  Stamp begin;
  std::vector<PlacedSubmap> submaps;
};

std::vector<Stretch> stretches_of(const std::vector<Place>& places) {
  std::vector<Stretch> result;
  double length_m = kStretch_m;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Place& place = places[i];
    if (i > 0) {
      const Pose2 step = between(places[i - 1].map_from_submap, place.map_from_submap);
      length_m += std::hypot(step.x, step.y);
    }
    if (length_m >= kStretch_m) {
      result.push_back({place.begin, {}});
      length_m = 0.0;
    }
    result.back().submaps.push_back(
        {i, place.map_from_submap, place.middle.x, place.middle.y, static_cast<double>(place.radius_m), &place.walls});
  }
  return result;
}

}  // namespace

std::optional<DoubledWalls> audit_visits(const Map& map) {
  const std::vector<Place> places = places_of(map);
  std::vector<std::vector<PlacedSubmap>> visits;
  std::vector<double> walls_m;
  const std::vector<Stretch> stretches = stretches_of(places);
  for (const Stretch& stretch : stretches) {
    visits.push_back(stretch.submaps);
    walls_m.push_back(length_of_walls(stretch.submaps));
  }
  const auto sight_of = [&](std::size_t number) { return places[number].sight; };
  // Neighbours share scans, and show what moved while the robot passed.
  const auto may_show_ghosts = [](std::size_t a, std::size_t b) { return b - a > 1; };
  DoubledWalls result;
  double most_m = 0.0;
  for (const AuditedPair& pair : audit(visits, walls_m, sight_of, may_show_ghosts, kGhostBeforeSolution).pairs) {
    result.length_m += pair.ghosts_m;
    if (pair.ghosts_m <= most_m) continue;
    most_m = pair.ghosts_m;
    result.x_m = pair.ghost_x_m;
    result.y_m = pair.ghost_y_m;
    result.first = stretches[pair.a].begin;
    result.then = stretches[pair.b].begin;
  }
  if (most_m <= 0.0) return std::nullopt;
  return result;
}

}  // namespace mapweave::fusion
