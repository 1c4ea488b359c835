#include <mapweave/exporters/top_view.h>

#include "framed_map.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace mapweave::exporters {
namespace {

constexpr double kAboveRobots_m = 0.8;  // and higher: a ceiling
constexpr double kStray = 0.01;         // share of the points, on each side, that may lie beyond the picture
constexpr double kLeastSide_m = 1.0;

struct Extent {
  double low = 0.0, high = 0.0;
  double length() const { return high - low; }
};

Extent extent_of(std::vector<double> points, const std::vector<double>& robots) {
  Extent extent;
  const auto stray = static_cast<std::size_t>(kStray * static_cast<double>(points.size()));
  if (!points.empty()) {
    std::sort(points.begin(), points.end());
    extent = {points[stray], points[points.size() - 1 - stray]};
  } else {
    extent = {robots.front(), robots.front()};
  }
  for (const double robot : robots) extent.low = std::min(extent.low, robot), extent.high = std::max(extent.high, robot);
  const double rim = 0.02 * extent.length() + std::max(0.0, 0.5 * (kLeastSide_m - extent.length()));
  return {extent.low - rim, extent.high + rim};
}

}  // namespace

std::string top_view_png(const std::vector<ColouredPoint>& points, const std::vector<SessionTrajectory>& trajectories,
                         const PictureOptions& options) {
  std::vector<double> robot_x, robot_y;
  double highest = -1e9;
  for (const SessionTrajectory& trajectory : trajectories)
    for (const StampedPose& pose : trajectory.poses) {
      MAPWEAVE_EXPECT(is_finite(pose.map_from_robot), "a robot's pose is finite");
      robot_x.push_back(pose.map_from_robot.t.x()), robot_y.push_back(pose.map_from_robot.t.y());
      highest = std::max(highest, pose.map_from_robot.t.z());
    }
  std::vector<const ColouredPoint*> shown;
  for (const ColouredPoint& point : points) {
    MAPWEAVE_EXPECT(point.point.allFinite(), "a point is finite");
    if (robot_x.empty() || point.point.z() < static_cast<float>(highest + kAboveRobots_m)) shown.push_back(&point);
  }
  MAPWEAVE_EXPECT(!shown.empty() || !robot_x.empty(), "a top view shows points or ways");
  std::stable_sort(shown.begin(), shown.end(), [](const auto* a, const auto* b) { return a->point.z() < b->point.z(); });

  std::vector<double> x, y;
  for (const ColouredPoint* point : shown)
    x.push_back(static_cast<double>(point->point.x())), y.push_back(static_cast<double>(point->point.y()));
  const Extent across = extent_of(std::move(x), robot_x), along = extent_of(std::move(y), robot_y);
  MapRaster raster;
  raster.pixels_per_m = options.common_side_px / std::max(across.length(), along.length());
  raster.left_m = across.low, raster.low_m = along.low;
  const int columns = std::max(1, static_cast<int>(std::lround(across.length() * raster.pixels_per_m))),
            rows = std::max(1, static_cast<int>(std::lround(along.length() * raster.pixels_per_m)));
  raster.pixels = cv::Mat(rows, columns, CV_8UC3, kPaper);
  for (const ColouredPoint* point : shown) {
    const double column = (static_cast<double>(point->point.x()) - across.low) * raster.pixels_per_m,
                 row = rows - (static_cast<double>(point->point.y()) - along.low) * raster.pixels_per_m;
    if (!(column >= 0 && row >= 0 && column < columns && row < rows)) continue;
    // On white paper bright dots would not be seen.
    const auto shade = [&](int shift) { return 0.85 * (point->rgb >> shift & 0xff); };
    cv::circle(raster.pixels, {static_cast<int>(column), static_cast<int>(row)}, 1, cv::Scalar(shade(0), shade(8), shade(16)), cv::FILLED);
  }
  raster.size = metres(across.length(), 1);
  raster.size = raster.size.substr(0, raster.size.size() - 2) + " x " + metres(along.length(), 1) + ", " + std::to_string(points.size()) +
                " landmarks";
  return framed_map_png(raster, trajectories, options);
}

}  // namespace mapweave::exporters
