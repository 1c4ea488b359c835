#include <mapweave/fusion/team_frame.h>

#include <mapweave/matching/grid_walls.h>
#include <mapweave/matching/wall_point.h>

#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

constexpr double kQuarter_rad = 1.5707963267948966;
constexpr double kDegree_rad = kQuarter_rad / 90.0;
constexpr std::size_t kMostScans = 2000;  // spread evenly

// Of what a node shows: the directions of its walls in the map's frame.
void add_directions(const Node& node, std::vector<double>& directions) {
  constexpr double kCell_m = 0.1;  // near walls have more rays, and count no more
  std::vector<matching::WallPoint> walls;
  if (const auto* scan = std::get_if<PackedScan>(node.payload.get()))
    walls = matching::thinned(matching::wall_points(*scan, 0.0, matching::kFarthestWall_m), kCell_m, SIZE_MAX);
  else if (const auto* grid = std::get_if<OccupancyGrid>(node.payload.get()))
    walls = matching::walls_of(*grid).faces;
  const double yaw = planar(node.map_from_node).phi;
  for (const matching::WallPoint& wall : walls)
    directions.push_back(std::atan2(static_cast<double>(wall.normal_y), static_cast<double>(wall.normal_x)) + yaw);
}

// The middle of the four degrees that hold most of them.
double densest(const std::vector<double>& directions) {
  constexpr int kBins = 360, kAround = 8;  // of a quarter of a degree: two degrees either way, as walls scatter
  std::vector<std::size_t> count(kBins, 0);
  for (const double direction : directions) {
    const double share = std::remainder(direction, kQuarter_rad) / kQuarter_rad + 0.5;
    ++count[static_cast<std::size_t>(std::clamp(static_cast<int>(share * kBins), 0, kBins - 1))];
  }
  int best = 0;
  std::size_t most = 0;
  for (int bin = 0; bin < kBins; ++bin) {
    std::size_t around = 0;
    for (int i = bin - kAround; i <= bin + kAround; ++i) around += count[static_cast<std::size_t>((i + kBins) % kBins)];
    if (around <= most) continue;
    most = around;
    best = bin;
  }
  return ((best + 0.5) / kBins - 0.5) * kQuarter_rad;
}

}  // namespace

void move_frame(FusionResult& result, std::size_t team, const Pose3& new_from_old) {
  Component& component = result.components[team];
  for (auto& entry : component.map.nodes)
    entry.second.map_from_node = compose(new_from_old, entry.second.map_from_node);
  for (auto& entry : component.team_from_map) entry.second = compose(new_from_old, entry.second);
  for (PairAudit& audit : result.audits) {
    if (audit.is_ghost || !component.team_from_map.contains(audit.a)) continue;
    for (PairAudit::Conflict& conflict : audit.conflicts) {
      const Eigen::Vector3d place = transformed(Eigen::Vector3d(conflict.x_m, conflict.y_m, 0.0), new_from_old);
      conflict.x_m = place.x();
      conflict.y_m = place.y();
    }
  }
}

std::optional<double> direction_of_walls(const Map& map) {
  constexpr double kNear_rad = 3.0 * kDegree_rad, kLeastShare = 0.2;  // by chance: 6 of 90 degrees
  constexpr std::size_t kFewest = 50;  // walls: of fewer, a fifth in one direction is chance
  std::size_t scans = 0, number = 0;
  for (const auto& entry : map.nodes) scans += entry.second.payload != nullptr;
  const std::size_t stride = scans / kMostScans + 1;
  std::vector<double> directions;
  for (const auto& entry : map.nodes)
    if (entry.second.payload != nullptr && number++ % stride == 0) add_directions(entry.second, directions);
  if (directions.size() < kFewest) return std::nullopt;
  double direction = densest(directions);
  std::size_t near = 0;
  for (int round = 0; round < 3; ++round) {
    double sum = 0.0;
    near = 0;
    for (const double one : directions) {
      const double off = std::remainder(one - direction, kQuarter_rad);
      if (std::abs(off) > kNear_rad) continue;
      sum += off;
      ++near;
    }
    if (near > 0) direction += sum / static_cast<double>(near);
  }
  if (static_cast<double>(near) < kLeastShare * static_cast<double>(directions.size())) return std::nullopt;
  return std::remainder(direction, kQuarter_rad);
}

}  // namespace mapweave::fusion
