#pragma once
// What matching needs of one frozen submap: caches, made from its content alone and thrown away at will.

#include <mapweave/maps/map.h>
#include <mapweave/matching/wall_field.h>

#include <array>
#include <memory>
#include <vector>

namespace mapweave::matching {

// Two submaps may show the same walls while the middles of their walls are nearer than this share of their radii
// together. What is seen at the end of a hall makes a circle large and is too little to match by: hence the bound on a
// radius.
inline constexpr double kOverlapShare = 0.6;
inline constexpr float kLargestOverlapRadius_m = 12.0F;

// What rays said about a cell.
enum class Sight : std::uint8_t { unknown = 0, free = 1, wall = 2 };

// How the place looks around one point of the robot's path: walls per ring of distance. Does not change with heading.
struct RingKey {
  static constexpr int kRings = 24;
  static constexpr double kRing_m = 0.5;
  static constexpr double kFarRing_m = 1.5;  // of SubmapModel::far_keys()
  std::array<float, kRings> walls{};
  Point2f centre{};
};

class SubmapModel {
 public:
  static constexpr double kSightResolution = 0.10;
  static constexpr double kSearchResolution = 0.10;
  static constexpr int kLevels = 3;

  // Throws ContractViolation for a submap that is not frozen or names unknown nodes.
  SubmapModel(const Submap& submap, const Table<NodeId, Node>& nodes);

  const SparseWallField& field() const { return field_; }
  const std::vector<WallPoint>& walls() const { return walls_; }
  const Raster<Sight>& sight() const { return sight_; }
  std::size_t known_cells() const { return known_cells_; }
  // Level k holds, at cells of kSearchResolution * 4^k, the largest likelihood of the cells [i, i + 2) * 4^k: a bound
  // for all shifts of less than 4^k cells. Level 0 is the likelihood itself, at 10 cm.
  const std::array<SparseRaster<std::uint8_t>, kLevels>& pyramid() const { return pyramid_; }
  const std::vector<RingKey>& ring_keys() const { return ring_keys_; }
  const std::vector<RingKey>& far_keys() const { return far_keys_; }  // the same with wider rings: halls, and outdoors
  const std::vector<Point2f>& query() const { return query_; }  // at most 200 wall points, spread evenly, for searching
  // Of the walls: middle, and distance of the farthest from it.
  Point2f centre() const { return centre_; }
  float radius_m() const { return radius_m_; }
  bool is_raster() const { return is_raster_; }  // made of map_server tiles, not of scans
  std::size_t bytes() const;

 private:
  void look(const Submap&, const Table<NodeId, Node>&, WallField&);
  void add_raster(const OccupancyGrid&, const Pose2& submap_from_node, WallField&);
  void find_walls(const WallField&);
  void build_pyramid();
  void describe();
  RingKey key_at(const Pose2& submap_from_viewpoint, double ring_m) const;

  SparseWallField field_;
  Raster<Sight> sight_;
  std::vector<WallPoint> walls_;
  std::vector<Point2f> query_;
  std::array<SparseRaster<std::uint8_t>, kLevels> pyramid_;
  std::vector<RingKey> ring_keys_, far_keys_;
  std::vector<Pose2> path_;
  std::size_t known_cells_ = 0;
  Point2f centre_{};
  float radius_m_ = 0;
  bool is_raster_ = false;
};

// Smaller is more alike; of the best pair of viewpoints.
double ring_distance(const SubmapModel& a, const SubmapModel& b);
double ring_distance(const std::vector<RingKey>& a, const std::vector<RingKey>& b);

}  // namespace mapweave::matching
