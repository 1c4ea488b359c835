#include <mapweave/core/error.h>
#include <mapweave/matching/submap_model.h>

#include <Eigen/Geometry>
#include <algorithm>

namespace mapweave::matching {
namespace {

constexpr double kSightRange_m = 30.0;   // rays say nothing about cells beyond
constexpr double kSightStep_m = 0.20;    // scans nearer to the last one drawn say nothing new about free space
constexpr double kSightStep_rad = 0.20;  // turned by less, a scan sees the same cells
constexpr double kInverseSight = 1.0 / SubmapModel::kSightResolution;
constexpr std::size_t kQueryPoints = 200;  // that stand for a submap's walls in a search: bounds time
constexpr double kViewpointStep_m = 2.0;   // nearer viewpoints see the same rings of walls

struct Counts {
  std::uint16_t hits = 0, passes = 0;
};

// Calls visit(x, y) for the cells a ray crosses, its last cell excluded (Amanatides and Woo, 1987).
template <class Visit>
void walk(double x0, double y0, double x1, double y1, double inverse, Visit&& visit) {
  int x = cell_of(x0, inverse), y = cell_of(y0, inverse);
  const int last_x = cell_of(x1, inverse), last_y = cell_of(y1, inverse);
  const double dx = x1 - x0, dy = y1 - y0;
  const int step_x = dx > 0 ? 1 : -1, step_y = dy > 0 ? 1 : -1;
  const double side = 1.0 / inverse;
  double next_x = dx != 0 ? ((x + (dx > 0 ? 1 : 0)) * side - x0) / dx : 1e300,
         next_y = dy != 0 ? ((y + (dy > 0 ? 1 : 0)) * side - y0) / dy : 1e300;
  const double each_x = dx != 0 ? side / std::abs(dx) : 1e300, each_y = dy != 0 ? side / std::abs(dy) : 1e300;
  int most = std::abs(last_x - x) + std::abs(last_y - y);
  while ((x != last_x || y != last_y) && most-- > 0) {
    visit(x, y);
    if (next_x < next_y) {
      next_x += each_x;
      x += step_x;
    } else {
      next_y += each_y;
      y += step_y;
    }
  }
}

bool is_within(const OccupancyGrid& grid, std::int32_t column, std::int32_t row) {
  return column >= 0 && row >= 0 && column < grid.columns && row < grid.rows;
}
bool is_free(const OccupancyGrid& grid, std::int32_t column, std::int32_t row) {
  return is_within(grid, column, row) && grid.at(column, row) < OccupancyGrid::kUnknown;
}

// Where an occupied cell is seen from: across the line that the occupied cells around it lie along, on the sides that
// are free; where they lie along none, from the free cells beside it. In the grid's axes.
std::vector<std::pair<double, double>> faces_of(const OccupancyGrid& grid, std::int32_t column, std::int32_t row) {
  constexpr double kAround_m = 0.16;  // of a wall's cell: its normal is that of its neighbours
  const int around = std::clamp(static_cast<int>(std::lround(kAround_m / grid.resolution_m)), 1, 6);
  double count = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
  for (int dy = -around; dy <= around; ++dy)
    for (int dx = -around; dx <= around; ++dx)
      if (is_within(grid, column + dx, row + dy) && grid.at(column + dx, row + dy) > OccupancyGrid::kUnknown) {
        count += 1;
        x += dx;
        y += dy;
        xx += dx * dx;
        xy += dx * dy;
        yy += dy * dy;
      }
  std::vector<std::pair<double, double>> faces;
  x /= count;
  y /= count;
  xx = xx / count - x * x;
  xy = xy / count - x * y;
  yy = yy / count - y * y;
  const double spread = std::sqrt((xx - yy) * (xx - yy) + 4.0 * xy * xy), along = 0.5 * (xx + yy + spread),
               across = 0.5 * (xx + yy - spread);
  if (count >= 3 && along > 4.0 * across) {
    const double angle = 0.5 * std::atan2(2.0 * xy, xx - yy) + M_PI / 2;
    const double nx = std::cos(angle), ny = std::sin(angle);
    for (const int side : {1, -1})
      for (const double step : {1.0, 2.0})
        if (is_free(grid, column + static_cast<std::int32_t>(std::lround(side * step * nx)),
                    row + static_cast<std::int32_t>(std::lround(side * step * ny)))) {
          faces.emplace_back(side * nx, side * ny);
          break;
        }
    if (!faces.empty()) return faces;
  }
  for (const auto& [dx, dy] : {std::pair{1, 0}, {0, 1}, {-1, 0}, {0, -1}})
    if (is_free(grid, column + dx, row + dy)) faces.emplace_back(dx, dy);
  return faces;
}

// Where rays ended, and what they crossed.
void see_through(const Pose2& eye, const std::vector<WallPoint>& points, Raster<Counts>& counts) {
  const auto end_of = [&](const WallPoint& p) {
    const double dx = p.x - eye.x, dy = p.y - eye.y, range = std::hypot(dx, dy),
                 share = std::min(1.0, kSightRange_m / range);
    return range > kSightRange_m ? Eigen::Vector2d(eye.x + dx * share, eye.y + dy * share) : Eigen::Vector2d(p.x, p.y);
  };
  Eigen::AlignedBox2d box(Eigen::Vector2d(eye.x, eye.y));
  for (const WallPoint& p : points) box.extend(end_of(p));
  counts.grow(cell_of(box.min().x(), kInverseSight) - 1, cell_of(box.min().y(), kInverseSight) - 1,
              cell_of(box.max().x(), kInverseSight) + 1, cell_of(box.max().y(), kInverseSight) + 1);
  for (const WallPoint& p : points) {
    const Eigen::Vector2d end = end_of(p);
    walk(eye.x, eye.y, end.x(), end.y(), kInverseSight, [&](int x, int y) {
      auto& cell = counts.at(x, y);
      if (cell.passes < 65535) ++cell.passes;
    });
    auto& last = counts.at(cell_of(end.x(), kInverseSight), cell_of(end.y(), kInverseSight));
    const bool is_far = std::hypot(p.x - eye.x, p.y - eye.y) > kSightRange_m;
    if (!is_far && last.hits < 65535) ++last.hits;
  }
}

}  // namespace

SubmapModel::SubmapModel(const Submap& submap, const Table<NodeId, Node>& nodes) {
  MAPWEAVE_EXPECT(submap.frozen, "only frozen submaps are matched");
  WallField field;
  look(submap, nodes, field);
  field.settle();
  find_walls(field);
  field_ = SparseWallField(field);
  build_pyramid();
  describe();
}

void SubmapModel::add_raster(const OccupancyGrid& grid, const Pose2& submap_from_node, WallField& field) {
  is_raster_ = true;
  const double c = std::cos(submap_from_node.phi), s = std::sin(submap_from_node.phi);
  std::vector<WallPoint> points;
  const auto place = [&](double column, double row) {
    const double x = grid.origin_x_m + column * grid.resolution_m, y = grid.origin_y_m + row * grid.resolution_m;
    return Point2f{static_cast<float>(c * x - s * y + submap_from_node.x),
                   static_cast<float>(s * x + c * y + submap_from_node.y)};
  };
  // Coarse cells are looked at in parts, so that no cell of ours is left out.
  const int parts = std::max(1, static_cast<int>(std::ceil(grid.resolution_m / kSightResolution)));
  for (std::int32_t row = 0; row < grid.rows; ++row)
    for (std::int32_t column = 0; column < grid.columns; ++column) {
      const auto value = grid.at(column, row);
      if (value == OccupancyGrid::kUnknown) continue;
      for (int part = 0; part < parts * parts; ++part) {
        const Point2f p = place(column + (part % parts + 0.5) / parts, row + (part / parts + 0.5) / parts);
        const int x = cell_of(p.x, kInverseSight), y = cell_of(p.y, kInverseSight);
        sight_.grow(x, y, x, y);
        Sight& cell = sight_.at(x, y);
        cell = std::max(cell, value > 0 ? Sight::wall : Sight::free);
        if (value < OccupancyGrid::kUnknown) continue;
        // Seen from where it is free: a wall one cell thin has two faces.
        for (const auto& [dx, dy] : faces_of(grid, column, row))
          points.push_back({p.x, p.y, static_cast<float>(c * dx - s * dy), static_cast<float>(s * dx + c * dy)});
      }
    }
  // A raster's wall cell stands for several hits, so that one cell is enough to be a wall.
  for (int i = 0; i < 3; ++i) field.add(points);
  // Nobody says where its maker stood: viewpoints are where there is room, the middle of the tile's free cells.
  double x = 0, y = 0;
  std::size_t count = 0;
  for (std::int32_t row = 0; row < grid.rows; ++row)
    for (std::int32_t column = 0; column < grid.columns; ++column)
      if (grid.at(column, row) < OccupancyGrid::kUnknown) {
        const Point2f p = place(column + 0.5, row + 0.5);
        x += p.x;
        y += p.y;
        ++count;
      }
  if (count > 0)
    path_.push_back({x / static_cast<double>(count), y / static_cast<double>(count), 0.0});
  else
    path_.push_back(submap_from_node);
}

void SubmapModel::look(const Submap& submap, const Table<NodeId, Node>& nodes, WallField& field) {
  Raster<Counts> counts;
  std::optional<Pose2> last;
  struct Scan {
    Pose2 eye;
    std::vector<WallPoint> points;
    bool shows_free_space;
  };
  std::vector<Scan> scans;
  Eigen::AlignedBox2d walls_box;
  for (const auto& [id, pose] : submap.submap_from_node) {
    const Node* node = nodes.find(id);
    MAPWEAVE_EXPECT(node != nullptr && node->payload != nullptr, "a frozen submap names nodes with payloads");
    const Pose2 submap_from_node = planar(pose);
    if (const auto* grid = std::get_if<OccupancyGrid>(node->payload.get())) {
      add_raster(*grid, submap_from_node, field);
      continue;
    }
    const auto* packed_scan = std::get_if<PackedScan>(node->payload.get());
    if (packed_scan == nullptr) continue;  // keyframes show no walls
    const PackedScan& scan = *packed_scan;
    path_.push_back(submap_from_node);
    auto points = placed(submap_from_node, wall_points(scan, 0.0, kFarthestWall_m));
    const Pose2 eye = compose(submap_from_node, planar(scan.geometry->robot_from_laser));
    const bool is_near_last = last &&
                              std::hypot(last->x - submap_from_node.x, last->y - submap_from_node.y) < kSightStep_m &&
                              std::abs(wrap_angle(last->phi - submap_from_node.phi)) < kSightStep_rad;
    if (!is_near_last) last = submap_from_node;
    for (const WallPoint& p : points) walls_box.extend(Eigen::Vector2d(p.x, p.y));
    scans.push_back({eye, std::move(points), !is_near_last});
  }
  if (!walls_box.isEmpty())
    field.reserve(walls_box.min().x(), walls_box.min().y(), walls_box.max().x(), walls_box.max().y());
  for (const Scan& scan : scans) {
    field.add(scan.points);
    if (scan.shows_free_space) see_through(scan.eye, scan.points, counts);
  }
  if (counts.empty()) {
    for (int y = sight_.first_y(); y < sight_.first_y() + sight_.height(); ++y)
      for (int x = sight_.first_x(); x < sight_.first_x() + sight_.width(); ++x)
        known_cells_ += sight_.at(x, y) != Sight::unknown;
    return;
  }
  sight_.grow(counts.first_x(), counts.first_y(), counts.first_x() + counts.width() - 1,
              counts.first_y() + counts.height() - 1);
  for (int y = counts.first_y(); y < counts.first_y() + counts.height(); ++y)
    for (int x = counts.first_x(); x < counts.first_x() + counts.width(); ++x) {
      const Counts& seen = counts.at(x, y);
      if (seen.hits + seen.passes == 0) continue;
      // A wall stops most rays, though those that graze it pass through its cells.
      sight_.at(x, y) = seen.hits > 0 && seen.hits * 3 >= seen.passes ? Sight::wall
                        : seen.passes >= 2                            ? Sight::free
                                                                      : Sight::unknown;
    }
  for (int y = sight_.first_y(); y < sight_.first_y() + sight_.height(); ++y)
    for (int x = sight_.first_x(); x < sight_.first_x() + sight_.width(); ++x)
      known_cells_ += sight_.at(x, y) != Sight::unknown;
}

void SubmapModel::find_walls(const WallField& field) {
  for (const auto& wall : field.walls(2.0F))
    if (sight_.get(cell_of(wall.x, kInverseSight), cell_of(wall.y, kInverseSight)) == Sight::wall)
      walls_.push_back(wall);
  const std::size_t count = std::min(kQueryPoints, walls_.size());
  for (std::size_t i = 0; i < count; ++i) {
    const auto& wall = walls_[i * walls_.size() / count];
    query_.push_back({wall.x, wall.y});
    centre_.x += wall.x / static_cast<float>(count);
    centre_.y += wall.y / static_cast<float>(count);
  }
  for (const auto& p : query_) radius_m_ = std::max(radius_m_, std::hypot(p.x - centre_.x, p.y - centre_.y));
}

void SubmapModel::build_pyramid() {
  const auto& fine = field_.likelihood();
  if (fine.empty()) return;
  const auto half = [](int v) { return v >= 0 ? v / 2 : (v - 1) / 2; };
  Raster<std::uint8_t> base(half(fine.first_x()) - 1, half(fine.first_y()) - 1,
                            half(fine.first_x() + fine.width() - 1) + 1, half(fine.first_y() + fine.height() - 1) + 1,
                            0);
  // Only walls that the rays confirm draw searches: what moved is no landmark.
  for (const auto& wall : walls_) {
    const int x = cell_of(wall.x, 1.0 / kSearchResolution), y = cell_of(wall.y, 1.0 / kSearchResolution);
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i) {
        if (!base.contains(x + i, y + j)) continue;
        auto& cell = base.at(x + i, y + j);
        cell = std::max(cell, static_cast<std::uint8_t>(i == 0 && j == 0 ? 255 : i == 0 || j == 0 ? 170 : 115));
      }
  }
  pyramid_[0] = SparseRaster<std::uint8_t>(base);
  Raster<std::uint8_t> below = std::move(base);
  for (std::size_t level = 1; level < pyramid_.size(); ++level) {
    const int x0 = (below.first_x() >> 2) - 2, y0 = (below.first_y() >> 2) - 2;
    const int x1 = (below.first_x() + below.width() - 1) >> 2, y1 = (below.first_y() + below.height() - 1) >> 2;
    Raster<std::uint8_t> plain(x0, y0, x1, y1, 0);
    // Cell i of level 1 bounds the cells 4i .. 4i + 7 of level 0; above that, of level k the cells 4i, 4i + 2 .. 4i + 6
    // of the level below, each of which bounds two blocks. Walls are few: each cell is written to the cells that bound
    // it.
    const int stride = level == 1 ? 1 : 2;
    for (int y = below.first_y() + (stride == 2 ? below.first_y() & 1 : 0); y < below.first_y() + below.height();
         y += stride)
      for (int x = below.first_x() + (stride == 2 ? below.first_x() & 1 : 0); x < below.first_x() + below.width();
           x += stride) {
        const std::uint8_t value = below.at(x, y);
        if (value == 0) continue;
        for (int j = (y >> 2) - 1; j <= y >> 2; ++j)
          for (int i = (x >> 2) - 1; i <= x >> 2; ++i) plain.at(i, j) = std::max(plain.at(i, j), value);
      }
    pyramid_[level] = SparseRaster<std::uint8_t>(plain);
    below = std::move(plain);
  }
}

RingKey SubmapModel::key_at(const Pose2& pose, double ring_m) const {
  RingKey key;
  key.centre = {static_cast<float>(pose.x), static_cast<float>(pose.y)};
  for (const auto& wall : walls_) {
    const int ring = static_cast<int>(std::hypot(wall.x - pose.x, wall.y - pose.y) / ring_m);
    if (ring < RingKey::kRings) key.walls[static_cast<std::size_t>(ring)] += 1.0F;
  }
  // Share of the ring's circumference that is wall, compressed: many rings see few walls, and those say most.
  for (int ring = 0; ring < RingKey::kRings; ++ring) {
    auto& value = key.walls[static_cast<std::size_t>(ring)];
    value = std::sqrt(value * static_cast<float>(WallField::kCellSide / (2.0 * M_PI * (ring + 0.5) * ring_m)));
  }
  return key;
}

void SubmapModel::describe() {
  std::optional<Pose2> last;
  for (const auto& pose : path_) {
    if (last && std::hypot(pose.x - last->x, pose.y - last->y) < kViewpointStep_m) continue;
    last = pose;
    ring_keys_.push_back(key_at(pose, RingKey::kRing_m));
    far_keys_.push_back(key_at(pose, RingKey::kFarRing_m));
  }
}

std::size_t SubmapModel::bytes() const {
  std::size_t sum = field_.bytes() + sight_.bytes() + walls_.capacity() * sizeof(WallPoint) +
                    query_.capacity() * sizeof(Point2f) +
                    (ring_keys_.capacity() + far_keys_.capacity()) * sizeof(RingKey) + path_.capacity() * sizeof(Pose2);
  for (const auto& level : pyramid_) sum += level.bytes();
  return sum;
}

double ring_distance(const std::vector<RingKey>& a, const std::vector<RingKey>& b) {
  double best = 1e300;
  for (const auto& one : a)
    for (const auto& other : b) {
      double sum = 0;
      for (std::size_t ring = 0; ring < one.walls.size(); ++ring) sum += std::abs(one.walls[ring] - other.walls[ring]);
      best = std::min(best, sum);
    }
  return best;
}

double ring_distance(const SubmapModel& a, const SubmapModel& b) { return ring_distance(a.ring_keys(), b.ring_keys()); }

}  // namespace mapweave::matching
