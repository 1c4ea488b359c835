#include <mapweave/simulation/ray_caster.h>

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>

namespace mapweave::simulation {
namespace {

constexpr double kMargin = 1e-6;  // cells hold what comes this near, so that rounding on the way of a ray hides nothing

// Whether the wall touches the box: by their sides' axes and the wall's normal.
bool touches(const Wall& wall, const Box& box) {
  if (std::max(wall.from.x, wall.to.x) < box.low_x || std::min(wall.from.x, wall.to.x) > box.high_x ||
      std::max(wall.from.y, wall.to.y) < box.low_y || std::min(wall.from.y, wall.to.y) > box.high_y)
    return false;
  const double normal_x = wall.from.y - wall.to.y, normal_y = wall.to.x - wall.from.x;
  const Point2 middle = box.centre();
  const double reach = 0.5 * (std::abs(normal_x) * box.width() + std::abs(normal_y) * box.height());
  return std::abs(normal_x * (middle.x - wall.from.x) + normal_y * (middle.y - wall.from.y)) <= reach;
}

}  // namespace

double distance_along_ray(Point2 origin, double dx, double dy, const Wall& wall) {
  const double wall_x = wall.to.x - wall.from.x, wall_y = wall.to.y - wall.from.y;
  const double from_x = wall.from.x - origin.x, from_y = wall.from.y - origin.y;
  const double cross = dx * wall_y - dy * wall_x,
               along = from_x * dy - from_y * dx;  // the latter in units of the former
  const bool is_met = cross > 0.0 ? along >= 0.0 && along <= cross : cross < 0.0 && along <= 0.0 && along >= cross;
  if (!is_met) return kNoHit;  // nor a wall parallel to the ray: seen edge-on, it has no width
  const double distance = (from_x * wall_y - from_y * wall_x) / cross;
  return distance >= 0.0 ? distance : kNoHit;
}

double distance_along_ray(Point2 origin, double dx, double dy, Point2 disc_centre, double disc_radius_m) {
  const double to_x = disc_centre.x - origin.x, to_y = disc_centre.y - origin.y;
  const double square = to_x * to_x + to_y * to_y - disc_radius_m * disc_radius_m;
  if (square <= 0.0) return 0.0;
  const double ahead = to_x * dx + to_y * dy, inside = ahead * ahead - square;
  return ahead > 0.0 && inside >= 0.0 ? ahead - std::sqrt(inside) : kNoHit;
}

RayCaster::RayCaster(const std::vector<Wall>& walls) {
  MAPWEAVE_EXPECT(!walls.empty(), "a building has walls");
  const Box box = bounds(FloorPlan{walls, {}});
  low_x_ = box.low_x - 2.0 * kMargin;
  low_y_ = box.low_y - 2.0 * kMargin;
  columns_ = static_cast<int>((box.width() + 4.0 * kMargin) / cell_m_) + 1;
  rows_ = static_cast<int>((box.height() + 4.0 * kMargin) / cell_m_) + 1;

  std::vector<std::vector<std::uint32_t>> cells(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  std::size_t count = 0;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    const Wall& wall = walls[i];
    const auto column = [&](double x) { return std::clamp(static_cast<int>((x - low_x_) / cell_m_), 0, columns_ - 1); };
    const auto row = [&](double y) { return std::clamp(static_cast<int>((y - low_y_) / cell_m_), 0, rows_ - 1); };
    for (int r = row(std::min(wall.from.y, wall.to.y) - kMargin); r <= row(std::max(wall.from.y, wall.to.y) + kMargin);
         ++r) {
      for (int c = column(std::min(wall.from.x, wall.to.x) - kMargin);
           c <= column(std::max(wall.from.x, wall.to.x) + kMargin); ++c) {
        const Box cell{low_x_ + c * cell_m_ - kMargin, low_y_ + r * cell_m_ - kMargin,
                       low_x_ + (c + 1) * cell_m_ + kMargin, low_y_ + (r + 1) * cell_m_ + kMargin};
        if (!touches(wall, cell)) continue;
        cells[static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(c)].push_back(
            static_cast<std::uint32_t>(i));
        ++count;
      }
    }
  }
  first_.reserve(cells.size() + 1);
  walls_.reserve(count);
  for (const auto& cell : cells) {
    first_.push_back(static_cast<std::uint32_t>(walls_.size()));
    for (const std::uint32_t i : cell) walls_.push_back(walls[i]);
  }
  first_.push_back(static_cast<std::uint32_t>(walls_.size()));
}

// Cell by cell along the ray: Amanatides and Woo, A fast voxel traversal algorithm for ray tracing, Eurographics 1987.
template <class Visit>
void RayCaster::walk(Point2 origin, double dx, double dy, double max_range_m, Visit&& visit) const {
  const double inverse_x = 1.0 / dx, inverse_y = 1.0 / dy;  // infinite where parallel to an axis
  const double high_x = low_x_ + columns_ * cell_m_, high_y = low_y_ + rows_ * cell_m_;
  double entry = 0.0;  // of the grid, where the ray starts outside of it
  if (origin.x < low_x_ || origin.x > high_x || origin.y < low_y_ || origin.y > high_y) {
    double exit = max_range_m;
    const auto clip = [&](double from, double step, double low, double high) {
      if (step == 0.0) {
        if (from < low || from > high) exit = -1.0;
        return;
      }
      const double a = (low - from) / step, b = (high - from) / step;
      entry = std::max(entry, std::min(a, b));
      exit = std::min(exit, std::max(a, b));
    };
    clip(origin.x, dx, low_x_, high_x);
    clip(origin.y, dy, low_y_, high_y);
    if (entry > exit) return;
  }
  const double start_x = (origin.x + entry * dx - low_x_) / cell_m_,
               start_y = (origin.y + entry * dy - low_y_) / cell_m_;
  int column = std::clamp(static_cast<int>(start_x), 0, columns_ - 1),
      row = std::clamp(static_cast<int>(start_y), 0, rows_ - 1);
  const int step_column = dx > 0.0 ? 1 : -1, step_row = dy > 0.0 ? 1 : -1;
  double next_x = dx == 0.0 ? kNoHit : (low_x_ + (column + (dx > 0.0 ? 1 : 0)) * cell_m_ - origin.x) * inverse_x;
  double next_y = dy == 0.0 ? kNoHit : (low_y_ + (row + (dy > 0.0 ? 1 : 0)) * cell_m_ - origin.y) * inverse_y;
  const double step_x = dx == 0.0 ? kNoHit : cell_m_ * std::abs(inverse_x),
               step_y = dy == 0.0 ? kNoHit : cell_m_ * std::abs(inverse_y);

  while (true) {
    const std::size_t cell =
        static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
    const double leaves_at = std::min(next_x, next_y);
    if (visit(walls_.data() + first_[cell], walls_.data() + first_[cell + 1], leaves_at) || leaves_at > max_range_m)
      break;
    if (next_x < next_y) {
      next_x += step_x;
      column += step_column;
      if (column < 0 || column >= columns_) break;
    } else {
      next_y += step_y;
      row += step_row;
      if (row < 0 || row >= rows_) break;
    }
  }
}

double RayCaster::distance(Point2 origin, double dx, double dy, double max_range_m) const {
  double nearest = kNoHit;
  walk(origin, dx, dy, max_range_m, [&](const Wall* wall, const Wall* end, double leaves_at) {
    for (; wall != end; ++wall) nearest = std::min(nearest, distance_along_ray(origin, dx, dy, *wall));
    return nearest <= leaves_at;
  });
  return nearest <= max_range_m ? nearest : kNoHit;
}

bool RayCaster::is_in_sight(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const {
  const double length = (to - from).head<2>().norm();
  if (length == 0.0) return true;
  const double dx = (to.x() - from.x()) / length, dy = (to.y() - from.y()) / length,
               rise = (to.z() - from.z()) / length;
  bool is_hidden = false;
  walk({from.x(), from.y()}, dx, dy, length, [&](const Wall* wall, const Wall* end, double) {
    for (; wall != end && !is_hidden; ++wall) {
      const double distance = distance_along_ray({from.x(), from.y()}, dx, dy, *wall), z = from.z() + distance * rise;
      is_hidden = distance < length && z > wall->low_m && z < wall->high_m;
    }
    return is_hidden;
  });
  return !is_hidden;
}

}  // namespace mapweave::simulation
