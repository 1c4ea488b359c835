#pragma once
// What somebody says of where maps lie to each other, as evidence: where to look first, and how much more probable a
// hypothesis that agrees is than one that does not. A prior may be wrong altogether, so that walls can outweigh it.

#include "submap_judge.h"
#include "wall_agreement.h"

#include <mapweave/fusion/fuse.h>

#include <functional>
#include <optional>
#include <vector>

namespace mapweave::fusion {

class PriorEvidence {
 public:
  // `maps` and `graph` must outlive it. Priors of unknown maps are left out, and further ones of the same two maps.
  PriorEvidence(const std::vector<PreparedMap>& maps, const SubmapGraph& graph, const std::vector<MapPrior>& priors);

  // Of the pair a < b: submaps that lie near each other by its prior, and windows as wide as that is unsure. Nearest
  // first.
  std::vector<SubmapQuestion> questions(std::size_t a, std::size_t b) const;
  // Of a match of two maps: what a set of matches weighs more for it.
  double weight(const SubmapMatch& match) const;
  // What the priors between two groups of maps add to the log odds of a hypothesis that puts them so; 0 without any.
  double log_odds(const SolvedSubmaps& solved, const std::vector<std::size_t>& x,
                  const std::vector<std::size_t>& z) const;
  // Of the pair a < b, where `a_from_b` is where it lies or fits best. `walls_at`: of the two, lying so. Nothing
  // without a prior.
  std::optional<PriorCheck> check(std::size_t a, std::size_t b, const std::optional<Pose2>& a_from_b,
                                  const std::function<WallAgreement(const Pose2& a_from_b)>& walls_at) const;

 private:
  struct Prior {
    std::size_t a, b;  // as given, not sorted
    Pose2 a_from_b;
    double sigma_m, sigma_rad;
  };
  const Prior* of(std::size_t a, std::size_t b) const;
  // Squared distance of a pose from the prior, in standard deviations; 3 degrees of freedom.
  static double distance2(const Prior& prior, const Pose2& a_from_b, double drift_m);

  const std::vector<PreparedMap>& maps_;
  const SubmapGraph& graph_;
  std::vector<Prior> priors_;
};

}  // namespace mapweave::fusion
