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
constexpr double kStep_m = 0.2, kStep_rad = 0.02;
constexpr std::size_t kMostWalls = 400;           // of a side that are looked at
constexpr double kContradiction = 2.0;            // a wall that is seen through, against one that coincides
constexpr double kLess = 0.5;                     // of what is in doubt, where it lies better
constexpr double kGain_m = 1.0;
constexpr double kSeenStill = 0.7;                // of the walls that the other side saw anything of
constexpr double kSame_m = 0.15, kArm_m = 8.0;    // a displacement that is none; from the middle of a region to its walls, about
constexpr double kPerMetre_m = 0.3;               // of wall on wall, that a metre of displacement has to be worth
constexpr int kSectors = 8;                       // of directions that walls face

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
  const int sector = static_cast<int>(std::floor(std::atan2(wall.normal_y, wall.normal_x) * kSectors / (2.0 * M_PI) + 0.5));
  return (sector + kSectors) % kSectors;
}

// Which way walls face, in and beside each cell: a bit for each sector and the two next to it.
class Facing {
 public:
  Facing(const std::vector<PlacedSubmap>& side, const PlaneBox& box)
      : cells_(cell_of(box.x0_m, kPerCell) - 1, cell_of(box.y0_m, kPerCell) - 1, cell_of(box.x1_m, kPerCell) + 1, cell_of(box.y1_m, kPerCell) + 1) {
    for (const WallPoint& wall : walls_in(side, box)) {
      const int x = cell_of(wall.x, kPerCell), y = cell_of(wall.y, kPerCell), sector = sector_of(wall);
      std::uint8_t bits = 0;
      for (const int beside : {kSectors - 1, 0, 1}) bits = static_cast<std::uint8_t>(bits | 1U << static_cast<unsigned>((sector + beside) % kSectors));
      for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) cells_.at(x + i, y + j) |= bits;
    }
  }
  bool agrees(double x, double y, int sector) const {
    return (cells_.get(cell_of(x, kPerCell), cell_of(y, kPerCell)) >> static_cast<unsigned>(sector) & 1U) != 0;
  }

 private:
  static constexpr double kPerCell = 1.0 / SeenRaster::kCell_m;
  matching::Raster<std::uint8_t> cells_;
};

class RegionFit {
 public:
  RegionFit(const std::vector<PlacedSubmap>& a, const std::vector<PlacedSubmap>& b, const PlaneBox& box, double x_m, double y_m,
            const SightOf& sight_of)
      : x_m_(x_m),
        y_m_(y_m),
        seen_{SeenRaster(a, box.grown(kFarthest_m), sight_of), SeenRaster(b, box.grown(kFarthest_m), sight_of)},
        facing_{Facing(a, box.grown(kFarthest_m)), Facing(b, box.grown(kFarthest_m))} {
    walls_[0] = walls_of(a, box, seen_[1]);
    walls_[1] = walls_of(b, box, seen_[0]);
  }

  Fit at(const Displacement& displacement) const {
    Fit fit;
    const double c = std::cos(displacement.yaw_rad), s = std::sin(displacement.yaw_rad);
    for (std::size_t side = 0; side < 2; ++side) {
      const std::size_t count = std::min(kMostWalls, walls_[side].size());
      const double each_m = SeenRaster::kCell_m * static_cast<double>(walls_[side].size()) / static_cast<double>(std::max<std::size_t>(1, count));
      for (std::size_t i = 0; i < count; ++i) {
        const Wall& wall = walls_[side][i * walls_[side].size() / count];
        const double u = side == 0 ? wall.x : wall.x - displacement.x_m, v = side == 0 ? wall.y : wall.y - displacement.y_m;
        const double x = side == 0 ? c * u - s * v + displacement.x_m : c * u + s * v, y = side == 0 ? s * u + c * v + displacement.y_m : c * v - s * u;
        const Seen seen = seen_[1 - side].at(x + x_m_, y + y_m_);
        if (seen == Seen::not_at_all) continue;
        fit.seen_m += each_m;
        if (seen == Seen::wall && facing_[1 - side].agrees(x + x_m_, y + y_m_, wall.sector))
          fit.coinciding_m += each_m;
        else if (seen == Seen::through)
          fit.contradicted_m += each_m;
        else
          fit.in_doubt_m += kUnclearShare * each_m;
      }
    }
    fit.in_doubt_m += fit.contradicted_m;
    return fit;
  }

 private:
  // Of what the other side saw, one a cell.
  std::vector<Wall> walls_of(const std::vector<PlacedSubmap>& side, const PlaneBox& box, const SeenRaster& other) const {
    std::vector<Wall> walls;
    for (const WallPoint& wall : walls_in(side, box))
      if (other.at(wall.x, wall.y) != Seen::not_at_all) walls.push_back({wall.x - x_m_, wall.y - y_m_, sector_of(wall)});
    return walls;
  }

  double x_m_, y_m_;
  std::array<SeenRaster, 2> seen_;
  std::array<Facing, 2> facing_;
  std::array<std::vector<Wall>, 2> walls_;
};

std::vector<PlacedSubmap> reaching(const std::vector<PlacedSubmap>& side, const PlaneBox& box) {
  std::vector<PlacedSubmap> result;
  for (const PlacedSubmap& submap : side)
    if (std::hypot(std::clamp(submap.x_m, box.x0_m, box.x1_m) - submap.x_m, std::clamp(submap.y_m, box.y0_m, box.y1_m) - submap.y_m) <= submap.radius_m)
      result.push_back(submap);
  return result;
}

}  // namespace

std::optional<Pose2> better_place(const std::vector<PlacedSubmap>& a, const std::vector<PlacedSubmap>& b, const RegionAgreement& region,
                                  const SightOf& sight_of) {
  PlaneBox box;
  box.add(region.x_m, region.y_m, 0.5 * RegionAgreement::kSide_m);
  const RegionFit fit(reaching(a, box), reaching(b, box), box, region.x_m, region.y_m, sight_of);
  const Fit here = fit.at({});
  Fit most = here;
  Displacement best;
  const auto consider = [&](const Displacement& displacement) {
    const Fit there = fit.at(displacement);
    const double value = there.value_at(displacement), before = most.value_at(best);
    if (value < before || (value == before && displacement.length_m() >= best.length_m()) || there.seen_m < kSeenStill * here.seen_m) return;
    most = there;
    best = displacement;
  };
  const int turns = static_cast<int>(kFarthest_rad / kStep_rad + 0.5), shifts = static_cast<int>(kFarthest_m / kStep_m + 0.5);
  for (int turn = -turns; turn <= turns; ++turn)
    for (int y = -shifts; y <= shifts; ++y)
      for (int x = -shifts; x <= shifts; ++x) consider({x * kStep_m, y * kStep_m, turn * kStep_rad});
  for (const double part : {0.5, 0.25}) {
    const Displacement around = best;
    for (int turn = -1; turn <= 1; ++turn)
      for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x)
          consider({around.x_m + part * x * kStep_m, around.y_m + part * y * kStep_m, around.yaw_rad + part * turn * kStep_rad});
  }
  const bool is_better = most.in_doubt_m <= kLess * here.in_doubt_m && most.coinciding_m >= here.coinciding_m &&
                         most.value_at(best) >= here.value_at({}) + kGain_m;
  if (best.length_m() <= kSame_m || !is_better) return std::nullopt;
  return compose(Pose2{region.x_m + best.x_m, region.y_m + best.y_m, best.yaw_rad}, Pose2{-region.x_m, -region.y_m, 0.0});
}

}  // namespace mapweave::fusion
