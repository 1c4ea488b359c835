#pragma once
// Two sets of submaps laid on each other: which walls both saw, which of one the other saw through, and where. Whole
// maps are compared, each wall counted once, at the poses of the joint graph: what decides between hypotheses, and the
// audit of a finished map.

#include "wall_sight.h"

#include <functional>

namespace mapweave::fusion {

struct PlacedSubmap {
  std::size_t number = 0;  // whose sight is asked for
  Pose2 team_from_submap;
  double x_m = 0.0, y_m = 0.0, radius_m = 0.0;              // around its walls, team frame
  const std::vector<matching::WallPoint>* walls = nullptr;  // in the submap's frame
};
using SightOf = std::function<std::shared_ptr<const WallSight>(std::size_t number)>;

// Walls of one side that the other saw through, connected.
struct Contradiction {
  double x_m = 0.0, y_m = 0.0;  // middle, team frame
  double length_m = 0.0;
};

// Lengths of wall, of both sides together, each place counted once a side.
struct WallAgreement {
  double coinciding_m = 0.0;
  double contradicted_m = 0.0;  // the other saw through it
  double unclear_m = 0.0;       // the other looked there, and saw neither a wall nor clearly through
  double in_part_m = 0.0;       // of these, where the other did not see all around
  double overlap = 0.0;         // share of the smaller side's walls that lie where the other looked
  // Coinciding here, above the most that would where one side is shifted by 0.75 to 6 m; of the fullest regions
  // (distinctive_walls.h). Where the overlap is small, also above the most that would if one side were its mirror
  // image: a place that is its own mirror image is recognised by what lies around it.
  double distinctive_m = 0.0;
  double unique_m = 0.0;   // of these, what is not taken to coincide at the next rooms, where walls repeat themselves
  bool repeats = false;    // nearly nothing is left of them so
  bool is_placed = false;  // a prior says where they lie: what repeats itself, or slides along itself, counts as well
  double wider_m = 0.0;    // rooms of b are at least so much wider, negative: narrower (room_widths.h)
  double observability = 0.0;  // of the worse direction, 0 to 0.5: share of coinciding walls that face along it
  std::vector<Contradiction> contradictions;  // longest first; those over 0.6 m
  double share() const { return coinciding_m / std::max(1e-9, coinciding_m + contradicted_m + unclear_m); }
  double conflict() const { return contradicted_m / std::max(1e-9, coinciding_m + contradicted_m + unclear_m); }
};

// Of all walls, what several submaps have counted once, metres.
double length_of_walls(const std::vector<PlacedSubmap>& side);

// Symmetric in its arguments. Asks for each sight once, and once more where it tells how unusual is what fits.
// `a_walls_m`: length of all walls of that side, also of submaps that are not given.
WallAgreement wall_agreement(const std::vector<PlacedSubmap>& a, double a_walls_m, const std::vector<PlacedSubmap>& b,
                             double b_walls_m, const SightOf& sight_of);

// What two maps of a finished team saw of each other's walls in one region.
struct RegionAgreement {
  static constexpr double kSide_m = 24.0, kSmallSide_m = 12.0;
  std::size_t a = 0, b = 0;     // places of the maps in the team, a < b
  double x_m = 0.0, y_m = 0.0;  // middle of the region, team frame
  double side_m = kSide_m;
  double coinciding_m = 0.0, contradicted_m = 0.0, unclear_m = 0.0;
  std::vector<Contradiction> contradictions;  // longest first
  struct Square {
    double x_m = 0.0, y_m = 0.0, side_m = kSide_m;  // middle
    double coinciding_m = 0.0, contradicted_m = 0.0, unclear_m = 0.0;
  };
  // Of this size, about the middle of what is in doubt here: the border of a region may part what two maps disagree
  // about from the walls around it.
  Square centred;
  // The one of kSmallSide_m within this region in which most is in doubt: a corridor that lies wrongly in one corner of
  // a region is little beside what coincides in the others.
  Square most_doubted;
  RegionAgreement in(const Square& square) const;  // of the same two maps, without contradictions
};
constexpr double kUnclearShare = 0.25;  // of a wall that another one stands close to: drawn twice, it may be
template <class Agreement>
double in_doubt_m(const Agreement& walls) {
  return walls.contradicted_m + kUnclearShare * walls.unclear_m;
}

// Every map against every other, by regions in which both saw something. Asks for each sight once.
std::vector<RegionAgreement> compare_by_region(const std::vector<std::vector<PlacedSubmap>>& maps,
                                               const SightOf& sight_of);

}  // namespace mapweave::fusion
