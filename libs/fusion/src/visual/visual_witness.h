#pragma once
// What the judge says of two keyframes, as a statement about two maps: asked once, and not again where it is known.

#include "visual_map.h"

#include <mapweave/fusion/fuse.h>

#include <map>
#include <set>

namespace mapweave::fusion {

// A small motion of b in its own frame is the opposite motion of a, seen through the transform between them.
Eigen::Matrix<double, 6, 6> exchanged(const Eigen::Matrix<double, 6, 6>& covariance, const Sim3& a_from_b);

// One judgement seen as a statement about two maps.
struct VisualWitness {
  Judgement judgement;
  std::size_t keyframe_a = 0, keyframe_b = 0;  // numbers in the two maps
  Sim3 node_a_from_node_b, a_from_b;           // of the keyframes' nodes; of the map frames
  Eigen::Matrix<double, 6, 6> information =
      Eigen::Matrix<double, 6, 6>::Zero();  // of node_a_from_node_b, as a constraint's
};

// node_a_from_node_b in metres.
struct MetricWitness {
  Pose3 node_a_from_node_b;
  Eigen::Matrix<double, 6, 6> information;
};
// scale_a, scale_b: by which the two maps are rescaled to metres.
MetricWitness rescaled(const VisualWitness&, const VisualMap& a, const VisualMap& b, double scale_a, double scale_b);

struct VisualQuestion {
  std::size_t keyframe_a, keyframe_b;
};

// Asks the matching library's judge once for every pair of places, or finds the answer in the memo, or among those of
// before.
class VisualJudge {
 public:
  // All outlive it.
  VisualJudge(const VisualFusionOptions& options, const FusionInput& input, Memo& memo, WorkerPool& pool);
  // In the order of the questions. Not thread-safe; works in parallel within.
  std::vector<VisualWitness> ask(const VisualMap& a, const VisualMap& b, const std::vector<VisualQuestion>& questions,
                                 bool by_words = true);

  // What was judged of them before and found to be the same place, the most probable first, no keyframe twice; all of
  // it is known.
  std::vector<VisualQuestion> known_places(const VisualMap& a, const VisualMap& b) const;

 private:
  const VisualFusionOptions& options_;
  std::map<std::pair<SubmapId, SubmapId>, const Judgement*> before_;
  std::map<std::pair<SessionId, SessionId>, std::vector<const Judgement*>> same_;  // of those, of one place
  Memo& memo_;
  WorkerPool& pool_;
};

// Whether a witness is one: judged well enough, without a doubt, not vetoed.
bool holds(const VisualWitness& w, const std::set<Hash>& vetoed, const FusionOptions& options);
// Whether two keyframes of a map see landmarks in common.
bool beside(const VisualMap& map, std::size_t keyframe, std::size_t other);

}  // namespace mapweave::fusion
