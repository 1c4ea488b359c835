#include <mapweave/exporters/point_cloud.h>

#include <mapweave/core/error.h>
#include <mapweave/exporters/robot_colours.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <unordered_map>

namespace mapweave::exporters {
namespace {

using Voxel = std::array<std::int64_t, 3>;  // its number along x, y, z

struct VoxelHash {
  std::size_t operator()(const Voxel& voxel) const {
    std::uint64_t hash = 0;
    for (const std::int64_t number : voxel) {
      hash = (hash ^ static_cast<std::uint64_t>(number)) * 0x9e3779b97f4a7c15u;
      hash ^= hash >> 29;
    }
    return static_cast<std::size_t>(hash);
  }
};

struct Gathered {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  std::uint32_t count = 0;
  std::uint32_t robot = 0;  // the place of the first that saw it
};

class Thinning {
 public:
  explicit Thinning(double voxel_m) : voxel_m_(voxel_m) {}
  void add(const Eigen::Vector3d& point_in_map, std::size_t robot) {
    Voxel voxel;
    for (int axis = 0; axis < 3; ++axis)
      voxel[static_cast<std::size_t>(axis)] = static_cast<std::int64_t>(std::floor(point_in_map(axis) / voxel_m_));
    Gathered& gathered = voxels_[voxel];
    if (gathered.count++ == 0) gathered.robot = static_cast<std::uint32_t>(robot);
    gathered.sum += point_in_map;
  }
  std::vector<std::pair<Voxel, Gathered>> sorted() const {
    std::vector<std::pair<Voxel, Gathered>> all(voxels_.begin(), voxels_.end());
    std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    return all;
  }

 private:
  double voxel_m_;
  std::unordered_map<Voxel, Gathered, VoxelHash> voxels_;
};

void append_little_endian(std::string& bytes, std::uint32_t value) {
  for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(value >> shift & 0xff);
}

void append_little_endian(std::string& bytes, float value) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  append_little_endian(bytes, bits);
}

void add_walls(const OccupancyGrid& grid, const Pose3& map_from_node, std::size_t robot, Thinning& thinning) {
  for (std::int32_t row = 0; row < grid.rows; ++row)
    for (std::int32_t column = 0; column < grid.columns; ++column)
      if (grid.at(column, row) > 0)
        thinning.add(transformed(Eigen::Vector3d(grid.origin_x_m + (column + 0.5) * grid.resolution_m,
                                                 grid.origin_y_m + (row + 0.5) * grid.resolution_m, 0.0),
                                 map_from_node),
                     robot);
}

}  // namespace

std::vector<ColouredPoint> map_cloud(const Map& map, const PointCloudOptions& options) {
  MAPWEAVE_EXPECT(options.voxel_m > 0.0, "voxels have a size");
  const std::vector<RobotId> robots = map.robots();
  Thinning thinning(options.voxel_m);
  for (const auto& [id, node] : map.nodes) {
    if (node.payload == nullptr) continue;
    MAPWEAVE_EXPECT(is_finite(node.map_from_node), "the pose of " + to_string(id) + " is not finite");
    const auto robot = static_cast<std::size_t>(
        std::lower_bound(robots.begin(), robots.end(), id.session.client.robot) - robots.begin());
    if (const auto* grid = std::get_if<OccupancyGrid>(node.payload.get()))
      add_walls(*grid, node.map_from_node, robot, thinning);
    if (const auto* scan = std::get_if<PackedScan>(node.payload.get()))
      for (const auto& point : points_in_robot(*scan, 0.0, options.max_range_m))
        thinning.add(transformed(Eigen::Vector3d(point.x, point.y, 0.0), node.map_from_node), robot);
  }

  std::vector<ColouredPoint> points;
  for (const auto& [voxel, gathered] : thinning.sorted()) {
    const RobotColour colour = robot_colour(gathered.robot);
    points.push_back({(gathered.sum / gathered.count).cast<float>(),
                      static_cast<std::uint32_t>(colour.red << 16 | colour.green << 8 | colour.blue)});
  }
  const auto landmarks = landmark_cloud(map);
  points.insert(points.end(), landmarks.begin(), landmarks.end());
  return points;
}

std::string pcd_bytes(const Map& map, const PointCloudOptions& options) { return pcd_bytes(map_cloud(map, options)); }

std::vector<ColouredPoint> landmark_cloud(const Map& map) {
  std::vector<ColouredPoint> points;
  points.reserve(map.landmarks.size());
  for (const auto& [id, landmark] : map.landmarks) {
    const Node* anchor = map.nodes.find(landmark.anchor);
    MAPWEAVE_EXPECT(anchor != nullptr && is_finite(anchor->map_from_node),
                    "a landmark hangs on a keyframe of the map: " + to_string(id));
    const auto& [red, green, blue] = landmark.colour;
    points.push_back({transformed(landmark.point_in_anchor(), anchor->map_from_node).cast<float>(),
                      static_cast<std::uint32_t>(red << 16 | green << 8 | blue)});
  }
  return points;
}

std::string pcd_bytes(const std::vector<ColouredPoint>& points) {
  const std::string count = std::to_string(points.size());
  std::string bytes =
      "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 "
      "1 1 1\nWIDTH " +
      count + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + count + "\nDATA binary\n";
  bytes.reserve(bytes.size() + 16 * points.size());
  for (const auto& [point, rgb] : points) {
    for (int axis = 0; axis < 3; ++axis) append_little_endian(bytes, point(axis));
    append_little_endian(bytes, rgb);  // the bits of PCL's rgb
  }
  return bytes;
}

std::string ply_bytes(const std::vector<ColouredPoint>& points) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(points.size()) +
                      "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar "
                      "green\nproperty uchar "
                      "blue\nend_header\n";
  bytes.reserve(bytes.size() + 15 * points.size());
  for (const auto& [point, rgb] : points) {
    for (int axis = 0; axis < 3; ++axis) append_little_endian(bytes, point(axis));
    for (int shift = 16; shift >= 0; shift -= 8) bytes += static_cast<char>(rgb >> shift & 0xff);
  }
  return bytes;
}

}  // namespace mapweave::exporters
