#include <mapweave/simulation/world.h>

#include <gtest/gtest.h>

#include <cmath>

namespace mapweave::simulation {
namespace {

FloorPlan apartment(const FurnitureOptions& furniture) {
  WorldOptions options;
  options.buildings.resize(1);
  options.buildings[0].seed = 4;
  options.buildings[0].furniture = furniture;
  options.robots.resize(1);
  options.robots[0].id = "alpha";
  options.robots[0].last_room = 1;
  WorkerPool here(1);
  return World(options, here).buildings()[0];
}

std::vector<Wall> of_the_building(const FloorPlan& plan) {
  std::vector<Wall> walls;
  for (const Wall& wall : plan.walls) {
    if (wall.piece < 0) walls.push_back(wall);
  }
  return walls;
}

TEST(Furniture, is_moved_between_sessions_while_walls_stay) {
  FurnitureOptions later;
  later.session = 2;
  later.changed = 0.5;
  const FloorPlan before = apartment({}), after = apartment(later);
  const auto old_walls = of_the_building(before), walls = of_the_building(after);
  ASSERT_EQ(walls.size(), old_walls.size());
  for (std::size_t i = 0; i < walls.size(); ++i) EXPECT_EQ(walls[i].from.x, old_walls[i].from.x);
  EXPECT_LT(after.pieces.size(), before.pieces.size());
  int same = 0, smaller = 0;
  for (const Piece& piece : after.pieces) {
    const auto old = std::find_if(before.pieces.begin(), before.pieces.end(), [&](const Piece& other) {
      return other.footprint.low_x <= piece.footprint.low_x && other.footprint.high_x >= piece.footprint.high_x &&
             other.footprint.low_y <= piece.footprint.low_y && other.footprint.high_y >= piece.footprint.high_y;
    });
    ASSERT_NE(old, before.pieces.end()) << "stands where nothing stood";
    const bool is_same = old->footprint.width() == piece.footprint.width();
    EXPECT_EQ(old->twin == piece.twin, is_same) << "what is new looks new, and the rest as it did";
    (is_same ? same : smaller) += 1;
  }
  EXPECT_GT(same, 3);
  EXPECT_GT(smaller, 3);
}

TEST(Furniture, is_round_where_asked_for) {
  FurnitureOptions round;
  round.round = 1.0;
  const FloorPlan plan = apartment(round);
  int cylinders = 0;
  for (const Wall& wall : plan.walls) {
    if (wall.piece < 0) continue;
    const Piece& piece = plan.pieces[static_cast<std::size_t>(wall.piece)];
    ASSERT_NE(piece.shape, PieceShape::box);
    if (piece.shape != PieceShape::cylinder) continue;
    ++cylinders;
    const double radius = 0.5 * std::min(piece.footprint.width(), piece.footprint.height());
    EXPECT_NEAR(std::hypot(wall.from.x - piece.footprint.centre().x, wall.from.y - piece.footprint.centre().y), radius,
                1e-9);
  }
  EXPECT_GT(cylinders, 12);
}

}  // namespace
}  // namespace mapweave::simulation
