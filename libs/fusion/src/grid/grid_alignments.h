#pragma once
// The map_server grids among the maps: each two are aligned as a whole. What other makers' scales are is estimated and
// applied before anything else looks at them; what holds two of them together becomes matches of submaps and
// constraints of tiles.

#include "laser/submap_graph.h"

#include <mapweave/core/worker_pool.h>
#include <mapweave/fusion/grid_pair.h>

#include <map>
#include <memory>
#include <set>

namespace mapweave::fusion {

class GridAlignments {
 public:
  struct Pair {
    GridPairResult result;  // of the grids as they were given
    Judgement judgement;    // for the records; names the result as what others rest on
    bool is_sure = false;   // the two are merged, if no third grid contradicts
    bool is_vetoed = false;
  };

  // `maps` must outlive it. Of the input, what is vetoed and its early end count. Aligns all pairs of grids but the
  // excluded ones (numbers, the lower first), side by side.
  GridAlignments(std::vector<const Map*> maps, const FusionInput& input, const FusionOptions& options, WorkerPool& pool,
                 const std::set<std::pair<std::size_t, std::size_t>>& excluded = {});

  bool is_grid(std::size_t map) const { return grids_[map] != nullptr; }
  // Against the grid with the lowest number that it is surely aligned with, through others or not; 1 where the
  // difference is none.
  double scale(std::size_t map) const { return scales_[map]; }
  const Map& given(std::size_t map) const { return *maps_[map]; }
  const Map& rescaled(std::size_t map) const { return scales_[map] == 1.0 ? *maps_[map] : rescaled_.at(map); }
  const Pair* pair(std::size_t a, std::size_t b) const;  // a < b; null where one is no grid
  const std::map<std::pair<std::size_t, std::size_t>, Pair>& pairs() const { return pairs_; }

  // Between the rescaled maps; a < b.
  Pose2 a_from_b(std::size_t a, std::size_t b) const;
  std::vector<Constraint> constraints(std::size_t a, std::size_t b) const;
  std::vector<SubmapMatch> matches(std::size_t a, std::size_t b, const std::vector<PreparedMap>& prepared,
                                   const SubmapGraph& graph) const;
  // Whether the two could lie so: not much more wall in free space than there is in grids of one place.
  bool may_lie(std::size_t a, std::size_t b, const Pose2& a_from_b) const;

 private:
  void align_all(const FusionInput& input, const std::set<std::pair<std::size_t, std::size_t>>& excluded,
                 WorkerPool& pool);
  void estimate_scales();

  std::vector<const Map*> maps_;
  const FusionOptions& options_;
  std::vector<std::shared_ptr<const PreparedGrid>> grids_;  // null: no grid, or the only one
  std::vector<double> scales_;
  std::map<std::size_t, Map> rescaled_;
  std::map<std::pair<std::size_t, std::size_t>, Pair> pairs_;
};

}  // namespace mapweave::fusion
