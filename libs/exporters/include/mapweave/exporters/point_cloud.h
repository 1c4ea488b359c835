#pragma once
// The walls and landmarks of a map as points, in PCL's format (PCD v0.7, binary) and as PLY.

#include <mapweave/maps/map.h>

#include <cstdint>
#include <string>
#include <vector>

namespace mapweave::exporters {

struct PointCloudOptions {
  double voxel_m = 0.05;      // one point is kept in each cube of this side: the mean of all that fell in it
  double max_range_m = 30.0;  // rays longer than this are left out
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("voxel_m", voxel_m, 0.005, 10.0,
             "side in metres of the cubes of the laser's point cloud (map.pcd), in each of which one point is kept; "
             "larger values keep fewer points");
    v.positive("max_range_m", max_range_m,
               "laser returns farther than this distance in metres are left out of the point cloud (map.pcd); larger "
               "values keep more points, which are less accurate far away");
  }
};

struct ColouredPoint {
  Eigen::Vector3f point;  // metres
  std::uint32_t rgb = 0;  // red << 16 | green << 8 | blue
};

// The walls of a map and its landmarks, in its frame: 0 is the floor that the robots' bases move on, since lasers are
// seen from above. A wall point has the colour of the robot that saw it first, the colours of the picture; they are
// sorted by cube. Of map_server grids: the centres of wall cells. After the walls come all of landmark_cloud().
std::vector<ColouredPoint> map_cloud(const Map&, const PointCloudOptions& = {});
// map_cloud() with fields x y z (metres) and rgb.
std::string pcd_bytes(const Map&, const PointCloudOptions& = {});

// The landmarks of a map, in its frame and their own colours, in the order of their ids.
std::vector<ColouredPoint> landmark_cloud(const Map&);
std::string pcd_bytes(const std::vector<ColouredPoint>&);
// Binary, little endian; vertices with x y z (float) and red green blue (uchar).
std::string ply_bytes(const std::vector<ColouredPoint>&);

}  // namespace mapweave::exporters
