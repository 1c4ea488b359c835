#pragma once
// Scans as matching sees them: points on walls that know which side they were seen from.

#include <mapweave/core/geometry.h>
#include <mapweave/maps/scan.h>

#include <vector>

namespace mapweave::matching {

struct Point2f {
  float x, y;  // metres
};

// The normal is a unit vector to the side the wall was seen from.
struct WallPoint {
  float x, y, normal_x, normal_y;
};

// Farther ends are sparse and say little about a submap, while rasters that hold them grow with the square of the
// distance.
constexpr double kFarthestWall_m = 60.0;

// A scan's ends in the robot's frame, in ray order; normals from neighbouring rays, or towards the laser where an end
// stands alone.
std::vector<WallPoint> wall_points(const PackedScan&, double min_range_m = 0.0, double max_range_m = 1e9);

// The same points in another frame.
std::vector<WallPoint> placed(const Pose2& pose, std::vector<WallPoint> points);

// Points thinned to one a `cell_m` cell (the first in ray order) and at most `most` of them, spread evenly.
std::vector<WallPoint> thinned(const std::vector<WallPoint>& points, double cell_m, std::size_t most);
// The same with the middle one of each cell's run instead of the first: first ones lie all on one side of what they
// hit, which turns a scan of small things by up to a degree in ten metres of path.
std::vector<WallPoint> thinned_evenly(const std::vector<WallPoint>& points, double cell_m, std::size_t most);

}  // namespace mapweave::matching
