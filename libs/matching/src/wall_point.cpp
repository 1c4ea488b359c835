#include <mapweave/core/error.h>
#include <mapweave/matching/wall_point.h>

#include <cmath>

namespace mapweave::matching {
namespace {

// The tangent of a wall is taken over neighbours this far to either side: enough to drown the noise of ranges, as only
// the side matters.
constexpr float kReach_m = 0.08F;
constexpr std::size_t kMostSteps = 10;

float square_distance(const ScanPoint& a, const ScanPoint& b) {
  return (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y);
}

// Spread evenly over all.
std::vector<WallPoint> at_most(std::vector<WallPoint> points, std::size_t most) {
  if (points.size() <= most) return points;
  std::vector<WallPoint> even;
  even.reserve(most);
  for (std::size_t i = 0; i < most; ++i) even.push_back(points[i * points.size() / most]);
  return even;
}

}  // namespace

std::vector<WallPoint> wall_points(const PackedScan& scan, double min_range_m, double max_range_m) {
  const auto ends = points_in_robot(scan, min_range_m, max_range_m);
  const ScanPoint eye{static_cast<float>(scan.geometry->robot_from_laser.t.x()),
                      static_cast<float>(scan.geometry->robot_from_laser.t.y())};
  std::vector<WallPoint> points;
  points.reserve(ends.size());
  for (std::size_t i = 0; i < ends.size(); ++i) {
    const ScanPoint& p = ends[i];
    const float view_x = eye.x - p.x, view_y = eye.y - p.y, range = std::sqrt(view_x * view_x + view_y * view_y);
    // Farther apart than this, neighbours are ends on two things.
    const float gap = 0.15F + 0.06F * range;
    std::size_t left = i, right = i;
    while (left > 0 && i - left < kMostSteps && square_distance(ends[left], p) < kReach_m * kReach_m &&
           square_distance(ends[left - 1], ends[left]) < gap * gap)
      --left;
    while (right + 1 < ends.size() && right - i < kMostSteps && square_distance(ends[right], p) < kReach_m * kReach_m &&
           square_distance(ends[right + 1], ends[right]) < gap * gap)
      ++right;
    float nx = ends[left].y - ends[right].y, ny = ends[right].x - ends[left].x;
    float length = std::sqrt(nx * nx + ny * ny);
    if (length < 1e-4F) {
      nx = view_x;
      ny = view_y;
      length = range;
    }
    if (length < 1e-6F) continue;  // the laser itself
    if (nx * view_x + ny * view_y < 0) length = -length;
    points.push_back({p.x, p.y, nx / length, ny / length});
  }
  return points;
}

std::vector<WallPoint> placed(const Pose2& pose, std::vector<WallPoint> points) {
  const double c = std::cos(pose.phi), s = std::sin(pose.phi);
  for (auto& p : points)
    p = {static_cast<float>(c * p.x - s * p.y + pose.x), static_cast<float>(s * p.x + c * p.y + pose.y),
         static_cast<float>(c * p.normal_x - s * p.normal_y), static_cast<float>(s * p.normal_x + c * p.normal_y)};
  return points;
}

std::vector<WallPoint> thinned(const std::vector<WallPoint>& points, double cell_m, std::size_t most) {
  MAPWEAVE_EXPECT(cell_m > 0 && most > 0, "thinning needs a cell size and room for points");
  std::vector<WallPoint> kept;
  kept.reserve(points.size());
  // Neighbouring rays hit neighbouring places: comparing with the last kept ones is enough to even out the density.
  const double square = cell_m * cell_m;
  for (const auto& p : points) {
    bool near = false;
    for (std::size_t back = 1; back <= 3 && back <= kept.size() && !near; ++back) {
      const double dx = p.x - kept[kept.size() - back].x, dy = p.y - kept[kept.size() - back].y;
      near = dx * dx + dy * dy < square;
    }
    if (!near) kept.push_back(p);
  }
  return at_most(std::move(kept), most);
}

std::vector<WallPoint> thinned_evenly(const std::vector<WallPoint>& points, double cell_m, std::size_t most) {
  MAPWEAVE_EXPECT(cell_m > 0 && most > 0, "thinning needs a cell size and room for points");
  struct Run {
    std::size_t first, count;
  };
  std::vector<Run> runs;
  const double square = cell_m * cell_m;
  for (std::size_t i = 0; i < points.size(); ++i) {
    bool near = false;
    for (std::size_t back = 1; back <= 3 && back <= runs.size() && !near; ++back) {
      Run& run = runs[runs.size() - back];
      const double dx = points[i].x - points[run.first].x, dy = points[i].y - points[run.first].y;
      near = dx * dx + dy * dy < square;
      if (near && back == 1) ++run.count;
    }
    if (!near) runs.push_back({i, 1});
  }
  std::vector<WallPoint> kept;
  kept.reserve(runs.size());
  for (const Run& run : runs) kept.push_back(points[run.first + (run.count - 1) / 2]);
  return at_most(std::move(kept), most);
}

}  // namespace mapweave::matching
