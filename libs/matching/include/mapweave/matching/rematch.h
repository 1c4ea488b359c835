#pragma once
// The accuracy lever of a closed map: every scan is matched again to the submaps around it that it is not part of, past
// and future, of its own robot and of others.

#include <mapweave/core/worker_pool.h>
#include <mapweave/maps/map.h>
#include <mapweave/matching/model_cache.h>

#include <functional>
#include <vector>

namespace mapweave::matching {

struct RematchOptions {
  double radius_m = 4.0;  // a submap is around a node when its path comes this near
  int most_submaps = 4;   // per node, nearest first
  double min_inliers = 0.6;
  double max_correction_m = 0.25;
  double max_correction_rad = 0.06;
  double information_scale = 0.03;  // points share errors: they count less than independent ones would
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("radius_m", radius_m,
               "a scan is matched again only to submaps whose path comes within this distance in metres; larger values "
               "find more "
               "constraints and take longer");
    v.integer("most_submaps", most_submaps, 0, 100,
              "most submaps that each scan is matched to again, the nearest first; larger values are more accurate and "
              "slower; 0 switches the step off");
    v.fraction("min_inliers", min_inliers,
               "least share of a scan's points that must lie on walls of the submap for the match to become a "
               "constraint; larger values make fewer constraints");
    v.positive("max_correction_m", max_correction_m,
               "matches that would move a scan by more than this distance in metres are dropped as wrong; larger "
               "values keep more matches, also wrong ones");
    v.positive("max_correction_rad", max_correction_rad,
               "matches that would turn a scan by more than this angle in radians are dropped as wrong; larger values "
               "keep more matches, also wrong ones");
    v.fraction("information_scale", information_scale,
               "information of a scan match relative to that of points with independent errors; well below 1, because "
               "the points of a scan share errors of pose and sensor; larger values trust these matches more");
  }
};

// Constraints of kind scan_match from submap anchors to nodes, under the map's present belief, in a canonical order;
// those between different sessions have kind between_maps. The same for any number of threads. `is_left_out`: of which
// scans and submaps nothing is asked, though they count among the nearest. `models`: submaps that are ready already.
std::vector<Constraint> rematch(const Map& map, const RematchOptions&, WorkerPool&,
                                const std::function<bool(const NodeId&, const Submap&)>& is_left_out = {},
                                ModelCache* models = nullptr);

}  // namespace mapweave::matching
