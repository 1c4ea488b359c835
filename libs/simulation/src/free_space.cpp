#include <mapweave/core/error.h>
#include <mapweave/simulation/trajectory.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>
#include <queue>

namespace mapweave::simulation {
namespace {

constexpr double kCell = 0.1;         // metres
constexpr double kFarthest = 1.0;     // distances are known up to here
constexpr double kPreferred = 0.7;    // paths like to stay this far from walls
constexpr double kSampleStep = 0.04;  // along a straight path
constexpr double kWithinCell =
    0.5 * kCell * M_SQRT2 + 0.5 * kSampleStep;  // a cell's points, and those between samples, may be nearer by this
constexpr double kSearchRadius = 2.0;           // for a free point near a wanted one

struct Neighbour {
  int column, row, cost;  // cost: tenths of a cell
};
constexpr std::array<Neighbour, 8> kNeighbours{
    {{1, 0, 10}, {0, 1, 10}, {-1, 0, 10}, {0, -1, 10}, {1, 1, 14}, {-1, 1, 14}, {-1, -1, 14}, {1, -1, 14}}};

}  // namespace

FreeSpace::FreeSpace(const FloorPlan& plan, double clearance_m) : clearance_m_(clearance_m) {
  const Box box = bounds(plan);
  low_x_ = box.low_x;
  low_y_ = box.low_y;
  columns_ = static_cast<int>(std::ceil(box.width() / kCell)) + 1;
  rows_ = static_cast<int>(std::ceil(box.height() / kCell)) + 1;
  cells_ = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);

  std::vector<float> distances(cells_, static_cast<float>(kFarthest));
  const double reach = kFarthest + kWithinCell;
  for (const Wall& wall : plan.walls) {
    const auto column = [&](double x) { return std::clamp(static_cast<int>((x - low_x_) / kCell), 0, columns_ - 1); };
    const auto row = [&](double y) { return std::clamp(static_cast<int>((y - low_y_) / kCell), 0, rows_ - 1); };
    for (int r = row(std::min(wall.from.y, wall.to.y) - reach); r <= row(std::max(wall.from.y, wall.to.y) + reach);
         ++r) {
      for (int c = column(std::min(wall.from.x, wall.to.x) - reach);
           c <= column(std::max(wall.from.x, wall.to.x) + reach); ++c) {
        const std::size_t cell =
            static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(c);
        distances[cell] = std::min(
            distances[cell], static_cast<float>(std::max(0.0, distance_to_wall(wall, centre_of(cell)) - kWithinCell)));
      }
    }
  }

  // Only what can be reached from the rooms is inside of the building.
  distance_m_.assign(cells_, 0.0f);
  std::vector<std::size_t> open;
  const auto visit = [&](std::size_t cell) {
    if (distances[cell] < clearance_m_ || distance_m_[cell] > 0.0f) return;
    distance_m_[cell] = distances[cell];
    open.push_back(cell);
  };
  for (const Room& room : plan.rooms) visit(cell_of(room.inside.centre()));
  while (!open.empty()) {
    const std::size_t cell = open.back();
    open.pop_back();
    const std::size_t column = cell % static_cast<std::size_t>(columns_);
    if (column > 0) visit(cell - 1);
    if (column + 1 < static_cast<std::size_t>(columns_)) visit(cell + 1);
    if (cell >= static_cast<std::size_t>(columns_)) visit(cell - static_cast<std::size_t>(columns_));
    if (cell + static_cast<std::size_t>(columns_) < cells_) visit(cell + static_cast<std::size_t>(columns_));
  }
}

std::size_t FreeSpace::cell_of(Point2 p) const {
  const double column = std::floor((p.x - low_x_) / kCell), row = std::floor((p.y - low_y_) / kCell);
  if (!(column >= 0.0 && column < columns_ && row >= 0.0 && row < rows_)) return cells_;
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
}

Point2 FreeSpace::centre_of(std::size_t cell) const {
  const std::size_t columns = static_cast<std::size_t>(columns_);
  return {low_x_ + (static_cast<double>(cell % columns) + 0.5) * kCell,
          low_y_ + (static_cast<double>(cell / columns) + 0.5) * kCell};
}

double FreeSpace::distance_to_walls(Point2 p) const {
  const std::size_t cell = cell_of(p);
  return cell < cells_ ? static_cast<double>(distance_m_[cell]) : 0.0;
}

std::optional<Point2> FreeSpace::nearest_free(Point2 wanted) const {
  if (distance_to_walls(wanted) >= clearance_m_) return wanted;
  std::optional<Point2> best;
  double least = kSearchRadius;
  for (double y = wanted.y - kSearchRadius; y <= wanted.y + kSearchRadius; y += kCell) {
    for (double x = wanted.x - kSearchRadius; x <= wanted.x + kSearchRadius; x += kCell) {
      const std::size_t cell = cell_of({x, y});
      if (cell == cells_ || distance_m_[cell] < clearance_m_) continue;
      const Point2 centre = centre_of(cell);
      const double away = std::hypot(centre.x - wanted.x, centre.y - wanted.y);
      if (away < least) {
        least = away;
        best = centre;
      }
    }
  }
  return best;
}

bool FreeSpace::is_straight_path_free(Point2 from, Point2 to, double distance_m) const {
  const double length = std::hypot(to.x - from.x, to.y - from.y);
  const int steps = static_cast<int>(std::ceil(length / kSampleStep));
  for (int i = 0; i <= steps; ++i) {
    const double t = steps > 0 ? static_cast<double>(i) / steps : 0.0;
    if (distance_to_walls({from.x + t * (to.x - from.x), from.y + t * (to.y - from.y)}) < distance_m) return false;
  }
  return true;
}

std::optional<std::vector<Point2>> FreeSpace::path(Point2 from, Point2 to) const {
  const std::size_t start = cell_of(from), goal = cell_of(to);
  MAPWEAVE_EXPECT(distance_to_walls(from) >= clearance_m_ && distance_to_walls(to) >= clearance_m_,
                  "both ends of a path are free");
  const auto column_of = [&](std::size_t cell) { return static_cast<int>(cell % static_cast<std::size_t>(columns_)); };
  const auto row_of = [&](std::size_t cell) { return static_cast<int>(cell / static_cast<std::size_t>(columns_)); };
  const auto least_cost = [&](std::size_t cell) {
    const int across = std::abs(column_of(cell) - column_of(goal)), up = std::abs(row_of(cell) - row_of(goal));
    return 10 * (10 * std::max(across, up) + 4 * std::min(across, up));
  };
  constexpr int kUnreached = std::numeric_limits<int>::max();
  std::vector<int> costs(cells_, kUnreached);
  std::vector<std::uint8_t> came_by(cells_, 0);
  using Candidate = std::pair<int, std::size_t>;  // ties break by cell
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> candidates;
  costs[start] = 0;
  candidates.push({least_cost(start), start});
  while (!candidates.empty()) {
    const auto [total, cell] = candidates.top();
    candidates.pop();
    if (cell == goal) break;
    if (total > costs[cell] + least_cost(cell)) continue;
    for (std::size_t i = 0; i < kNeighbours.size(); ++i) {
      const int column = column_of(cell) + kNeighbours[i].column, row = row_of(cell) + kNeighbours[i].row;
      if (column < 0 || row < 0 || column >= columns_ || row >= rows_) continue;
      const std::size_t next =
          static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
      const double distance = static_cast<double>(distance_m_[next]);
      if (distance < clearance_m_) continue;
      const int dislike = 10 + static_cast<int>(20.0 * std::max(0.0, 1.0 - distance / kPreferred));
      const int cost = costs[cell] + kNeighbours[i].cost * dislike;
      if (cost >= costs[next]) continue;
      costs[next] = cost;
      came_by[next] = static_cast<std::uint8_t>(i);
      candidates.push({cost + least_cost(next), next});
    }
  }
  if (costs[goal] == kUnreached) return std::nullopt;

  std::vector<Point2> cells{to};
  for (std::size_t cell = goal; cell != start;) {
    const Neighbour& step = kNeighbours[came_by[cell]];
    cell = static_cast<std::size_t>(row_of(cell) - step.row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column_of(cell) - step.column);
    cells.push_back(cell == start ? from : centre_of(cell));
  }
  if (start == goal) cells.push_back(from);
  std::reverse(cells.begin(), cells.end());

  // Pulled straight, where that leads no nearer to a wall than the path has been anyway.
  std::vector<Point2> corners{cells.front()};
  for (std::size_t anchor = 0; anchor + 1 < cells.size();) {
    std::size_t reached = anchor + 1;
    double bottleneck = std::min({kPreferred, distance_to_walls(cells[anchor]), distance_to_walls(cells[reached])});
    while (reached + 1 < cells.size()) {
      bottleneck = std::min(bottleneck, distance_to_walls(cells[reached + 1]));
      if (!is_straight_path_free(cells[anchor], cells[reached + 1], bottleneck)) break;
      ++reached;
    }
    corners.push_back(cells[reached]);
    anchor = reached;
  }
  return corners;
}

}  // namespace mapweave::simulation
