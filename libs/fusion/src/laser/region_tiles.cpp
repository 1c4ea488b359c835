#include "region_tiles.h"

#include <mapweave/matching/raster.h>

#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

constexpr double kTile_m = 2.0;

// visit(x_m, y_m, tile) of those whose middles lie in the region about this place.
template <class Tiles, class Visit>
void each_within(const Tiles& tiles, double x_m, double y_m, Visit&& visit) {
  for (const auto& [cell, tile] : tiles) {
    const double tile_x_m = (cell.second + 0.5) * kTile_m, tile_y_m = (cell.first + 0.5) * kTile_m;
    if (std::max(std::abs(tile_x_m - x_m), std::abs(tile_y_m - y_m)) <= 0.5 * RegionAgreement::kSide_m)
      visit(tile_x_m, tile_y_m, tile);
  }
}

}  // namespace

RegionAgreement RegionAgreement::centred() const {
  RegionAgreement result;
  result.a = a;
  result.b = b;
  result.x_m = around.x_m;
  result.y_m = around.y_m;
  result.coinciding_m = around.coinciding_m;
  result.contradicted_m = around.contradicted_m;
  result.unclear_m = around.unclear_m;
  return result;
}

RegionTiles::Around& RegionTiles::at(double x_m, double y_m) {
  return tiles_[{matching::cell_of(y_m, 1.0 / kTile_m), matching::cell_of(x_m, 1.0 / kTile_m)}];
}

RegionTiles::Around RegionTiles::around_doubt_of(const RegionAgreement& region) const {
  Around result;
  double all_m = 0.0;
  each_within(tiles_, region.x_m, region.y_m, [&](double x_m, double y_m, const Around& tile) {
    result.x_m += in_doubt_m(tile) * x_m;
    result.y_m += in_doubt_m(tile) * y_m;
    all_m += in_doubt_m(tile);
  });
  result.x_m = all_m > 0.0 ? result.x_m / all_m : region.x_m;
  result.y_m = all_m > 0.0 ? result.y_m / all_m : region.y_m;
  each_within(tiles_, result.x_m, result.y_m, [&](double, double, const Around& tile) {
    result.coinciding_m += tile.coinciding_m;
    result.contradicted_m += tile.contradicted_m;
    result.unclear_m += tile.unclear_m;
  });
  return result;
}

}  // namespace mapweave::fusion
