#pragma once
// What the plans are made of. All of it is parallel to an axis.

#include <mapweave/simulation/floor_plan.h>
#include <mapweave/simulation/random.h>

#include <utility>
#include <vector>

namespace mapweave::simulation {

constexpr int kCylinderSides = 12;

struct Interval {
  double from = 0.0, to = 0.0;
  bool overlaps(const Interval& other) const { return from < other.to && other.from < to; }
};

// One side of a room or corridor: from a corner along its wall, with the room on the side of `inward`.
struct Side {
  Point2 from, along, inward;  // the last two are unit vectors
  double length_m = 0.0;
  std::vector<Interval> taken;  // along the wall
  Point2 at(double along_m, double inward_m) const {
    return {from.x + along.x * along_m + inward.x * inward_m, from.y + along.y * along_m + inward.y * inward_m};
  }
};
std::vector<Side> sides_seen_from_inside(const Box&);  // south, east, north, west
std::vector<Side> sides_seen_from_outside(const Box&);

void add_line(FloorPlan&, Point2 from, Point2 to);
void add_box(FloorPlan&, const Box&);
void add_piece(FloorPlan&, const Piece&);  // with its outline
Box box_of(Point2 corner, Point2 opposite);

// A wall with openings (ascending, along the wall from `from`); thickness 0: a mere line.
void add_wall(FloorPlan&, Point2 from, Point2 to, double thickness_m, const std::vector<Interval>& openings = {});

// Set-back doors at random places of the sides that are not taken; as many as find room. Draws the sides' walls as
// well.
void add_sides_with_closed_doors(FloorPlan&, std::vector<Side>& sides, int doors, RandomNumbers&);
// Boxes against the sides where they are not taken, up to `depth_m` deep; none where that is under 0.1 m.
void add_clutter(FloorPlan&, std::vector<Side>& sides, int boxes, double depth_m, RandomNumbers&);
// Pieces along the walls of a room: its middle (1.1 m wide at least) and the boxes `keep_free` before its doors stay
// free.
void add_furniture(FloorPlan&, const Box& room, const std::vector<Box>& keep_free, int pieces_at_most, RandomNumbers&);

}  // namespace mapweave::simulation
