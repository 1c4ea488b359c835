#pragma once
// Stages 2 and 3 of fuse() for two maps of keyframes (CORB-SLAM 2.2; CVS III-B): which keyframes look alike, what the judge says of them,
// and whether that is enough to join.

#include "visual_map.h"

#include <mapweave/fusion/fuse.h>

#include <map>

namespace mapweave::fusion {

// One judgement seen as a statement about two maps.
struct VisualWitness {
  Judgement judgement;
  std::size_t keyframe_a = 0, keyframe_b = 0;                                     // numbers in the two maps
  Sim3 node_a_from_node_b, a_from_b;                                              // of the keyframes' nodes; of the map frames
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();  // of node_a_from_node_b, as a constraint's
};

struct VisualQuestion {
  std::size_t keyframe_a, keyframe_b;
};

// Asks the matching library's judge once for every pair of places, or finds the answer in the memo, or among those of before.
class VisualJudge {
 public:
  // before: FusionInput::judged. All outlive it.
  VisualJudge(const VisualFusionOptions& options, const std::vector<Judgement>& before, Memo& memo, WorkerPool& pool);
  // In the order of the questions. Not thread-safe; works in parallel within.
  std::vector<VisualWitness> ask(const VisualMap& a, const VisualMap& b, const std::vector<VisualQuestion>& questions,
                                 bool by_words = true);

 private:
  const VisualFusionOptions& options_;
  std::map<std::pair<SubmapId, SubmapId>, const Judgement*> before_;
  Memo& memo_;
  WorkerPool& pool_;
};

struct VisualPairResult {
  Verdict verdict;
  std::vector<VisualWitness> witnesses;  // that hold, where the verdict accepts
  std::vector<Hash> judged;
};

// told: pairs to judge first.
VisualPairResult decide(const VisualMap& a, const VisualMap& b, const std::vector<VisualQuestion>& told, const FusionInput& input,
                        const FusionOptions& options, VisualJudge& judge);

// Whether keyframes that see the same once b lies so do not know each other again.
bool contradict(const VisualMap& a, const VisualMap& b, const Sim3& a_from_b, VisualJudge& judge, std::vector<Hash>& judged);

Sim3 composed(const Sim3& a_from_b, const Sim3& b_from_c);
// Where a pose of b's frame is in a's.
Pose3 carried(const Sim3& a_from_b, const Pose3& b_from_c);

}  // namespace mapweave::fusion
