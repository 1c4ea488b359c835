#include "room_widths.h"

#include <mapweave/core/median.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

namespace mapweave::fusion {
namespace {

using matching::cell_of;
using matching::WallPoint;

constexpr double kAcross_m = 0.2, kAlong_m = 0.12;  // between walls that are the same
constexpr double kAlike = 0.94, kSkew_rad = 0.2;    // cosine between their normals; from the submap's directions
constexpr std::size_t kFewest = 20;                 // walls that face one way: two metres of them
constexpr double kLeastDeviation_m = 0.01;          // of one comparison

std::vector<WallPoint> in_team_frame(const PlacedSubmap& submap) {
  const Pose2& pose = submap.team_from_submap;
  const auto c = static_cast<float>(std::cos(pose.phi)), s = static_cast<float>(std::sin(pose.phi));
  const auto x = static_cast<float>(pose.x), y = static_cast<float>(pose.y);
  std::vector<WallPoint> walls;
  walls.reserve(submap.walls->size());
  for (const WallPoint& wall : *submap.walls)
    walls.push_back({c * wall.x - s * wall.y + x, s * wall.x + c * wall.y + y, c * wall.normal_x - s * wall.normal_y,
                     s * wall.normal_x + c * wall.normal_y});
  return walls;
}

// Walls by the square that they stand in.
class Squares {
 public:
  explicit Squares(const std::vector<WallPoint>& walls) {
    for (const WallPoint& wall : walls) sorted_.push_back({key(square(wall.x), square(wall.y)), wall});
    std::stable_sort(sorted_.begin(), sorted_.end(), [](const Entry& l, const Entry& r) { return l.key < r.key; });
  }
  template <class Visit>
  void around(double x, double y, Visit&& visit) const {
    for (int j = -1; j <= 1; ++j) {
      const std::uint64_t first = key(square(x) - 1, square(y) + j), last = key(square(x) + 1, square(y) + j);
      auto at = std::lower_bound(sorted_.begin(), sorted_.end(), first,
                                 [](const Entry& entry, std::uint64_t wanted) { return entry.key < wanted; });
      for (; at != sorted_.end() && at->key <= last; ++at) visit(at->wall);
    }
  }

 private:
  struct Entry {
    std::uint64_t key;
    WallPoint wall;
  };
  static int square(double metres) { return cell_of(metres, 1.0 / kAcross_m); }
  static std::uint64_t key(int x, int y) {
    return (static_cast<std::uint64_t>(y + (1 << 28)) << 32U) | static_cast<std::uint64_t>(x + (1 << 28));
  }
  std::vector<Entry> sorted_;
};

// Angles that are the same but for quarters of a turn, averaged.
class Directions {
 public:
  void add(double angle) {
    cosine_ += std::cos(4.0 * angle);
    sine_ += std::sin(4.0 * angle);
  }
  double mean() const { return 0.25 * std::atan2(sine_, cosine_); }

 private:
  double cosine_ = 0.0, sine_ = 0.0;
};

// Of walls that face each other: the direction across the room, and how much wider it is in the other map.
struct Difference {
  double direction, wider_m;
};

void add_differences(const std::vector<WallPoint>& walls, const std::vector<WallPoint>& of_other,
                     std::vector<Difference>& differences) {
  Directions directions;
  for (const WallPoint& wall : walls) directions.add(std::atan2(wall.normal_y, wall.normal_x));
  const double direction = directions.mean();
  const Squares squares(of_other);
  std::array<std::vector<double>, 4> farther_m;  // by the quarter that a wall faces
  for (const WallPoint& wall : walls) {
    const double angle = std::atan2(wall.normal_y, wall.normal_x) - direction;
    if (std::abs(std::remainder(angle, 0.5 * M_PI)) > kSkew_rad) continue;
    double least = kAlong_m, found_m = kAcross_m;
    squares.around(wall.x, wall.y, [&](const WallPoint& other) {
      if (other.normal_x * wall.normal_x + other.normal_y * wall.normal_y < kAlike) return;
      const double x = other.x - wall.x, y = other.y - wall.y;
      const double across = wall.normal_x * x + wall.normal_y * y,
                   along = std::abs(wall.normal_x * y - wall.normal_y * x);
      if (std::abs(across) >= kAcross_m || along >= least) return;
      least = along;
      found_m = across;
    });
    // A normal points into the room.
    if (found_m < kAcross_m)
      farther_m[static_cast<std::size_t>(std::lround(angle / (0.5 * M_PI)) & 3)].push_back(-found_m);
  }
  for (std::size_t axis = 0; axis < 2; ++axis)
    if (std::min(farther_m[axis].size(), farther_m[axis + 2].size()) >= kFewest)
      differences.push_back(
          {direction + 0.5 * M_PI * static_cast<double>(axis), median(farther_m[axis]) + median(farther_m[axis + 2])});
}

WidthComparison comparison_of(std::vector<double> differences_m) {
  WidthComparison result;
  result.count = differences_m.size();
  if (differences_m.empty()) return result;
  result.difference_m = median(differences_m);
  for (double& difference : differences_m) difference = std::abs(difference - result.difference_m);
  constexpr double kDeviations = 1.4826;  // of a median of distances
  result.deviation_m =
      std::max(kLeastDeviation_m, kDeviations * median(differences_m)) / std::sqrt(static_cast<double>(result.count));
  return result;
}

std::size_t nearest(const PlacedSubmap& to, const std::vector<PlacedSubmap>& side) {
  const auto distance = [&](const PlacedSubmap& submap) {
    return std::hypot(submap.x_m - to.x_m, submap.y_m - to.y_m);
  };
  return static_cast<std::size_t>(
      std::min_element(side.begin(), side.end(),
                       [&](const PlacedSubmap& l, const PlacedSubmap& r) { return distance(l) < distance(r); }) -
      side.begin());
}

}  // namespace

double WidthComparison::certain_m() const {
  return std::max(0.0, difference_m - 2.0 * deviation_m) - std::max(0.0, -difference_m - 2.0 * deviation_m);
}

WidthComparison compare_widths(const std::vector<PlacedSubmap>& a, const std::vector<PlacedSubmap>& b) {
  if (a.empty() || b.empty()) return {};
  std::set<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < a.size(); ++i) pairs.emplace(i, nearest(a[i], b));
  for (std::size_t j = 0; j < b.size(); ++j) pairs.emplace(nearest(b[j], a), j);
  std::vector<Difference> differences;
  for (const auto& [i, j] : pairs)
    if (std::hypot(a[i].x_m - b[j].x_m, a[i].y_m - b[j].y_m) < a[i].radius_m + b[j].radius_m)
      add_differences(in_team_frame(a[i]), in_team_frame(b[j]), differences);
  Directions directions;
  for (const Difference& difference : differences) directions.add(difference.direction);
  std::array<std::vector<double>, 2> along_m;
  for (const Difference& difference : differences)
    along_m[static_cast<std::size_t>(std::lround((difference.direction - directions.mean()) / (0.5 * M_PI)) & 1)]
        .push_back(difference.wider_m);
  const WidthComparison one = comparison_of(along_m[0]), across = comparison_of(along_m[1]);
  return std::abs(across.certain_m()) > std::abs(one.certain_m()) || one.count == 0 ? across : one;
}

}  // namespace mapweave::fusion
