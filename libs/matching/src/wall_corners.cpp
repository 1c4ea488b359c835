#include <mapweave/matching/corner_proposals.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>

namespace mapweave::matching {
namespace {

constexpr double kReach_m = 0.6;   // of the walls that make a corner
constexpr double kOneWall = 0.94;  // cosine of 20 degrees: normals of one wall
constexpr double kLeastOpening_rad = M_PI / 3.0, kMostOpening_rad = 2.0 * M_PI / 3.0;
constexpr std::size_t kFewestFaces = 4;  // of each wall
constexpr double kNearFace_m = 0.35;     // a corner lies at the faces that tell of it
constexpr double kOneCorner_m = 0.4;
constexpr double kLeastBehind_m = 0.08;  // how far a wall's middle lies aside of the other wall

using Cell = std::pair<int, int>;
using FaceCells = std::map<Cell, std::vector<std::size_t>>;

Cell cell_of_face(const WallPoint& face) {
  return {static_cast<int>(std::floor(face.x / kReach_m)), static_cast<int>(std::floor(face.y / kReach_m))};
}

// Faces of one wall, near a place.
struct Side {
  std::vector<const WallPoint*> faces;
  double x = 0.0, y = 0.0, normal_x = 0.0, normal_y = 0.0;  // means; the normal has unit length

  void finish() {
    for (const WallPoint* face : faces) {
      x += face->x;
      y += face->y;
      normal_x += face->normal_x;
      normal_y += face->normal_y;
    }
    x /= static_cast<double>(faces.size());
    y /= static_cast<double>(faces.size());
    const double length = std::hypot(normal_x, normal_y);
    normal_x /= length;
    normal_y /= length;
  }
};

struct FoundCorner {
  WallCorner corner;
  std::size_t faces = 0;  // of its shorter wall
};

std::optional<FoundCorner> corner_at(const WallPoint& face, const std::vector<const WallPoint*>& near) {
  Side own, left, right;
  for (const WallPoint* other : near) {
    const double cosine = face.normal_x * other->normal_x + face.normal_y * other->normal_y;
    const double sine = face.normal_x * other->normal_y - face.normal_y * other->normal_x;
    if (cosine > kOneWall)
      own.faces.push_back(other);
    else if (std::abs(cosine) < 0.5)
      (sine > 0.0 ? left : right).faces.push_back(other);
  }
  Side& across = left.faces.size() >= right.faces.size() ? left : right;
  if (std::min(own.faces.size(), across.faces.size()) < kFewestFaces) return std::nullopt;
  own.finish();
  across.finish();
  const double opening =
      std::acos(std::clamp(own.normal_x * across.normal_x + own.normal_y * across.normal_y, -1.0, 1.0));
  if (opening < kLeastOpening_rad || opening > kMostOpening_rad) return std::nullopt;
  // Where the two lines meet.
  const double own_at = own.normal_x * own.x + own.normal_y * own.y,
               across_at = across.normal_x * across.x + across.normal_y * across.y;
  const double determinant = own.normal_x * across.normal_y - own.normal_y * across.normal_x;
  const double x = (own_at * across.normal_y - across_at * own.normal_y) / determinant,
               y = (own.normal_x * across_at - across.normal_x * own_at) / determinant;
  if (std::hypot(x - face.x, y - face.y) > kNearFace_m) return std::nullopt;
  // On which side of the other wall each one goes on.
  const double own_side = across.normal_x * (own.x - x) + across.normal_y * (own.y - y),
               across_side = own.normal_x * (across.x - x) + own.normal_y * (across.y - y);
  if (std::min(std::abs(own_side), std::abs(across_side)) < kLeastBehind_m || own_side * across_side < 0.0)
    return std::nullopt;
  FoundCorner found;
  found.corner = {{static_cast<float>(x), static_cast<float>(y)},
                  std::atan2(own.normal_y + across.normal_y, own.normal_x + across.normal_x),
                  opening,
                  own_side < 0.0};
  found.faces = std::min(own.faces.size(), across.faces.size());
  return found;
}

}  // namespace

std::vector<WallCorner> corners_of(const GridWalls& walls, std::size_t most) {
  FaceCells cells;
  for (std::size_t i = 0; i < walls.faces.size(); ++i) cells[cell_of_face(walls.faces[i])].push_back(i);
  std::vector<FoundCorner> found;
  std::vector<const WallPoint*> near;
  for (const WallPoint& face : walls.faces) {
    near.clear();
    const auto [column, row] = cell_of_face(face);
    for (int x = column - 1; x <= column + 1; ++x)
      for (int y = row - 1; y <= row + 1; ++y)
        if (const auto cell = cells.find({x, y}); cell != cells.end())
          for (const std::size_t i : cell->second)
            if (std::hypot(walls.faces[i].x - face.x, walls.faces[i].y - face.y) < kReach_m)
              near.push_back(&walls.faces[i]);
    if (const auto corner = corner_at(face, near)) found.push_back(*corner);
  }
  // The same order however the walls came.
  std::sort(found.begin(), found.end(), [](const FoundCorner& l, const FoundCorner& r) {
    return std::make_tuple(r.faces, l.corner.at.x, l.corner.at.y, l.corner.direction_rad) <
           std::make_tuple(l.faces, r.corner.at.x, r.corner.at.y, r.corner.direction_rad);
  });
  std::vector<WallCorner> distinct;
  for (const FoundCorner& candidate : found) {
    if (distinct.size() == most) break;
    const WallCorner& corner = candidate.corner;
    if (std::none_of(distinct.begin(), distinct.end(), [&](const WallCorner& other) {
          return std::hypot(other.at.x - corner.at.x, other.at.y - corner.at.y) < kOneCorner_m &&
                 std::abs(wrap_angle(other.direction_rad - corner.direction_rad)) < M_PI / 4.0;
        }))
      distinct.push_back(corner);
  }
  return distinct;
}

}  // namespace mapweave::matching
