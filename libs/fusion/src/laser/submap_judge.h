#pragma once
// Judgements of submap pairs: answered from the memo where they were made before, else in parallel. Who is laid into
// whom depends on the content of the submaps, not on the names of their robots.

#include "submap_graph.h"
#include "wall_sight.h"

#include <mapweave/core/worker_pool.h>
#include <mapweave/matching/model_cache.h>

#include <deque>
#include <set>

namespace mapweave::fusion {

// How much of a submap's walls need be found for a match to be weighed. `part`: about half of what the options want,
// for submaps of one team, whose graph says about where they lie. `least_part`: a fifth, where another match says where
// they lie.
enum class Thoroughness : std::uint8_t { whole, part, least_part };

std::string to_text(Proposer);

struct SubmapQuestion {
  std::size_t from = 0, to = 0;       // numbers of submaps
  matching::WideWindow from_from_to;  // where to search
  Thoroughness wanted = Thoroughness::whole;
  Proposer proposer = Proposer::ring_keys;
};

struct SubmapAnswer {
  std::size_t from = 0, to = 0;
  Judgement judgement;
  std::vector<SubmapMatch> hypotheses;  // best first; none where the judge saw walls that contradict
  // Whether the best one may be a constraint of the graph: it is probable, and at most open along a corridor.
  bool holds = false;
  Proposer proposer = Proposer::ring_keys;
};

// What makes judging fast, and never changes an answer.
struct JudgeResources {
  matching::ModelCache& cache;
  Memo& memo;
  WorkerPool& pool;
  const FusionInput& input;
};

class SubmapJudge {
 public:
  SubmapJudge(const std::vector<PreparedMap>& maps, const SubmapGraph& graph, const FusionOptions& options,
              const std::set<Hash>& vetoed, const JudgeResources& resources)
      : maps_(maps),
        graph_(graph),
        options_(options),
        vetoed_(vetoed),
        cache_(resources.cache),
        sights_(static_cast<std::size_t>(options.cache_mb) << 20U),
        memo_(resources.memo),
        pool_(resources.pool),
        input_(resources.input) {}

  // In the order of the questions; none once an interruption ended the search. Not thread-safe; works in parallel
  // within.
  std::vector<SubmapAnswer> ask(const std::vector<SubmapQuestion>& questions);
  std::shared_ptr<const WallSight> sight(std::size_t submap);
  // Makes what is missing in parallel, as far as there is room to keep it.
  void prepare_sights(const std::vector<std::size_t>& submaps);
  const std::vector<Hash>& asked() const {
    return asked_;
  }  // judgements, in the order of the questions, with repetitions

 private:
  std::shared_ptr<const WallSight> made(std::size_t submap) const;
  SubmapAnswer answer_of(const SubmapQuestion& question, const Judgement& judgement) const;

  const std::vector<PreparedMap>& maps_;
  const SubmapGraph& graph_;
  const FusionOptions& options_;
  const std::set<Hash>& vetoed_;
  matching::ModelCache& cache_;
  WallSightCache sights_;
  Memo& memo_;
  WorkerPool& pool_;
  const FusionInput& input_;
  std::vector<Hash> asked_;
};

}  // namespace mapweave::fusion
