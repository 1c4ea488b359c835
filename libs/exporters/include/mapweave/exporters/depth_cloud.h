#pragma once
// The surfaces that depth cameras saw, one coloured point for each cube, within a bound of memory.

#include <mapweave/exporters/point_cloud.h>

#include <array>
#include <unordered_map>

namespace mapweave::exporters {

struct DepthCloudOptions {
  double voxel_m = 0.02;
  double memory_mb = 256.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("voxel_m", voxel_m, 0.005, 10.0,
             "side in metres of the cubes of the dense point cloud, each of which becomes one point: the mean of all "
             "points in it; larger values keep fewer points");
    v.number("memory_mb", memory_mb, 1.0, 100000.0,
             "memory in megabytes for building the dense point cloud; where it needs more, the side of its cubes is "
             "doubled; larger values keep large clouds fine");
  }
};

class DepthCloud {
 public:
  explicit DepthCloud(const DepthCloudOptions& options = {});
  // Those farther than 10,000 km from the map's origin are left out. Contract: finite.
  void add(const std::vector<ColouredPoint>& points_in_map);

  double voxel_m() const { return voxel_m_; }  // now: that of the options, doubled once or more where memory was short
  std::size_t size() const { return voxels_.size(); }
  std::size_t most_voxels() const { return most_voxels_; }
  // The mean points in their mean colours, sorted by cube.
  std::vector<ColouredPoint> points() const;

 private:
  using Voxel = std::array<std::int32_t, 3>;  // its number along x, y, z
  struct VoxelHash {
    std::size_t operator()(const Voxel& voxel) const;
  };
  // Whole numbers: sums do not depend on the order.
  struct Gathered {
    std::array<std::uint32_t, 3> place{}, colour{};  // sums; places within the voxel, in 1/1024 of its side
    std::uint32_t count = 0;
  };
  static void halve(Gathered& gathered);
  void coarsen();

  double voxel_m_;
  std::size_t most_voxels_;
  std::unordered_map<Voxel, Gathered, VoxelHash> voxels_;
};

}  // namespace mapweave::exporters
