#include "plan_parts.h"
#include "scene_painting.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>

namespace mapweave::simulation {
namespace {

using Eigen::Vector3d;

constexpr int kStripWidth = 8192, kStripHeight = 512;
constexpr double kLongestSpan = 8.0;                 // metres: longer walls are painted in pieces
constexpr double kPosterAway = 0.004;                // before the wall
constexpr double kSlabLow = 0.70, kSlabHigh = 0.74;  // of tables

Vector3d at_height(Point2 p, double z) { return {p.x, p.y, z}; }

Colour shaded(const Colour& c, double by) {
  const float f = static_cast<float>(by);
  return {c.red * f, c.green * f, c.blue * f};
}

std::vector<Point2> corners_of(const Box& box) {
  return {{box.low_x, box.low_y}, {box.high_x, box.low_y}, {box.high_x, box.high_y}, {box.low_x, box.high_y}};
}

// One lamp for all: surfaces of different directions differ, so that corners show where nothing is painted.
double brightness(const Vector3d& normal) {
  return 0.84 + 0.1 * std::abs(normal.x()) - 0.04 * std::abs(normal.y()) +
         (normal.z() < 0.0 ? 0.08 : -0.06) * std::abs(normal.z());
}

}  // namespace

double height_of(const Piece& piece, std::size_t number, std::uint64_t seed) {
  const std::size_t key = piece.twin >= 0 ? static_cast<std::size_t>(piece.twin) + (std::size_t{1} << 32) : number;
  RandomNumbers numbers = RandomStream(seed, "furniture height").at(key);
  switch (piece.shape) {
    case PieceShape::table: return kSlabHigh;
    case PieceShape::cylinder: return numbers.uniform(0.4, 1.2);
    case PieceShape::box: return numbers.chance(0.5) ? numbers.uniform(0.4, 0.9) : numbers.uniform(0.9, 2.0);
  }
  MAPWEAVE_EXPECT(false, "every shape has its height");
}

class SceneBuilder {
 public:
  SceneBuilder(Scene& scene, const FloorPlan& plan, const LookOptions& options, std::uint64_t seed)
      : scene_(scene), plan_(plan), options_(options), seed_(seed), texel_m_(options.ceiling_m / kStripHeight) {}

  void build(WorkerPool& pool) {
    add_planes();
    for (std::size_t i = 0; i < plan_.walls.size(); ++i) {
      if (plan_.walls[i].piece < 0) add_building_wall(plan_.walls[i], i);
    }
    for (const Box& lintel : plan_.lintels) add_lintel(lintel);
    for (std::size_t i = 0; i < plan_.pieces.size(); ++i) add_piece_surfaces(i);
    paint(pool);
  }

 private:
  // A place on the strips of wall pictures. Strips lie one after the other; each is kStripWidth texels long.
  struct Place {
    int strip;
    double left_m;
  };
  struct Job {
    Canvas::Area area;
    Pattern pattern;
    std::uint64_t key;
  };
  struct Painted {
    Place place;
    Colour dark, light;
    Pattern pattern;
  };

  static constexpr std::size_t kBefore = Scene::kFirstBody + Scene::kBodies;  // textures before the strips

  // What a twin (>= 0) got before, or a new place with its own picture.
  Painted painted(double length_m, Pattern wanted, std::int64_t twin) {
    if (twin >= 0) {
      const auto known = twins_.find(twin);
      if (known != twins_.end()) return known->second;
    }
    if (jobs_.empty() || next_m_ + length_m > kStripWidth * texel_m_) {
      jobs_.emplace_back();
      next_m_ = 0.0;
    }
    const std::uint64_t key = twin >= 0 ? static_cast<std::uint64_t>(twin) + (std::uint64_t{1} << 40) : next_key_++;
    RandomNumbers numbers = RandomStream(seed_, "look").at(key);
    const bool is_blank = wanted == Pattern::wall && numbers.chance(options_.blank_walls);
    const auto [dark, light] = colours(wanted == Pattern::furniture, numbers);
    const Painted result{
        {static_cast<int>(jobs_.size()) - 1, next_m_}, dark, light, is_blank ? Pattern::blank : wanted};
    jobs_.back().push_back({{next_m_, 0.0, length_m, options_.ceiling_m}, result.pattern, key});
    next_m_ += length_m + 4.0 * texel_m_;
    if (twin >= 0) twins_.emplace(twin, result);
    return result;
  }

  SurfaceTexture look_of(const Painted& painted, const Vector3d& origin, const Vector3d& right, const Vector3d& down,
                         const Vector3d& normal) const {
    SurfaceTexture look;
    look.texture = static_cast<int>(kBefore) + painted.place.strip;
    look.u = right / texel_m_;
    look.v = down / texel_m_;
    look.first_u = painted.place.left_m / texel_m_ - look.u.dot(origin);
    look.first_v = -look.v.dot(origin);
    look.dark = shaded(painted.dark, brightness(normal));
    look.light = shaded(painted.light, brightness(normal));
    look.has_detail = painted.pattern != Pattern::blank;
    return look;
  }

  void add_surface(std::vector<Vector3d> corners, const Vector3d& normal, const SurfaceTexture& look) {
    scene_.surfaces_.push_back({std::move(corners), {}, normal, look});
    Surface& surface = scene_.surfaces_.back();
    surface.point = surface.corners.front();
  }

  // Upright, between two heights; `along_m` into its picture.
  void add_upright(Point2 from, Point2 to, double low, double high, const Painted& painted, double along_m = 0.0) {
    const Vector3d right = (at_height(to, 0.0) - at_height(from, 0.0)).normalized(), normal(-right.y(), right.x(), 0.0);
    SurfaceTexture look = look_of(painted, at_height(from, options_.ceiling_m), right, {0.0, 0.0, -1.0}, normal);
    look.first_u += along_m / texel_m_;
    add_surface({at_height(from, low), at_height(to, low), at_height(to, high), at_height(from, high)}, normal, look);
  }

  void add_flat(const std::vector<Point2>& outline, double height, const Painted& painted, bool faces_up) {
    std::vector<Vector3d> corners;
    double low_x = outline.front().x, high_y = outline.front().y;
    for (const Point2 p : outline) {
      corners.push_back(at_height(p, height));
      low_x = std::min(low_x, p.x);
      high_y = std::max(high_y, p.y);
    }
    const Vector3d normal(0.0, 0.0, faces_up ? 1.0 : -1.0);
    add_surface(std::move(corners), normal,
                look_of(painted, {low_x, high_y, height}, {1.0, 0.0, 0.0}, {0.0, -1.0, 0.0}, normal));
  }

  void add_planes() {
    RandomNumbers numbers = RandomStream(seed_, "floor and ceiling").at(0);
    const double period = plan_.repeats_after_m > 0.0 ? plan_.repeats_after_m : kFloorPeriod;
    const Box box = bounds(plan_);
    for (const bool is_floor : {true, false}) {
      const double texel = is_floor ? period / kFloorTexels : kCeilingPeriod / kCeilingTexels;
      Surface plane;
      plane.point = Vector3d(0.0, 0.0, is_floor ? 0.0 : options_.ceiling_m);
      plane.normal = Vector3d(0.0, 0.0, is_floor ? 1.0 : -1.0);
      plane.look.texture = static_cast<int>(is_floor ? Scene::kFloor : Scene::kCeiling);
      plane.look.u = Vector3d(1.0 / texel, 0.0, 0.0);
      plane.look.v = Vector3d(0.0, -1.0 / texel, 0.0);
      plane.look.first_u = -box.low_x / texel;
      plane.look.first_v = box.low_y / texel;
      const auto [dark, light] = colours(false, numbers);
      plane.look.dark = shaded(dark, brightness(plane.normal));
      plane.look.light = shaded(light, brightness(plane.normal));
      plane.look.has_detail = is_floor;
      scene_.surfaces_.push_back(std::move(plane));
    }
  }

  void add_building_wall(const Wall& wall, std::size_t number) {
    const double length = std::hypot(wall.to.x - wall.from.x, wall.to.y - wall.from.y);
    if (length < 1e-6) return;
    const int spans = std::max(1, static_cast<int>(std::ceil(length / kLongestSpan)));
    const auto at = [&](double t) {
      return Point2{wall.from.x + t * (wall.to.x - wall.from.x), wall.from.y + t * (wall.to.y - wall.from.y)};
    };
    for (int span = 0; span < spans; ++span) {
      const Point2 from = at(static_cast<double>(span) / spans), to = at(static_cast<double>(span + 1) / spans);
      const std::int64_t twin = wall.twin >= 0 ? std::int64_t{wall.twin} * 64 + span : -1;
      const Painted painted_span = painted(length / spans, Pattern::wall, twin);
      add_upright(from, to, 0.0, options_.ceiling_m, painted_span);
      if (painted_span.pattern != Pattern::blank)
        add_posters(from, to, length / spans, twin, number * 64 + static_cast<std::size_t>(span));
    }
  }

  void add_posters(Point2 from, Point2 to, double length, std::int64_t twin, std::size_t number) {
    const std::uint64_t key = twin >= 0 ? static_cast<std::uint64_t>(twin) + (std::uint64_t{1} << 40) : number;
    RandomNumbers numbers = RandomStream(seed_, "posters").at(key);
    const Vector3d right = (at_height(to, 0.0) - at_height(from, 0.0)) / length, normal(-right.y(), right.x(), 0.0);
    const int slots = static_cast<int>(length / 1.2);
    for (int slot = 0; slot < slots; ++slot) {
      if (!numbers.chance(std::min(1.0, 0.12 * options_.posters_per_10_m))) continue;
      const double width = numbers.uniform(0.35, 1.0), height = numbers.uniform(0.35, 1.1);
      const double left = slot * 1.2 + numbers.uniform(0.05, 1.15 - width), top = numbers.uniform(1.5, 2.1);
      const auto [dark, light] = colours(true, numbers);
      SurfaceTexture look;
      if (twin >= 0) {
        const auto [known, is_new] = twin_posters_.emplace(twin * 64 + slot, posters_.size());
        look.texture = static_cast<int>(known->second);
        if (is_new) posters_.push_back(numbers.bits());
      } else {
        look.texture = static_cast<int>(posters_.size());
        posters_.push_back(numbers.bits());
      }
      look.u = right * (256.0 / width);
      look.v = Vector3d(0.0, 0.0, -256.0 / height);
      look.dark = shaded(dark, brightness(normal));
      look.light = shaded(light, brightness(normal));
      for (const double side : {1.0, -1.0}) {
        const Vector3d corner = at_height(from, top) + right * left + normal * (side * kPosterAway);
        const Vector3d across = right * width, down(0.0, 0.0, -height);
        look.first_u = -look.u.dot(corner);
        look.first_v = -look.v.dot(corner);
        poster_surfaces_.push_back(scene_.surfaces_.size());
        add_surface({corner, corner + across, corner + across + down, corner + down}, normal, look);
      }
    }
  }

  void add_lintel(const Box& box) {
    const std::vector<Point2> outline = corners_of(box);
    for (std::size_t i = 0; i < 4; ++i) {
      const Point2 from = outline[i], to = outline[(i + 1) % 4];
      const double length = std::hypot(to.x - from.x, to.y - from.y);
      if (length > 1e-6)
        add_upright(from, to, options_.door_m, options_.ceiling_m, painted(length, Pattern::blank, -1));
    }
    if (box.width() > 1e-6 && box.height() > 1e-6)
      add_flat(outline, options_.door_m, painted(box.width(), Pattern::blank, -1), false);
  }

  void add_piece_surfaces(std::size_t number) {
    const Piece& piece = plan_.pieces[number];
    const Box& box = piece.footprint;
    const double height = height_of(piece, number, seed_);
    const std::int64_t twins = piece.twin >= 0 ? (std::int64_t{1} << 32) + std::int64_t{piece.twin} * 64 : -1;
    const auto twin = [&](int part) { return twins >= 0 ? twins + part : -1; };
    const std::vector<Point2> corners = corners_of(box);
    if (piece.shape == PieceShape::cylinder) {
      std::vector<Point2> outline;
      for (const Wall& wall : plan_.walls) {
        if (wall.piece == static_cast<int>(number)) outline.push_back(wall.from);
      }
      const double side = std::hypot(outline[1].x - outline[0].x, outline[1].y - outline[0].y);
      const Painted around = painted(side * static_cast<double>(outline.size()), Pattern::furniture, twin(0));
      for (std::size_t i = 0; i < outline.size(); ++i)
        add_upright(outline[i], outline[(i + 1) % outline.size()], 0.0, height, around, static_cast<double>(i) * side);
      add_flat(outline, height, painted(box.width(), Pattern::furniture, twin(1)), true);
      return;
    }
    int part = 0;
    if (piece.shape == PieceShape::table) {
      for (const Wall& wall : plan_.walls) {
        if (wall.piece != static_cast<int>(number)) continue;
        add_upright(wall.from, wall.to, 0.0, kSlabLow, painted(0.1, Pattern::blank, twin(part++)));
      }
      add_flat(corners, kSlabLow, painted(box.width(), Pattern::furniture, twin(part++)), false);
    }
    for (std::size_t i = 0; i < 4; ++i) {
      const Point2 from = corners[i], to = corners[(i + 1) % 4];
      const double length = std::hypot(to.x - from.x, to.y - from.y);
      add_upright(from, to, piece.shape == PieceShape::table ? kSlabLow : 0.0, height,
                  painted(length, Pattern::furniture, twin(part++)));
    }
    add_flat(corners, height, painted(box.width(), Pattern::furniture, twin(part++)), true);
  }

  void paint(WorkerPool& pool) {
    const RandomStream numbers(seed_, "pictures");
    const double period = plan_.repeats_after_m > 0.0 ? plan_.repeats_after_m : kFloorPeriod;
    const std::size_t strips = jobs_.size();
    scene_.textures_ = pool.map(kBefore + strips + posters_.size(), [&](std::size_t i) {
      if (i == Scene::kFloor) return floor_texture(period, options_.contrast, numbers.at(i));
      if (i == Scene::kCeiling) return ceiling_texture(options_.contrast, numbers.at(i));
      if (i == Scene::kDetail) return detail_texture(numbers.at(i));
      if (i < kBefore) return body_texture(numbers.at(i));
      if (i < kBefore + strips) {
        Canvas canvas(kStripWidth, kStripHeight, texel_m_);
        const RandomStream walls(seed_, "wall picture");
        for (const Job& job : jobs_[i - kBefore])
          paint_wall(canvas, job.area, job.pattern, options_.contrast, walls.at(job.key));
        return Texture(kStripWidth, kStripHeight, canvas.take());
      }
      return poster_texture(RandomStream(posters_[i - kBefore - strips], "poster").at(0));
    });
    for (const std::size_t i : poster_surfaces_) scene_.surfaces_[i].look.texture += static_cast<int>(kBefore + strips);
  }

  Scene& scene_;
  const FloorPlan& plan_;
  const LookOptions& options_;
  std::uint64_t seed_, next_key_ = 0;
  double texel_m_, next_m_ = 0.0;
  std::vector<std::vector<Job>> jobs_;  // of each strip
  std::map<std::int64_t, Painted> twins_;
  std::map<std::int64_t, std::size_t> twin_posters_;
  std::vector<std::uint64_t> posters_;  // seeds
  std::vector<std::size_t> poster_surfaces_;
};

Scene::Scene(const FloorPlan& plan, const LookOptions& options, std::uint64_t seed, WorkerPool& pool)
    : ceiling_m_(options.ceiling_m) {
  SceneBuilder(*this, plan, options, seed).build(pool);
}

std::vector<Surface> Scene::surfaces_of(const Body& body) const {
  constexpr int kSides = 8;
  std::vector<Surface> surfaces;
  const auto corner = [&](int i, double z) {
    const double angle = body.world_from_body.phi + 2.0 * M_PI * i / kSides;
    return Vector3d(body.world_from_body.x + body.radius_m * std::cos(angle),
                    body.world_from_body.y + body.radius_m * std::sin(angle), z);
  };
  RandomNumbers numbers = RandomStream(0, "body").at(static_cast<std::uint64_t>(body.number));
  const auto [dark, light] = colours(true, numbers);
  const int texture = static_cast<int>(kFirstBody) + numbers.integer(0, static_cast<int>(kBodies) - 1);
  const auto add = [&](std::vector<Vector3d> corners, const Vector3d& normal, const Vector3d& u, const Vector3d& v,
                       double first_u) {
    SurfaceTexture look;
    look.texture = texture;
    look.u = u;
    look.v = v;
    look.first_u = first_u - u.dot(corners.front());
    look.first_v = -v.dot(corners.front());
    look.dark = shaded(dark, brightness(normal));
    look.light = shaded(light, brightness(normal));
    const Vector3d point = corners.front();
    surfaces.push_back({std::move(corners), point, normal, look});
  };
  std::vector<Vector3d> top;
  for (int i = 0; i < kSides; ++i) {
    const Vector3d from = corner(i, body.height_m), to = corner(i + 1, body.height_m), down(0.0, 0.0, -body.height_m);
    const Vector3d right = (to - from).normalized(), normal(right.y(), -right.x(), 0.0);
    add({from, to, to + down, from + down}, normal, right * (256.0 / kSides / (to - from).norm()),
        {0.0, 0.0, -256.0 / body.height_m}, 256.0 / kSides * i);
    top.push_back(from);
  }
  add(std::move(top), {0.0, 0.0, 1.0}, {200.0, 0.0, 0.0}, {0.0, -200.0, 0.0}, 0.0);
  return surfaces;
}

}  // namespace mapweave::simulation
