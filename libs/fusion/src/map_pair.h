#pragma once
// Stages 1 to 3 of fuse() for one pair of maps: which submaps look alike, what the judge says of them, and whether that is enough to join.

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
  std::vector<std::vector<matching::RingKey>> keys;
  std::vector<float> radii_m;
  std::vector<std::size_t> representatives;  // numbers of submaps: what the first search compares
  bool is_grid = false;
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

// What to judge next; answered from the memo where it was judged before.
struct Question {
  std::size_t submap_a, submap_b;
  matching::WideWindow a_from_b;  // of submap a and b, whatever their ids
};

class Judge {
 public:
  Judge(const FusionOptions& options, matching::ModelCache& cache, Memo& memo, WorkerPool& pool)
      : options_(options), cache_(cache), memo_(memo), pool_(pool) {}
  // In the order of the questions. Not thread-safe; works in parallel within.
  std::vector<Witness> ask(const PreparedMap& a, const PreparedMap& b, const std::vector<Question>& questions);

 private:
  const FusionOptions& options_;
  matching::ModelCache& cache_;
  Memo& memo_;
  WorkerPool& pool_;
};

struct PairResult {
  Verdict verdict;
  std::vector<Witness> witnesses;  // that hold, where the verdict accepts
  std::vector<Hash> judged;
};

PairResult decide(const PreparedMap& a, const PreparedMap& b, const FusionInput& input, const FusionOptions& options, Judge& judge);

}  // namespace mapweave::fusion
