#pragma once
// A map made ready for matching, and what is known of a pair of maps.

#include <mapweave/core/worker_pool.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/matching/model_cache.h>

#include <functional>

namespace mapweave::fusion {

// A map with what matching needs of it, made once.
struct PreparedMap {
  const Map* map = nullptr;
  std::vector<const Submap*> submaps;  // frozen ones, in id order
  std::vector<Pose2> map_from_submap;
  std::vector<matching::Point2f> centres;  // of walls, in the map's frame
  std::vector<std::vector<matching::RingKey>> keys, far_keys;
  std::vector<float> radii_m;
  std::vector<Hash> fingerprints;                       // of the walls: names play no part
  std::vector<std::size_t> representatives;             // numbers of submaps: what the first search compares
  std::vector<std::vector<matching::WallPoint>> walls;  // in their submaps' frames
  bool is_grid = false;
  double scans_per_scan = 1.0;  // of a map that was thinned: how many each scan that is left stands for
  double walls_m = 0.0;  // length of all walls, each place counted once (cells of 0.1 m, by the side that they face)
};

PreparedMap prepare(const Map&, matching::ModelCache&, double stride_m, WorkerPool&);

// One judgement seen as a statement about two maps.
struct Witness {
  Judgement judgement;
  std::size_t submap_a = 0, submap_b = 0;  // numbers in the two prepared maps
  Pose2 a_from_b;                          // of the map frames
  Eigen::Matrix3d submap_information;      // of submap_from_submap, x, y, yaw in the frame of `to`
  Pose2 submap_a_from_submap_b;
};

struct PairResult {
  Verdict verdict;
  std::vector<Witness> witnesses;  // that hold, where the verdict accepts
  std::vector<Hash> judged;
};

}  // namespace mapweave::fusion
