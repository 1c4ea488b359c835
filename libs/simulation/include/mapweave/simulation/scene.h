#pragma once
// A floor plan as a camera sees it: flat surfaces with textures, which are painted once from a seed. World frame,
// metres, z up from the floor.

#include <mapweave/core/geometry.h>
#include <mapweave/core/worker_pool.h>
#include <mapweave/simulation/floor_plan.h>
#include <mapweave/simulation/texture.h>

#include <map>
#include <memory>
#include <vector>

namespace mapweave::simulation {

struct LookOptions {
  double ceiling_m = 2.6;
  double door_m = 2.05;
  double blank_walls = 0.12;
  double posters_per_10_m = 2.0;
  int contrast = 60;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("ceiling_m", ceiling_m, 2.2, 10.0,
             "height of rooms in metres; a texel of the walls is a 512th of it, so that larger values show coarser "
             "patterns");
    v.number("door_m", door_m, 1.5, 2.2, "height of open doors in metres");
    v.fraction("blank_walls", blank_walls,
               "share of walls, in pieces of up to 8 m, without any pattern; larger values give cameras less to see");
    v.number(
        "posters_per_10_m", posters_per_10_m, 0.0, 10.0,
        "number of posters on 10 metres of wall, where walls are not blank; larger values give cameras more to see");
    v.integer("contrast", contrast, 0, 120,
              "largest difference in grey levels between a pattern and what it lies on; larger values give cameras "
              "more to see");
  }
};

struct Colour {
  float red, green, blue;  // 0 to 1
};

// How a texture lies on a surface, between two colours. Texel coordinates of a point X: (u . X + first_u, v . X +
// first_v).
struct SurfaceTexture {
  int texture = 0;
  Eigen::Vector3d u, v;  // texels per metre
  double first_u = 0.0, first_v = 0.0;
  Colour dark{0.0f, 0.0f, 0.0f}, light{1.0f, 1.0f, 1.0f};
  bool has_detail = false;  // a fine pattern shows from near
};

// Convex and flat, seen from both sides.
struct Surface {
  std::vector<Eigen::Vector3d> corners;  // in order, at most kMostCorners; empty: the whole plane
  Eigen::Vector3d point, normal;         // of its plane; unit length
  SurfaceTexture look;
};
constexpr int kMostCorners = 12;

// Something upright and round that moves: a person, another robot.
struct Body {
  Pose2 world_from_body;
  double radius_m = 0.2, height_m = 1.7;
  int number = 0;  // looks like no other number's
};

// Immutable; may be used by many threads.
class Scene {
 public:
  Scene(const FloorPlan&, const LookOptions&, std::uint64_t seed, WorkerPool&);
  const std::vector<Surface>& surfaces() const { return surfaces_; }  // the first two are the floor and the ceiling
  const Texture& texture(int number) const { return textures_[static_cast<std::size_t>(number)]; }
  const Texture& detail() const { return textures_[kDetail]; }
  static constexpr double kDetailTexel = 0.001;  // metres
  std::vector<Surface> surfaces_of(const Body&) const;
  double ceiling_m() const { return ceiling_m_; }

 private:
  friend class SceneBuilder;
  static constexpr std::size_t kFloor = 0, kCeiling = 1, kDetail = 2, kFirstBody = 3, kBodies = 4;
  std::vector<Surface> surfaces_;
  std::vector<Texture> textures_;
  double ceiling_m_;
};

// Height of a piece of furniture, from its footprint and seed: the camera sees over low ones.
double height_of(const Piece&, std::size_t number, std::uint64_t seed);

}  // namespace mapweave::simulation
