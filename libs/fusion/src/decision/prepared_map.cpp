#include "prepared_map.h"
#include "team/followers.h"

#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

constexpr std::size_t kFewestPlaces = 10;  // of a small map, so that it is asked about at all

matching::Point2f placed(const Pose2& pose, const matching::Point2f& p) {
  const double c = std::cos(pose.phi), s = std::sin(pose.phi);
  return {static_cast<float>(pose.x + c * p.x - s * p.y), static_cast<float>(pose.y + s * p.x + c * p.y)};
}

double distance(const matching::Point2f& a, const matching::Point2f& b) { return std::hypot(a.x - b.x, a.y - b.y); }

// Cells of 0.1 m that hold walls, by the quadrant that these face.
std::vector<std::uint64_t> cells_of(const std::vector<matching::WallPoint>& walls) {
  std::vector<std::uint64_t> cells;
  for (const matching::WallPoint& wall : walls) {
    const auto x = static_cast<std::uint64_t>(matching::cell_of(wall.x, 10.0) + (1 << 28)),
               y = static_cast<std::uint64_t>(matching::cell_of(wall.y, 10.0) + (1 << 28));
    cells.push_back((y << 34U) | (x << 3U) | (wall.normal_x > wall.normal_y ? 1U : 0U) |
                    (wall.normal_x > -wall.normal_y ? 2U : 0U));
  }
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
  return cells;
}

}  // namespace

PreparedMap prepare(const Map& map, matching::ModelCache& cache, double stride_m, WorkerPool& pool) {
  PreparedMap prepared;
  prepared.map = &map;
  for (const auto& [id, submap] : map.submaps)
    if (submap.frozen && !std::holds_alternative<KeyframeFeatures>(*map.nodes.find(submap.anchor())->payload))
      prepared.submaps.push_back(&submap);  // what is judged here is walls
  struct Facts {
    matching::Point2f centre;
    std::vector<matching::RingKey> keys, far_keys;
    float radius_m;
    Hash fingerprint;
    std::vector<std::uint64_t> cells;  // of walls, in the map's frame
    std::vector<matching::WallPoint> walls;
  };
  auto facts = pool.map(prepared.submaps.size(), [&](std::size_t i) {
    const auto model = cache.get(*prepared.submaps[i], map.nodes);
    Hasher hasher;
    for (const matching::WallPoint& wall : model->walls()) hasher.add_bytes(&wall, sizeof wall);
    const auto cells = cells_of(
        matching::placed(planar(map.nodes.find(prepared.submaps[i]->anchor())->map_from_node), model->walls()));
    return Facts{model->centre(), model->ring_keys(), model->far_keys(), model->radius_m(), hasher.finish(),
                 cells,           model->walls()};
  });
  for (std::size_t i = 0; i < facts.size(); ++i) {
    const Node& anchor = *map.nodes.find(prepared.submaps[i]->anchor());
    prepared.is_grid = prepared.is_grid || (anchor.payload && std::holds_alternative<OccupancyGrid>(*anchor.payload));
    prepared.map_from_submap.push_back(planar(anchor.map_from_node));
    prepared.centres.push_back(placed(prepared.map_from_submap.back(), facts[i].centre));
    prepared.keys.push_back(facts[i].keys);
    prepared.far_keys.push_back(facts[i].far_keys);
    prepared.radii_m.push_back(facts[i].radius_m);
    prepared.fingerprints.push_back(facts[i].fingerprint);
  }
  std::vector<std::uint64_t> cells;
  for (const Facts& fact : facts) cells.insert(cells.end(), fact.cells.begin(), fact.cells.end());
  std::sort(cells.begin(), cells.end());
  const std::vector<NodeId> constrained = constrained_nodes(map);
  const auto followers = std::count_if(map.nodes.begin(), map.nodes.end(),
                                       [&](const auto& entry) { return is_follower(entry.second, constrained); });
  prepared.scans_per_scan = static_cast<double>(map.nodes.size()) /
                            std::max(1.0, static_cast<double>(map.nodes.size()) - static_cast<double>(followers));
  prepared.walls_m = 0.1 * static_cast<double>(std::unique(cells.begin(), cells.end()) - cells.begin());
  // A small map has few places to be recognised by: all the closer together they are looked at.
  for (double stride = stride_m;; stride *= 0.5) {
    prepared.representatives.clear();
    for (std::size_t i = 0; i < facts.size(); ++i)
      if (std::none_of(prepared.representatives.begin(), prepared.representatives.end(),
                       [&](std::size_t r) { return distance(prepared.centres[r], prepared.centres[i]) < stride; }))
        prepared.representatives.push_back(i);
    if (prepared.representatives.size() >= std::min(kFewestPlaces, facts.size()) || stride < 0.1) break;
  }
  for (Facts& fact : facts) prepared.walls.push_back(std::move(fact.walls));
  return prepared;
}

}  // namespace mapweave::fusion
