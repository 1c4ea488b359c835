#pragma once
// The grid of a map that grows, for who looks at it meanwhile.

#include <mapweave/fusion/compose_grid.h>

#include <memory>
#include <vector>

namespace mapweave::fusion {

// Drawn again and again: only what came since the last time is drawn while what was drawn
// before has not moved by half a cell, else all of it.
class GrowingGrid {
 public:
  explicit GrowingGrid(const ComposeOptions& options) : options_(options) {}
  // As compose_grid(), but for what moved by less; throws as that does. Until the next call.
  const OccupancyGrid& draw(const Map&, WorkerPool&);

 private:
  struct Drawn {
    NodeId node;
    std::shared_ptr<const Payload> payload;
    Pose3 map_from_node;
  };
  bool goes_on_in(const Map&) const;

  ComposeOptions options_;
  std::vector<Drawn> drawn_;  // by id
  OccupancyGrid grid_;
};

}  // namespace mapweave::fusion
