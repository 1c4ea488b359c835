#pragma once
// Where there is something in space, where nothing is, and where nobody looked: OctoMap's trees (Hornung et al. 2013).

#include <mapweave/exporters/point_cloud.h>
#include <mapweave/maps/occupancy_grid.h>

#include <memory>

namespace mapweave::exporters {

struct OctoMapOptions {
  double resolution_m = 0.05;
  double memory_mb = 256.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number(
        "resolution_m", resolution_m, 0.01, 10.0,
        "side in metres of the smallest cells of the OctoMap; larger values need less memory and show less detail");
    v.number("memory_mb", memory_mb, 1.0, 100000.0,
             "memory in megabytes for building the OctoMap; where it needs more, the side of its cells is doubled; "
             "larger values keep large maps fine");
  }
};

// What planar sensors saw from one height.
struct MapSlab {
  double height_m = 0.0;  // above the floor of the map
  OccupancyGrid grid;
};

struct OctoMapFiles {
  std::string bt;  // an octomap::OcTree: occupied, free, unknown
  std::string ot;  // an octomap::ColorOcTree: probabilities and colours
};

class OctoMapWriter {
 public:
  explicit OctoMapWriter(const OctoMapOptions& options = {});
  ~OctoMapWriter();
  // What one picture saw: what lies between the camera and its points is free. Each cell learns once from a picture
  // (again where the cells have to grow meanwhile). Points outside the cube of 65,536 cells a side around the map's
  // origin are left out, and all of a camera outside of it. Contract: finite.
  void add(const Eigen::Vector3d& camera_in_map, const std::vector<ColouredPoint>& points_in_map);

  // One layer of cells at the slab's height: walls are occupied, what was seen through is free. Of cells that lie
  // within one cell of the tree, a wall counts. Before any picture (contract): pictures add to what it says. Cells
  // outside of the cube are left out.
  void add(const MapSlab& slab);

  double resolution_m() const;  // now: that of the options, doubled once or more where memory was short
  std::size_t nodes() const;
  std::size_t most_nodes() const;
  std::size_t left_out() const;  // points, and cells of slabs
  // The end: nothing is added after it, and it comes once (contract).
  OctoMapFiles finish();

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace mapweave::exporters
