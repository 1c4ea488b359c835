#include "plan_parts.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace mapweave::simulation {
namespace {

constexpr double kClosedDoorWidth = 0.9, kClosedDoorDepth = 0.25;
constexpr double kPassage = 1.1;  // stays free between things that stand against opposite walls, metres
constexpr double kRowWallThickness = 0.12;

std::vector<Side> oriented_sides(const Box& box, double inward) {
  return {{{box.low_x, box.low_y}, {1, 0}, {0, inward}, box.width(), {}},
          {{box.high_x, box.low_y}, {0, 1}, {-inward, 0}, box.height(), {}},
          {{box.high_x, box.high_y}, {-1, 0}, {0, -inward}, box.width(), {}},
          {{box.low_x, box.high_y}, {0, -1}, {inward, 0}, box.height(), {}}};
}

// A place of this length on one of the sides, chosen evenly along them, or none after some tries.
struct Place {
  Side* side;
  Interval interval;
};
std::optional<Place> take_place(std::vector<Side>& sides, double length_m, double margin_m, RandomNumbers& numbers) {
  double total = 0.0;
  for (const Side& side : sides) total += side.length_m;
  for (int attempt = 0; attempt < 30; ++attempt) {
    double position = numbers.uniform(0.0, total);
    auto side = sides.begin();
    while (std::next(side) != sides.end() && position > side->length_m) position -= (side++)->length_m;
    const Interval wanted{position, position + length_m},
        with_margin{position - margin_m, position + length_m + margin_m};
    if (with_margin.from < 0.0 || with_margin.to > side->length_m) continue;
    if (std::any_of(side->taken.begin(), side->taken.end(),
                    [&](const Interval& other) { return other.overlaps(with_margin); }))
      continue;
    side->taken.push_back(wanted);
    return Place{&*side, wanted};
  }
  return std::nullopt;
}

void add_stretches(FloorPlan& plan, const Box& along, int count, const std::string& name) {
  const bool is_flat = along.width() >= along.height();
  for (int i = 0; i < count; ++i) {
    const double from = static_cast<double>(i) / count, to = static_cast<double>(i + 1) / count;
    Box inside = along;
    (is_flat ? inside.low_x : inside.low_y) += from * (is_flat ? along.width() : along.height());
    (is_flat ? inside.high_x : inside.high_y) =
        is_flat ? along.low_x + to * along.width() : along.low_y + to * along.height();
    plan.rooms.push_back({name + " " + std::to_string(plan.rooms.size()), inside});
  }
}

int stretches_of(double length_m) { return std::max(2, static_cast<int>(std::lround(length_m / 2.0))); }

FloorPlan row_of_rooms(const RoomRowOptions& options, std::uint64_t seed, bool is_mirrored) {
  RandomNumbers numbers = RandomStream(seed, "row of rooms").at(0);
  const double half = 0.5 * kRowWallThickness;
  const Box inside{half, half, options.room_width_m - half, options.room_depth_m - half};
  if (options.door_width_m + 0.3 > inside.width()) {
    throw Error(ErrorCode::kBadInput, "rooms are narrower than their doors", "room_width_m",
                "make room_width_m greater or door_width_m smaller");
  }
  const double door = numbers.uniform(inside.low_x + 0.15, inside.high_x - 0.15 - options.door_width_m);
  FloorPlan room;  // the first room, as if its corner stood at the origin
  add_line(room, {inside.low_x, inside.low_y}, {door, inside.low_y});
  add_line(room, {door + options.door_width_m, inside.low_y}, {inside.high_x, inside.low_y});
  add_line(room, {inside.high_x, inside.low_y}, {inside.high_x, inside.high_y});
  add_line(room, {inside.high_x, inside.high_y}, {inside.low_x, inside.high_y});
  add_line(room, {inside.low_x, inside.high_y}, {inside.low_x, inside.low_y});
  add_line(room, {0.0, -half}, {door, -half});
  add_line(room, {door, -half}, {door, half});
  add_line(room, {door + options.door_width_m, half}, {door + options.door_width_m, -half});
  add_line(room, {door + options.door_width_m, -half}, {options.room_width_m, -half});
  add_furniture(room, inside, {{door - 0.1, inside.low_y, door + options.door_width_m + 0.1, inside.low_y + kPassage}},
                options.furniture, numbers);

  room.lintels.push_back({door, -half, door + options.door_width_m, half});

  FloorPlan plan;
  plan.repeats_after_m = options.room_width_m;
  const double length = options.rooms * options.room_width_m, corridor_top = options.corridor_width_m + half;
  for (int i = 0; i < options.rooms; ++i) {
    const double x = i * options.room_width_m;
    const bool is_image = is_mirrored && i % 2 == 1;
    const int first_piece = static_cast<int>(plan.pieces.size());
    const auto placed = [&](Point2 p) {
      return Point2{x + (is_image ? options.room_width_m - p.x : p.x), corridor_top + p.y};
    };
    for (const Wall& wall : room.walls) {
      plan.walls.push_back({placed(wall.from), placed(wall.to), wall.piece < 0 ? -1 : first_piece + wall.piece,
                            static_cast<int>(&wall - room.walls.data())});
    }
    const auto placed_box = [&](const Box& box) {
      return box_of(placed({box.low_x, box.low_y}), placed({box.high_x, box.high_y}));
    };
    for (const Piece& piece : room.pieces)
      plan.pieces.push_back({placed_box(piece.footprint), piece.shape, static_cast<int>(&piece - room.pieces.data())});
    for (const Box& lintel : room.lintels) plan.lintels.push_back(placed_box(lintel));
    plan.rooms.push_back({"room " + std::to_string(i),
                          box_of(placed({inside.low_x, inside.low_y}), placed({inside.high_x, inside.high_y}))});
  }
  add_line(plan, {0.0, 0.0}, {length, 0.0});
  add_line(plan, {0.0, 0.0}, {0.0, options.corridor_width_m});
  add_line(plan, {length, 0.0}, {length, options.corridor_width_m});
  std::vector<Side> outer{{{0.0, 0.0}, {1, 0}, {0, 1}, length, {}}};
  add_clutter(plan, outer, options.clutter, options.corridor_width_m - kPassage, numbers);
  return plan;
}

}  // namespace

Box bounds(const FloorPlan& plan) {
  MAPWEAVE_EXPECT(!plan.walls.empty(), "a plan has walls");
  const Point2 any = plan.walls.front().from;
  Box box{any.x, any.y, any.x, any.y};
  for (const Wall& wall : plan.walls) {
    for (const Point2 p : {wall.from, wall.to}) {
      box = {std::min(box.low_x, p.x), std::min(box.low_y, p.y), std::max(box.high_x, p.x), std::max(box.high_y, p.y)};
    }
  }
  return box;
}

FloorPlan moved(FloorPlan plan, double x_m, double y_m) {
  for (Wall& wall : plan.walls) {
    for (Point2* p : {&wall.from, &wall.to}) *p = {p->x + x_m, p->y + y_m};
  }
  const auto moved_box = [&](const Box& box) {
    return Box{box.low_x + x_m, box.low_y + y_m, box.high_x + x_m, box.high_y + y_m};
  };
  for (Room& room : plan.rooms) {
    room.inside = moved_box(room.inside);
  }
  for (Piece& piece : plan.pieces) piece.footprint = moved_box(piece.footprint);
  for (Box& lintel : plan.lintels) lintel = moved_box(lintel);
  return plan;
}

double distance_to_wall(const Wall& wall, Point2 p) {
  const double dx = wall.to.x - wall.from.x, dy = wall.to.y - wall.from.y, square = dx * dx + dy * dy;
  const double along = square > 0.0 ? ((p.x - wall.from.x) * dx + (p.y - wall.from.y) * dy) / square : 0.0;
  const double t = std::clamp(along, 0.0, 1.0);
  return std::hypot(p.x - wall.from.x - t * dx, p.y - wall.from.y - t * dy);
}

std::vector<Side> sides_seen_from_inside(const Box& box) { return oriented_sides(box, 1.0); }
std::vector<Side> sides_seen_from_outside(const Box& box) { return oriented_sides(box, -1.0); }

void add_line(FloorPlan& plan, Point2 from, Point2 to) { plan.walls.push_back({from, to}); }

void add_box(FloorPlan& plan, const Box& box) {
  for (const Side& side : sides_seen_from_outside(box)) add_line(plan, side.from, side.at(side.length_m, 0.0));
}

void add_piece(FloorPlan& plan, const Piece& piece) {
  constexpr double kLeg = 0.06;
  const Box& box = piece.footprint;
  const std::size_t first = plan.walls.size();
  switch (piece.shape) {
    case PieceShape::box: add_box(plan, box); break;
    case PieceShape::table:
      for (const Point2 corner : {Point2{box.low_x, box.low_y}, Point2{box.high_x - kLeg, box.low_y},
                                  Point2{box.high_x - kLeg, box.high_y - kLeg}, Point2{box.low_x, box.high_y - kLeg}}) {
        add_box(plan, {corner.x, corner.y, corner.x + kLeg, corner.y + kLeg});
      }
      break;
    case PieceShape::cylinder: {
      const double radius = 0.5 * std::min(box.width(), box.height());
      const auto at = [&](int corner) {
        const double angle = 2.0 * M_PI * corner / kCylinderSides;
        return Point2{box.centre().x + radius * std::cos(angle), box.centre().y + radius * std::sin(angle)};
      };
      for (int corner = 0; corner < kCylinderSides; ++corner) add_line(plan, at(corner), at(corner + 1));
      break;
    }
  }
  for (std::size_t i = first; i < plan.walls.size(); ++i) plan.walls[i].piece = static_cast<int>(plan.pieces.size());
  plan.pieces.push_back(piece);
}

Box box_of(Point2 a, Point2 b) {
  return {std::min(a.x, b.x), std::min(a.y, b.y), std::max(a.x, b.x), std::max(a.y, b.y)};
}

void add_wall(FloorPlan& plan, Point2 from, Point2 to, double thickness_m, const std::vector<Interval>& openings) {
  const double length = std::hypot(to.x - from.x, to.y - from.y);
  const Point2 along{(to.x - from.x) / length, (to.y - from.y) / length};
  const Side middle{from, along, {-along.y, along.x}, length, {}};
  const auto add_stretch = [&](double start, double end) {
    if (end - start < 1e-9) return;
    if (thickness_m > 0.0) {
      add_box(plan, box_of(middle.at(start, -0.5 * thickness_m), middle.at(end, 0.5 * thickness_m)));
    } else {
      add_line(plan, middle.at(start, 0.0), middle.at(end, 0.0));
    }
  };
  double done = 0.0;
  for (const Interval& opening : openings) {
    add_stretch(done, opening.from);
    plan.lintels.push_back(
        box_of(middle.at(opening.from, -0.5 * thickness_m), middle.at(opening.to, 0.5 * thickness_m)));
    done = opening.to;
  }
  add_stretch(done, length);
}

void add_sides_with_closed_doors(FloorPlan& plan, std::vector<Side>& sides, int doors, RandomNumbers& numbers) {
  for (int i = 0; i < doors; ++i) {
    if (!take_place(sides, kClosedDoorWidth, 0.2, numbers)) break;
  }
  for (Side& side : sides) {
    std::sort(side.taken.begin(), side.taken.end(),
              [](const Interval& a, const Interval& b) { return a.from < b.from; });
    double done = 0.0;
    for (const Interval& door : side.taken) {
      add_line(plan, side.at(done, 0.0), side.at(door.from, 0.0));
      add_line(plan, side.at(door.from, 0.0), side.at(door.from, -kClosedDoorDepth));
      add_line(plan, side.at(door.from, -kClosedDoorDepth), side.at(door.to, -kClosedDoorDepth));
      add_line(plan, side.at(door.to, -kClosedDoorDepth), side.at(door.to, 0.0));
      done = door.to;
    }
    add_line(plan, side.at(done, 0.0), side.at(side.length_m, 0.0));
  }
}

void add_clutter(FloorPlan& plan, std::vector<Side>& sides, int boxes, double depth_m, RandomNumbers& numbers) {
  const double greatest_depth = std::min(depth_m, 0.5);
  if (greatest_depth < 0.1) return;
  for (int i = 0; i < boxes; ++i) {
    const auto place = take_place(sides, numbers.uniform(0.2, 1.2), 0.05, numbers);
    if (!place) continue;
    add_piece(plan, {box_of(place->side->at(place->interval.from, 0.0),
                            place->side->at(place->interval.to, numbers.uniform(0.1, greatest_depth)))});
  }
}

void add_furniture(FloorPlan& plan, const Box& room, const std::vector<Box>& keep_free, int pieces_at_most,
                   RandomNumbers& numbers) {
  const double greatest_depth = std::min(0.8, 0.5 * (std::min(room.width(), room.height()) - kPassage));
  if (greatest_depth < 0.2 || pieces_at_most == 0) return;
  std::vector<Side> sides = sides_seen_from_inside(room);
  std::vector<Box> occupied = keep_free;
  const int pieces = numbers.integer((pieces_at_most + 1) / 2, pieces_at_most);
  for (int i = 0; i < pieces; ++i) {
    const double length = numbers.uniform(0.4, 1.8), depth = numbers.uniform(0.2, greatest_depth);
    const bool has_legs = numbers.chance(0.25);
    const auto place = take_place(sides, length, 0.0, numbers);
    if (!place) continue;
    const Box piece = box_of(place->side->at(place->interval.from, 0.0), place->side->at(place->interval.to, depth));
    if (std::any_of(occupied.begin(), occupied.end(), [&](const Box& other) { return other.overlaps(piece); }))
      continue;
    occupied.push_back(piece);
    add_piece(plan, {piece, has_legs ? PieceShape::table : PieceShape::box});
  }
}

FloorPlan make_corridor_plan(const CorridorOptions& options, std::uint64_t seed) {
  RandomNumbers numbers = RandomStream(seed, "corridor").at(0);
  FloorPlan plan;
  const Box inside{0.0, 0.0, options.length_m, options.width_m};
  std::vector<Side> sides = sides_seen_from_inside(inside);
  for (const std::size_t end : {1u, 3u}) add_line(plan, sides[end].from, sides[end].at(sides[end].length_m, 0.0));
  std::vector<Side> long_sides{sides[0], sides[2]};
  add_sides_with_closed_doors(plan, long_sides, options.doors, numbers);
  add_clutter(plan, long_sides, options.clutter, 0.5 * (options.width_m - kPassage), numbers);
  add_stretches(plan, inside, stretches_of(options.length_m), "stretch");
  return plan;
}

FloorPlan make_repeated_rooms_plan(const RoomRowOptions& options, std::uint64_t seed) {
  return row_of_rooms(options, seed, false);
}
FloorPlan make_mirrored_rooms_plan(const RoomRowOptions& options, std::uint64_t seed) {
  return row_of_rooms(options, seed, true);
}

FloorPlan make_hall_plan(const HallOptions& options, std::uint64_t seed) {
  RandomNumbers numbers = RandomStream(seed, "hall").at(0);
  FloorPlan plan;
  std::vector<Side> sides = sides_seen_from_inside({0.0, 0.0, options.width_m, options.height_m});
  add_sides_with_closed_doors(plan, sides, 0, numbers);
  add_clutter(plan, sides, options.clutter, 0.5, numbers);
  const int columns = std::max(1, static_cast<int>(std::lround(options.width_m / 5.0))),
            rows = std::max(1, static_cast<int>(std::lround(options.height_m / 5.0)));
  const double width = options.width_m / columns, height = options.height_m / rows;
  std::vector<Box> occupied;
  for (int row = 0; row < rows; ++row) {
    for (int i = 0; i < columns; ++i) {
      const int column = row % 2 == 0 ? i : columns - 1 - i;
      const Box inside{column * width, row * height, (column + 1) * width, (row + 1) * height};
      plan.rooms.push_back({"place " + std::to_string(plan.rooms.size()), inside});
      const Point2 middle = inside.centre();
      occupied.push_back({middle.x - 0.6, middle.y - 0.6, middle.x + 0.6, middle.y + 0.6});
    }
  }
  for (int i = 0; i < options.pillars; ++i) {
    for (int attempt = 0; attempt < 30; ++attempt) {
      const double size = numbers.uniform(0.3, 0.8);
      const Point2 corner{numbers.uniform(0.0, options.width_m), numbers.uniform(0.0, options.height_m)};
      const Box pillar{corner.x, corner.y, corner.x + size, corner.y + size};
      const Box with_passage{corner.x - kPassage, corner.y - kPassage, pillar.high_x + kPassage,
                             pillar.high_y + kPassage};
      if (with_passage.low_x < 0.5 || with_passage.low_y < 0.5 || with_passage.high_x > options.width_m - 0.5 ||
          with_passage.high_y > options.height_m - 0.5)
        continue;
      if (std::any_of(occupied.begin(), occupied.end(), [&](const Box& other) { return other.overlaps(pillar); }))
        continue;
      occupied.push_back(with_passage);
      add_box(plan, pillar);
      break;
    }
  }
  return plan;
}

FloorPlan make_warehouse_plan(const WarehouseOptions& options, std::uint64_t seed) {
  constexpr double kPallet = 0.8;
  FloorPlan plan;
  const double pitch = options.aisle_m + options.rack_m, width = options.aisles * pitch - options.rack_m,
               racks_begin = options.crossing_m, racks_end = racks_begin + options.length_m,
               height = racks_end + options.crossing_m;
  for (const Side& side : sides_seen_from_inside({0.0, 0.0, width, height}))
    add_line(plan, side.from, side.at(side.length_m, 0.0));
  for (int i = 0; i + 1 < options.aisles; ++i)
    add_box(plan, {i * pitch + options.aisle_m, racks_begin, (i + 1) * pitch, racks_end});
  for (int i = 0; i < options.aisles; ++i) {
    const Box low{i * pitch, 0.0, i * pitch + options.aisle_m, racks_begin},
        high{low.low_x, racks_end, low.high_x, height};
    for (const Box& end : {i % 2 == 0 ? low : high, i % 2 == 0 ? high : low})
      plan.rooms.push_back({"end " + std::to_string(plan.rooms.size()), end});
  }
  RandomNumbers numbers = RandomStream(seed, "warehouse").at(0);
  for (int i = 0; i < options.pallets; ++i) {
    const double aisle = pitch * numbers.integer(0, options.aisles - 1),
                 deep = numbers.uniform(0.1, std::min(0.4, 0.5 * options.aisle_m - 0.45)),
                 low_y = numbers.uniform(racks_begin, racks_end - kPallet);
    const double low_x = numbers.chance(0.5) ? aisle : aisle + options.aisle_m - deep;
    add_box(plan, {low_x, low_y, low_x + deep, low_y + kPallet});
  }
  return plan;
}

FloorPlan make_ring_plan(const RingOptions& options, std::uint64_t seed) {
  const double width = options.corridor_width_m;
  if (std::min(options.width_m, options.height_m) < 2.0 * width + 0.5) {
    throw Error(ErrorCode::kBadInput, "the corridors leave nothing between them", "ring",
                "make corridor_width_m smaller or width_m and height_m greater");
  }
  RandomNumbers numbers = RandomStream(seed, "ring").at(0);
  FloorPlan plan;
  const Box outer{0.0, 0.0, options.width_m, options.height_m},
      inner{width, width, options.width_m - width, options.height_m - width};
  std::vector<Side> sides = sides_seen_from_inside(outer);
  add_sides_with_closed_doors(plan, sides, options.doors, numbers);
  add_box(plan, inner);
  for (const Side& side : sides_seen_from_outside(inner)) sides.push_back(side);
  add_clutter(plan, sides, options.clutter, 0.5 * (width - kPassage), numbers);

  const auto add_arm = [&](const Box& arm, bool is_backwards) {  // counter-clockwise, each corner once
    FloorPlan stretches;
    add_stretches(stretches, arm, stretches_of(std::max(arm.width(), arm.height())), "stretch");
    if (is_backwards) std::reverse(stretches.rooms.begin(), stretches.rooms.end());
    for (const Room& room : stretches.rooms)
      plan.rooms.push_back({"stretch " + std::to_string(plan.rooms.size()), room.inside});
  };
  add_arm({0.0, 0.0, inner.high_x, width}, false);
  add_arm({inner.high_x, 0.0, outer.high_x, inner.high_y}, false);
  add_arm({width, inner.high_y, outer.high_x, outer.high_y}, true);
  add_arm({0.0, width, width, outer.high_y}, true);
  return plan;
}

}  // namespace mapweave::simulation
