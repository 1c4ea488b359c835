#pragma once
// Stages 2 and 3 of fuse() for two maps of keyframes (CORB-SLAM 2.2; CVS III-B): which keyframes look alike, what the
// judge says of them, and whether that is enough to merge.

#include "visual_witness.h"

#include <set>

namespace mapweave::fusion {

// Keyframes of two maps whose places look like others, and the judgements that say so.
struct VisualRepetition {
  std::set<std::size_t> of_a, of_b;
  std::vector<Hash> because;
};

struct VisualPairResult {
  Verdict verdict;
  std::vector<VisualWitness> witnesses;  // that hold, where the verdict accepts
  std::vector<Hash> judged;
  VisualRepetition repetition;  // where the verdict is ambiguous
};

struct VisualQuestions {
  std::vector<VisualQuestion> first;  // to be judged before others
  bool is_incremental = false;        // these and what was found before are all
  bool is_doubted = true;             // whether what the maps rest on looks like other places
};

VisualPairResult decide(const VisualMap& a, const VisualMap& b, const VisualQuestions& questions,
                        const FusionInput& input, const FusionOptions& options, VisualJudge& judge);

// Whether keyframes that see the same once b lies so do not know each other again.
bool contradict(const VisualMap& a, const VisualMap& b, const Sim3& a_from_b, VisualJudge& judge,
                std::vector<Hash>& judged);

}  // namespace mapweave::fusion
