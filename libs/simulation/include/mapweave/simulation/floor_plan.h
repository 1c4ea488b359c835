#pragma once
// Buildings seen from above. A plan is made from options and a seed, and is content: nothing moves in it.

#include <mapweave/core/geometry.h>

#include <cstdint>
#include <string>
#include <vector>

namespace mapweave::simulation {

struct Point2 {
  double x = 0.0, y = 0.0;  // metres, world frame
};

// One straight piece of a vertical surface, seen from both sides.
struct Wall {
  Point2 from, to;
  int piece = -1;  // the piece of furniture whose outline it belongs to; -1: the building, from floor to ceiling
  int twin = -1;   // walls with the same number look the same; -1: like no other
  double low_m = -1e9, high_m = 1e9;  // for lines of sight; lasers look at all walls
};

struct Box {
  double low_x = 0.0, low_y = 0.0, high_x = 0.0, high_y = 0.0;  // metres
  Point2 centre() const { return {0.5 * (low_x + high_x), 0.5 * (low_y + high_y)}; }
  double width() const { return high_x - low_x; }
  double height() const { return high_y - low_y; }
  bool overlaps(const Box& other) const {
    return low_x < other.high_x && other.low_x < high_x && low_y < other.high_y && other.low_y < high_y;
  }
  bool contains(Point2 p) const { return low_x <= p.x && p.x <= high_x && low_y <= p.y && p.y <= high_y; }
};

// A place that a tour visits: a room, or a stretch of a corridor or hall. Its middle is free of furniture.
struct Room {
  std::string name;
  Box inside;
};

enum class PieceShape { box, table, cylinder };  // a table stands on four legs

// Furniture, seen from above.
struct Piece {
  Box footprint;
  PieceShape shape = PieceShape::box;
  int twin = -1;  // as a wall's
};

struct FloorPlan {
  std::vector<Wall> walls{};     // and the outlines of furniture
  std::vector<Room> rooms{};     // neighbours follow one another
  std::vector<Piece> pieces{};   // furniture
  std::vector<Box> lintels{};    // walls above open doors
  double repeats_after_m = 0.0;  // along x, where rooms are shifted copies of each other
};
Box bounds(const FloorPlan&);
FloorPlan moved(FloorPlan plan, double x_m, double y_m);
double distance_to_wall(const Wall&, Point2);

// A straight corridor along x from the origin. Doors are closed and set back into the wall.
struct CorridorOptions {
  double length_m = 20.0;
  double width_m = 2.0;
  int doors = 8;
  int clutter = 8;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("length_m", length_m, 2.0, 1000.0, "length of the corridor in metres");
    v.number("width_m", width_m, 1.2, 10.0, "distance in metres between the corridor's walls");
    v.integer("doors", doors, 0, 2000,
              "number of closed doors, set back into the corridor's walls at random places; larger values make places "
              "easier to distinguish");
    v.integer("clutter", clutter, 0, 2000,
              "number of boxes along the corridor's walls; larger values make places easier to distinguish");
  }
};

// Rooms on both sides of corridors (on one side where there is little depth); corridors of a large apartment form
// loops.
struct ApartmentOptions {
  double width_m = 18.0;
  double height_m = 13.0;
  double corridor_width_m = 1.6;
  double room_width_m = 4.0;
  double door_width_m = 0.95;
  double wall_thickness_m = 0.12;
  double connecting_doors = 0.2;
  int furniture = 4;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("width_m", width_m, 3.5, 200.0, "outer size of the apartment along x, in metres");
    v.number("height_m", height_m, 3.5, 200.0, "outer size of the apartment along y, in metres");
    v.number("corridor_width_m", corridor_width_m, 1.2, 10.0,
             "distance in metres between the walls of the apartment's corridors");
    v.number("room_width_m", room_width_m, 2.0, 50.0,
             "typical width of the apartment's rooms in metres; they are between 0.7 and 1.3 times as wide");
    v.number("door_width_m", door_width_m, 0.7, 2.0, "free width in metres of the apartment's doors");
    v.number("wall_thickness_m", wall_thickness_m, 0.0, 0.5,
             "thickness in metres of the apartment's inner walls; 0: walls without thickness");
    v.fraction("connecting_doors", connecting_doors,
               "probability of a door between two neighbouring rooms; larger values give more loops");
    v.integer("furniture", furniture, 0, 20, "most pieces of furniture in a room; larger values fill rooms more");
  }
};

// Rooms off one side of a corridor, all alike down to the furniture: each a shifted copy of the first (repeated), or
// every second one its mirror image (mirrored).
struct RoomRowOptions {
  int rooms = 6;
  double room_width_m = 4.0;
  double room_depth_m = 5.0;
  double corridor_width_m = 1.8;
  double door_width_m = 0.95;
  int furniture = 4;
  int clutter = 0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("rooms", rooms, 2, 100, "number of rooms in the row");
    v.number("room_width_m", room_width_m, 2.0, 10.0, "size in metres of a room along the corridor");
    v.number("room_depth_m", room_depth_m, 2.0, 20.0, "size in metres of a room across the corridor");
    v.number("corridor_width_m", corridor_width_m, 1.2, 10.0, "distance in metres between the corridor's walls");
    v.number("door_width_m", door_width_m, 0.7, 1.5, "free width in metres of the rooms' doors");
    v.integer("furniture", furniture, 0, 20, "most pieces of furniture in a room; larger values fill rooms more");
    v.integer("clutter", clutter, 0, 2000,
              "number of boxes along the corridor's outer wall; larger values make places easier to distinguish");
  }
};

struct HallOptions {
  double width_m = 30.0;
  double height_m = 20.0;
  int pillars = 6;
  int clutter = 10;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("width_m", width_m, 4.0, 200.0, "size of the hall along x, in metres");
    v.number("height_m", height_m, 4.0, 200.0, "size of the hall along y, in metres");
    v.integer(
        "pillars", pillars, 0, 1000,
        "number of square pillars in the hall, at random places; larger values make places easier to distinguish");
    v.integer("clutter", clutter, 0, 2000,
              "number of boxes along the hall's walls; larger values make places easier to distinguish");
  }
};

// A corridor that closes on itself: a rectangle within a rectangle.
struct RingOptions {
  double width_m = 24.0;
  double height_m = 16.0;
  double corridor_width_m = 2.0;
  int doors = 12;
  int clutter = 10;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("width_m", width_m, 5.0, 300.0, "outer size of the ring along x, in metres");
    v.number("height_m", height_m, 5.0, 300.0, "outer size of the ring along y, in metres");
    v.number("corridor_width_m", corridor_width_m, 1.2, 10.0,
             "distance in metres between the walls of the ring's corridor");
    v.integer("doors", doors, 0, 2000,
              "number of closed doors, set back into the ring's outer walls at random places; larger values make "
              "places easier to distinguish");
    v.integer("clutter", clutter, 0, 2000,
              "number of boxes along the ring's walls; larger values make places easier to distinguish");
  }
};

// Racks in rows with an aisle on either side of each, and a crossing aisle at both ends. The places of a tour: the ends
// of the aisles, so that it leads up one aisle and down the next.
struct WarehouseOptions {
  int aisles = 5;
  double length_m = 30.0;
  double aisle_m = 2.4;
  double rack_m = 1.2;
  double crossing_m = 3.0;
  int pallets = 10;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("aisles", aisles, 1, 100, "number of aisles beside each other, all alike");
    v.number("length_m", length_m, 2.0, 300.0, "length of the racks in metres");
    v.number("aisle_m", aisle_m, 1.2, 20.0, "width of an aisle in metres");
    v.number("rack_m", rack_m, 0.2, 20.0, "width of a row of racks in metres");
    v.number("crossing_m", crossing_m, 1.2, 20.0, "width in metres of the crossing aisles at both ends of the racks");
    v.integer("pallets", pallets, 0, 2000,
              "number of boxes beside the racks, at random places; larger values make aisles easier to distinguish");
  }
};

// Each is a pure function of its arguments and stands in the quadrant x >= 0, y >= 0 (set-back doors reach 0.25 m out
// of it). Options that contradict one another (a ring narrower than its corridors) throw Error kBadInput.
FloorPlan make_corridor_plan(const CorridorOptions&, std::uint64_t seed);
FloorPlan make_apartment_plan(const ApartmentOptions&, std::uint64_t seed);
FloorPlan make_repeated_rooms_plan(const RoomRowOptions&, std::uint64_t seed);
FloorPlan make_mirrored_rooms_plan(const RoomRowOptions&, std::uint64_t seed);
FloorPlan make_hall_plan(const HallOptions&, std::uint64_t seed);
FloorPlan make_ring_plan(const RingOptions&, std::uint64_t seed);
FloorPlan make_warehouse_plan(const WarehouseOptions&, std::uint64_t seed);

}  // namespace mapweave::simulation
