#pragma once
// Which walls and which free space scans show, by cells: what a scan adds to others.

#include <mapweave/maps/map.h>

#include <vector>

namespace mapweave::fusion {

class ScanCoverage {
 public:
  // For nodes with scans among these. The cells grow until the raster is of bounded size.
  ScanCoverage(const Table<NodeId, Node>& nodes, double cell_m, int sightings);

  struct Sight {
    std::vector<std::uint32_t> walls, free;  // cells, rising
  };
  Sight sight_of(const Node& node) const;
  // Share of its cells that fewer than `sightings` scans showed, or showed beside them: of walls or of free space,
  // whichever is more.
  double new_share(const Sight& sight) const;
  void add(const Sight& sight);
  void leave_out(const Sight& sight);
  // Share of the walls' cells that only scans show that were left out, with no cell beside them.
  double left_out() const;

 private:
  struct Raster {
    double cell_m = 0.0;
    std::size_t columns = 0, rows = 0;
    std::vector<std::uint8_t> count;
  };
  std::size_t cell(const Raster& raster, double x_m, double y_m) const;
  bool is_shown(const Raster& raster, std::size_t cell, int sightings) const;
  double new_share(const Raster& raster, const std::vector<std::uint32_t>& cells) const;

  int sightings_;
  double x_m_ = 0.0, y_m_ = 0.0;  // lower corner
  Raster walls_, free_;
  std::vector<std::uint8_t> all_walls_;
};

}  // namespace mapweave::fusion
