#include "region_tiles.h"

#include <mapweave/matching/raster.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace mapweave::fusion {
namespace {

// The sides of regions and of the squares in them (24 and 12 m) are whole numbers of it: sums of whole tiles fill them.
constexpr double kTile_m = 2.0;

// visit(x_m, y_m, tile) of those whose middles lie in a square about this place.
template <class Tiles, class Visit>
void each_within(const Tiles& tiles, double x_m, double y_m, double side_m, Visit&& visit) {
  const int first_row = matching::cell_of(y_m - 0.5 * side_m, 1.0 / kTile_m);
  for (auto entry = tiles.lower_bound({first_row, std::numeric_limits<int>::min()}); entry != tiles.end(); ++entry) {
    const auto& [cell, tile] = *entry;
    const double tile_x_m = (cell.second + 0.5) * kTile_m, tile_y_m = (cell.first + 0.5) * kTile_m;
    if (tile_y_m > y_m + 0.5 * side_m) break;
    if (std::max(std::abs(tile_x_m - x_m), std::abs(tile_y_m - y_m)) <= 0.5 * side_m) visit(tile_x_m, tile_y_m, tile);
  }
}

}  // namespace

RegionAgreement RegionAgreement::in(const Square& square) const {
  RegionAgreement result;
  result.a = a;
  result.b = b;
  result.x_m = square.x_m;
  result.y_m = square.y_m;
  result.side_m = square.side_m;
  result.coinciding_m = square.coinciding_m;
  result.contradicted_m = square.contradicted_m;
  result.unclear_m = square.unclear_m;
  return result;
}

RegionTiles::Square& RegionTiles::at(double x_m, double y_m) {
  return tiles_[{matching::cell_of(y_m, 1.0 / kTile_m), matching::cell_of(x_m, 1.0 / kTile_m)}];
}

RegionTiles::Square RegionTiles::sum_about(double x_m, double y_m, double side_m) const {
  Square result{x_m, y_m, side_m};
  each_within(tiles_, x_m, y_m, side_m, [&](double, double, const Square& tile) {
    result.coinciding_m += tile.coinciding_m;
    result.contradicted_m += tile.contradicted_m;
    result.unclear_m += tile.unclear_m;
  });
  return result;
}

RegionTiles::Square RegionTiles::around_doubt_of(const RegionAgreement& region) const {
  double x_m = 0.0, y_m = 0.0, all_m = 0.0;
  each_within(tiles_, region.x_m, region.y_m, region.side_m, [&](double tile_x_m, double tile_y_m, const Square& tile) {
    x_m += in_doubt_m(tile) * tile_x_m;
    y_m += in_doubt_m(tile) * tile_y_m;
    all_m += in_doubt_m(tile);
  });
  return sum_about(all_m > 0.0 ? x_m / all_m : region.x_m, all_m > 0.0 ? y_m / all_m : region.y_m, region.side_m);
}

RegionTiles::Square RegionTiles::most_doubted_of(const RegionAgreement& region) const {
  constexpr double kSmall_m = RegionAgreement::kSmallSide_m;
  Square result{region.x_m, region.y_m, kSmall_m};
  if (in_doubt_m(region) <= 0.0) return result;
  const int reach = static_cast<int>(0.5 * (region.side_m - kSmall_m) / kTile_m);
  for (int y = -reach; y <= reach; ++y)
    for (int x = -reach; x <= reach; ++x) {
      const Square here = sum_about(region.x_m + x * kTile_m, region.y_m + y * kTile_m, kSmall_m);
      if (in_doubt_m(here) > in_doubt_m(result)) result = here;
    }
  return result;
}

}  // namespace mapweave::fusion
