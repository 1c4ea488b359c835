#pragma once
// Whether the maps that came out show nothing twice, and what they say of priors.

#include "pair_judging.h"

#include <vector>

namespace mapweave::fusion {

class ComponentAudit {
 public:
  // It outlives this.
  explicit ComponentAudit(PairJudging& judging) : judging_(judging) {}

  // False where a component shows walls twice: then the map that is contradicted most is to stay apart from the rest of
  // its team, the judging knows it, and all has to be decided again.
  bool pass(const std::vector<Component>& components, const std::vector<PairJoin>& pairs);
  // Of the last pass, and of what was taken apart before; sorted by (a, b).
  std::vector<PairAudit> result() { return std::move(audits_); }

 private:
  bool refuse(std::size_t who, const std::vector<std::size_t>& members, const TeamAudit& audit,
              const std::vector<PairJoin>& pairs);

  PairJudging& judging_;
  std::vector<PairAudit> audits_, taken_apart_;
};

// By where the maps were merged; of those that stayed apart, by where they most probably lie.
void check_priors(const LaserMerger& lasers, const std::vector<Component>& components, std::vector<PairJoin>& pairs);

}  // namespace mapweave::fusion
