#include "region_displacement.h"

#include "seen_raster.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace mapweave::fusion {
namespace {

using matching::cell_of;
using matching::WallPoint;

constexpr double kFarthest_m = 2.0, kFarthest_rad = 0.12;  // of a displacement
constexpr double kStep_m = 0.2, kStep_rad = 0.02;          // about equal at kArm_m; bounds by kNear_m
constexpr double kNear_m = 0.3;                            // a step both ways, and a cell
constexpr std::size_t kMostWalls = 400;                    // of a side that are looked at
constexpr double kContradiction = 2.0;                     // a wall that is seen through, against one that coincides
constexpr double kLess = 0.5;                              // of what is in doubt, where it lies better
constexpr double kGain_m = 1.0;                            // of wall, that a better place has at least
constexpr double kSeenStill = 0.7;                         // of the walls that the other side saw anything of
constexpr double kSame_m = 0.15,
                 kArm_m = 8.0;       // a displacement that is none; from the middle of a region to its walls, about
constexpr double kPerMetre_m = 0.3;  // of wall on wall, that a metre of displacement has to be worth
constexpr int kSectors = 8;          // of directions that walls face

struct Displacement {
  double x_m = 0.0, y_m = 0.0, yaw_rad = 0.0;  // of `a`, about the middle of the region
  double length_m() const { return std::hypot(x_m, y_m) + kArm_m * std::abs(yaw_rad); }
};

struct Fit {
  double coinciding_m = 0.0, contradicted_m = 0.0, in_doubt_m = 0.0, seen_m = 0.0;
  double value_at(const Displacement& displacement) const {
    return coinciding_m - kContradiction * contradicted_m - kPerMetre_m * displacement.length_m();
  }
};

// Around the middle of the region.
struct Wall {
  double x, y;
  int sector;
};

int sector_of(const WallPoint& wall) {
  const int sector =
      static_cast<int>(std::floor(std::atan2(wall.normal_y, wall.normal_x) * kSectors / (2.0 * M_PI) + 0.5));
  return (sector + kSectors) % kSectors;
}

// What one side saw in each cell, and which way walls face in and beside it: a bit for each sector and the two next to
// it.
class Target {
 public:
  Target(const std::vector<PlacedSubmap>& side, const PlaneBox& box, const SightOf& sight_of)
      : cells_(cell_of(box.x0_m, kPerCell) - 1, cell_of(box.y0_m, kPerCell) - 1, cell_of(box.x1_m, kPerCell) + 1,
               cell_of(box.y1_m, kPerCell) + 1) {
    const SeenRaster seen(side, box, sight_of);
    for (int y = cells_.first_y(); y < cells_.first_y() + cells_.height(); ++y)
      for (int x = cells_.first_x(); x < cells_.first_x() + cells_.width(); ++x)
        cells_.at(x, y).seen = seen.at_cell(x, y);
    for (const WallPoint& wall : walls_in(side, box)) {
      const int x = cell_of(wall.x, kPerCell), y = cell_of(wall.y, kPerCell), sector = sector_of(wall);
      std::uint8_t bits = 0;
      for (const int beside : {kSectors - 1, 0, 1})
        bits = static_cast<std::uint8_t>(bits | 1U << static_cast<unsigned>((sector + beside) % kSectors));
      for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) cells_.at(x + i, y + j).facing |= bits;
    }
    best_ = cells_;
    for (int y = cells_.first_y(); y < cells_.first_y() + cells_.height(); ++y)
      for (int x = cells_.first_x(); x < cells_.first_x() + cells_.width(); ++x)
        if (Cell& cell = best_.at(x, y); cell.seen != Seen::wall) cell.facing = 0;
    take_best_of_near(1, 0);
    take_best_of_near(0, 1);
  }
  struct Cell {
    Seen seen = Seen::not_at_all;
    std::uint8_t facing = 0;
    bool agrees(int sector) const { return (facing >> static_cast<unsigned>(sector) & 1U) != 0; }
  };
  Cell at(double x, double y) const { return cells_.get(cell_of(x, kPerCell), cell_of(y, kPerCell)); }
  // The best that a wall can find within kNear_m: `through` where there is nothing else, and all that agrees.
  Cell best_near(double x, double y) const { return best_.get(cell_of(x, kPerCell), cell_of(y, kPerCell)); }

 private:
  static constexpr double kPerCell = 1.0 / SeenRaster::kCell_m;
  static constexpr int kNear = static_cast<int>(kNear_m / SeenRaster::kCell_m + 0.5);

  void take_best_of_near(int step_x, int step_y) {
    const matching::Raster<Cell> before = best_;
    for (int y = best_.first_y(); y < best_.first_y() + best_.height(); ++y)
      for (int x = best_.first_x(); x < best_.first_x() + best_.width(); ++x) {
        Cell& cell = best_.at(x, y);
        for (int k = -kNear; k <= kNear; ++k) {
          const Cell near = before.get(x + k * step_x, y + k * step_y);
          if (near.seen != Seen::through) cell.seen = Seen::not_at_all;
          cell.facing |= near.facing;
        }
      }
  }

  matching::Raster<Cell> cells_, best_;
};

PlaneBox box_of(const RegionAgreement& region) {
  PlaneBox box;
  box.add(region.x_m, region.y_m, 0.5 * region.side_m);
  return box;
}

class RegionFit {
 public:
  // Targets outlive it.
  RegionFit(const std::vector<PlacedSubmap>& a, const Target& target_a, const std::vector<PlacedSubmap>& b,
            const Target& target_b, const RegionAgreement& region)
      : x_m_(region.x_m), y_m_(region.y_m), targets_{&target_a, &target_b} {
    choose_walls(0, a, box_of(region));
    choose_walls(1, b, box_of(region));
  }

  // Displacements that follow turn by this.
  void turn(double yaw_rad) {
    yaw_rad_ = yaw_rad;
    for (std::size_t side = 0; side < 2; ++side) {
      const double c = std::cos(yaw_rad), s = side == 0 ? std::sin(yaw_rad) : -std::sin(yaw_rad);
      turned_[side].clear();
      for (const Wall& wall : walls_[side])
        turned_[side].push_back({c * wall.x - s * wall.y, s * wall.x + c * wall.y, wall.sector});
    }
  }

  // Nothing where the value cannot reach `least`.
  std::optional<Fit> at(double x_m, double y_m, double least) const {
    const Shifts shift = shifts(x_m, y_m);
    const Displacement displacement{x_m, y_m, yaw_rad_};
    double open_m = all_m();
    Fit fit;
    for (std::size_t side = 0; side < 2; ++side) {
      const std::vector<Wall>& walls = turned_[side];
      for (std::size_t first = 0; first < walls.size(); first += kAtOnce) {
        const std::size_t end = std::min(walls.size(), first + kAtOnce);
        std::array<int, 4> count{};  // coinciding, contradicted, in doubt otherwise, not seen
        for (std::size_t i = first; i < end; ++i) {
          const Target::Cell cell = targets_[1 - side]->at(walls[i].x + shift.x[side], walls[i].y + shift.y[side]);
          const bool coincides = cell.seen == Seen::wall && cell.agrees(walls[i].sector);
          ++count[cell.seen == Seen::not_at_all ? 3 : coincides ? 0 : cell.seen == Seen::through ? 1 : 2];
        }
        fit.coinciding_m += each_m_[side] * count[0];
        fit.contradicted_m += each_m_[side] * count[1];
        fit.in_doubt_m += each_m_[side] * (count[1] + kUnclearShare * count[2]);
        fit.seen_m += each_m_[side] * (count[0] + count[1] + count[2]);
        open_m -= each_m_[side] * static_cast<double>(end - first);
        if (fit.value_at(displacement) + open_m < least) return std::nullopt;
      }
    }
    return fit;
  }

  // Whether a displacement within kStep_m of this one, both ways, may have this value.
  bool may_reach(double x_m, double y_m, double least) const {
    const Shifts shift = shifts(x_m, y_m);
    double most = all_m() - kPerMetre_m * std::max(0.0, Displacement{x_m, y_m, yaw_rad_}.length_m() -
                                                            std::hypot(kStep_m, kStep_m));
    for (std::size_t side = 0; side < 2; ++side) {
      const std::vector<Wall>& walls = turned_[side];
      for (std::size_t first = 0; first < walls.size(); first += kAtOnce) {
        const std::size_t end = std::min(walls.size(), first + kAtOnce);
        int missed = 0;
        for (std::size_t i = first; i < end; ++i) {
          const Target::Cell best =
              targets_[1 - side]->best_near(walls[i].x + shift.x[side], walls[i].y + shift.y[side]);
          if (!best.agrees(walls[i].sector))
            missed += best.seen == Seen::through ? 1 + static_cast<int>(kContradiction) : 1;
        }
        most -= each_m_[side] * missed;
        if (most < least) return false;
      }
    }
    return true;
  }

 private:
  static constexpr std::size_t kAtOnce = 40;  // walls, until the value is looked at
  struct Shifts {
    double x[2], y[2];  // of turned walls of each side
  };
  Shifts shifts(double x_m, double y_m) const {
    const double c = std::cos(yaw_rad_), s = std::sin(yaw_rad_);
    return {{x_m_ + x_m, x_m_ - c * x_m - s * y_m}, {y_m_ + y_m, y_m_ + s * x_m - c * y_m}};
  }
  double all_m() const {
    return each_m_[0] * static_cast<double>(turned_[0].size()) + each_m_[1] * static_cast<double>(turned_[1].size());
  }

  // Of what the other side saw, one a cell, at most so many.
  void choose_walls(std::size_t side, const std::vector<PlacedSubmap>& submaps, const PlaneBox& box) {
    std::vector<Wall> walls;
    for (const WallPoint& wall : walls_in(submaps, box))
      if (targets_[1 - side]->at(wall.x, wall.y).seen != Seen::not_at_all)
        walls.push_back({wall.x - x_m_, wall.y - y_m_, sector_of(wall)});
    const std::size_t count = std::min(kMostWalls, walls.size());
    each_m_[side] =
        SeenRaster::kCell_m * static_cast<double>(walls.size()) / static_cast<double>(std::max<std::size_t>(1, count));
    // From all over the region in turn, so that few show how well all of them fit.
    constexpr std::size_t kParts = 16;
    for (std::size_t part = 0; part < kParts; ++part)
      for (std::size_t i = part; i < count; i += kParts) walls_[side].push_back(walls[i * walls.size() / count]);
  }

  double x_m_, y_m_, yaw_rad_ = 0.0;
  std::array<const Target*, 2> targets_;
  std::array<std::vector<Wall>, 2> walls_, turned_;
  std::array<double, 2> each_m_{};
};

std::vector<PlacedSubmap> reaching(const std::vector<PlacedSubmap>& side, const PlaneBox& box) {
  std::vector<PlacedSubmap> result;
  for (const PlacedSubmap& submap : side)
    if (std::hypot(std::clamp(submap.x_m, box.x0_m, box.x1_m) - submap.x_m,
                   std::clamp(submap.y_m, box.y0_m, box.y1_m) - submap.y_m) <= submap.radius_m)
      result.push_back(submap);
  return result;
}

}  // namespace

struct RegionDisplacement::Side {
  std::vector<PlacedSubmap> submaps;
  Target target;
};

RegionDisplacement::RegionDisplacement(const std::vector<std::vector<PlacedSubmap>>& maps, const SightOf& sight_of)
    : maps_(maps), sight_of_(sight_of) {}
RegionDisplacement::~RegionDisplacement() = default;

const RegionDisplacement::Side& RegionDisplacement::side(std::size_t map, const PlaneBox& box) {
  const auto known = sides_.find(map);
  if (known != sides_.end()) return known->second;
  std::vector<PlacedSubmap> submaps = reaching(maps_[map], box);
  Target target(submaps, box.grown(kFarthest_m), sight_of_);
  return sides_.emplace(map, Side{std::move(submaps), std::move(target)}).first->second;
}

std::optional<Pose2> RegionDisplacement::better_place(const RegionAgreement& region) {
  if (region.x_m != x_m_ || region.y_m != y_m_ || region.side_m != side_m_) sides_.clear();
  x_m_ = region.x_m;
  y_m_ = region.y_m;
  side_m_ = region.side_m;
  const PlaneBox box = box_of(region);
  const Side &a = side(region.a, box), &b = side(region.b, box);
  RegionFit fit(a.submaps, a.target, b.submaps, b.target, region);
  fit.turn(0.0);
  const Fit here = *fit.at(0.0, 0.0, -1e300);
  Fit most = here;
  Displacement best;
  const auto consider = [&](const Displacement& displacement) {
    const double before = most.value_at(best);
    const std::optional<Fit> there = fit.at(displacement.x_m, displacement.y_m, before);
    if (!there || there->seen_m < kSeenStill * here.seen_m) return;
    const double value = there->value_at(displacement);
    if (value < before || (value == before && displacement.length_m() >= best.length_m())) return;
    most = *there;
    best = displacement;
  };
  const int turns = static_cast<int>(kFarthest_rad / kStep_rad + 0.5),
            shifts = static_cast<int>(kFarthest_m / kStep_m + 0.5);
  for (int turn = -turns; turn <= turns; ++turn) {
    fit.turn(turn * kStep_rad);
    for (int middle_y = 1 - shifts; middle_y <= shifts; middle_y += 3)
      for (int middle_x = 1 - shifts; middle_x <= shifts; middle_x += 3) {
        if (!fit.may_reach(middle_x * kStep_m, middle_y * kStep_m, most.value_at(best))) continue;
        for (int y = middle_y - 1; y <= middle_y + 1; ++y)
          for (int x = middle_x - 1; x <= middle_x + 1; ++x) consider({x * kStep_m, y * kStep_m, turn * kStep_rad});
      }
  }
  for (const double part : {0.5, 0.25}) {
    const Displacement around = best;
    for (int turn = -1; turn <= 1; ++turn) {
      const double yaw_rad = around.yaw_rad + part * turn * kStep_rad;
      fit.turn(yaw_rad);
      for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x)
          consider({around.x_m + part * x * kStep_m, around.y_m + part * y * kStep_m, yaw_rad});
    }
  }
  const bool is_better = most.in_doubt_m <= kLess * here.in_doubt_m && most.coinciding_m >= here.coinciding_m &&
                         most.value_at(best) >= here.value_at({}) + kGain_m;
  if (best.length_m() <= kSame_m || !is_better) return std::nullopt;
  return compose(Pose2{region.x_m + best.x_m, region.y_m + best.y_m, best.yaw_rad},
                 Pose2{-region.x_m, -region.y_m, 0.0});
}

}  // namespace mapweave::fusion
