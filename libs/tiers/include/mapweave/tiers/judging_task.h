#pragma once
// What the cloud asks of an edge before it merges everything: to judge pairs of maps that lie on two edges. A run that
// is spread over machines asks workers the same. Judgements are pure in two contents, so whoever makes them makes the
// same.

#include <mapweave/fusion/fuse.h>
#include <mapweave/maps/pair_to_judge.h>

#include <memory>
#include <string>
#include <vector>

namespace mapweave::tiers {

// As it goes over the wire.
struct JudgingTask {
  std::string pairs;                 // encoded (maps/pair_to_judge.h)
  std::vector<std::string> updates;  // encoded MapUpdates: of the maps that the receiver does not hold what is to be
                                     // judged. An edge holds one map of each pair, a worker none
};

// The same with all maps at hand.
struct JudgingWork {
  std::vector<PairToJudge> pairs;
  std::vector<Map> maps;  // each once
};

// What a merge begins with.
JudgingWork first_work(fusion::FusionInput input, const fusion::FusionOptions&, WorkerPool&);
// At most `most` tasks of about the same work, for who holds no map.
std::vector<JudgingTask> shared_out(const JudgingWork& work, std::size_t most);
// Of a task that holds all that it takes. Throws what decoding an update throws, and Error(kBadInput) where a map was
// not sent along.
JudgingWork work_of(const JudgingTask& task, const std::string& where);
// The answers, sorted by id. models: kept for the next work; null: its own. Throws as fusion::judge_pairs().
std::vector<Judgement> judge(JudgingWork work, const fusion::FusionOptions&,
                             std::shared_ptr<matching::ModelCache> models, WorkerPool&, Progress&);

// Judgements as a message of their own. decode throws what decoding an update throws.
std::string encode(const std::vector<Judgement>& judgements);
std::vector<Judgement> decode_judgements(std::string_view bytes, const std::string& where);

}  // namespace mapweave::tiers
