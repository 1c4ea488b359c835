#include "verdict.h"

#include "laser/wall_agreement.h"

#include <mapweave/fusion/wall_weights.h>

#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

// More of what was seen, or a prior, may still decide these.
bool is_open(Reason doubt) { return doubt == Reason::ambiguous || doubt == Reason::unobservable; }

void accept(Verdict& verdict, Reason doubt = Reason::none) {
  verdict.decision = Decision::accepted;
  verdict.reason = doubt;
}

void refuse(Verdict& verdict, Reason reason) {
  verdict.decision = Decision::refused;
  verdict.reason = reason;
}

void leave_open(Verdict& verdict, Reason reason) {
  verdict.decision = Decision::deferred;
  verdict.reason = reason;
}

void sort_once_each(std::vector<Hash>& hashes) {
  std::sort(hashes.begin(), hashes.end());
  hashes.erase(std::unique(hashes.begin(), hashes.end()), hashes.end());
}

}  // namespace

Verdict unseen(const MapId& a, const MapId& b, const TierId& by, std::string kind) {
  Verdict verdict;
  verdict.a = a;
  verdict.b = b;
  verdict.by = by;
  verdict.kind = std::move(kind);
  refuse(verdict, Reason::little_overlap);
  return verdict;
}

void set_aside(Verdict& verdict, Reason reason) { refuse(verdict, reason); }

void veto(Verdict& verdict) { verdict.reason = Reason::vetoed; }

void doubt_as(Verdict& verdict, const Judgement& likeliest, double overlap, Reason otherwise) {
  verdict.probability = likeliest.probability;
  verdict.overlap = overlap;
  verdict.conflict = likeliest.evidence.conflict;
  verdict.second_best = likeliest.evidence.second_best_ratio;
  verdict.reason = likeliest.doubt == Reason::none ? otherwise : likeliest.doubt;
  if (is_open(verdict.reason)) verdict.decision = Decision::deferred;
}

void set_witnesses(Verdict& verdict, std::vector<Hash> witnesses) {
  sort_once_each(witnesses);
  verdict.witnesses = std::move(witnesses);
}

void decide_by_cameras(Verdict& verdict, const VisualSupport& support, const FusionOptions& options) {
  // Maps bend, and so a few may disagree a little. Few that lie far off are enough to say that something is there
  // twice: in halves of public recordings and in apartments not one does.
  constexpr std::size_t kFew = 2, kOneIn = 12;
  const bool is_there_twice = support.far_rivals >= kFew && kOneIn * support.far_rivals >= support.witnesses;
  const bool are_enough = support.witnesses >= static_cast<std::size_t>(options.min_witnesses) ||
                          (support.sole_probability && *support.sole_probability >= options.sole_witness_probability);
  if (support.rival > options.max_rival || is_there_twice)
    leave_open(verdict, Reason::ambiguous);
  else if (!are_enough)
    leave_open(verdict, Reason::too_few_witnesses);
  else
    accept(verdict);
}

void doubt_as_repeated(Verdict& verdict, const std::vector<Hash>& because) {
  leave_open(verdict, Reason::ambiguous);
  verdict.contradicted.insert(verdict.contradicted.end(), because.begin(), because.end());
  sort_once_each(verdict.contradicted);
}

void accept_by_lasers(Verdict& verdict, double log_odds) {
  accept(verdict);
  verdict.probability = 1.0 / (1.0 + std::exp(-log_odds));
}

void doubt_by_lasers(Verdict& verdict, const LaserDoubt& doubt, const WallAgreement& walls,
                     const FusionOptions& options) {
  verdict.probability = doubt.probability;
  verdict.second_best = doubt.rival;
  verdict.conflict = walls.conflict();
  verdict.overlap = walls.overlap;
  if (doubt.has_other_widths)
    refuse(verdict, Reason::other_widths);
  else if (doubt.log_odds > 0.0 || doubt.repeats)
    leave_open(verdict, doubt.repeats || doubt.rival > options.max_rival ? Reason::ambiguous : Reason::little_evidence);
  else if (walls.contradicted_m * kContradictionWeight < doubt.unique_m)
    leave_open(verdict, Reason::little_evidence);
  else
    refuse(verdict, Reason::contradiction);
}

void accept_grids(Verdict& verdict, Reason doubt) { accept(verdict, doubt); }

void refuse_grids(Verdict& verdict, Reason doubt, bool is_vetoed) {
  if (is_vetoed)
    refuse(verdict, Reason::vetoed);
  else if (doubt == Reason::none)
    leave_open(verdict, Reason::inconsistent);
  else if (is_open(doubt) || doubt == Reason::inconsistent)
    leave_open(verdict, doubt);
  else
    refuse(verdict, doubt);
}

namespace {

std::vector<PairHypothesis> both(const std::vector<PairHypothesis>& first, const std::vector<PairHypothesis>& second) {
  // The best of each, however many there are of the first.
  const std::size_t of_second = std::min(
      second.size(), std::max<std::size_t>(1, kMostPairHypotheses - std::min(first.size(), kMostPairHypotheses)));
  std::vector<PairHypothesis> all(first.begin(), first.begin() + static_cast<std::ptrdiff_t>(std::min(
                                                                     first.size(), kMostPairHypotheses - of_second)));
  all.insert(all.end(), second.begin(), second.begin() + static_cast<std::ptrdiff_t>(of_second));
  return all;
}

}  // namespace

Verdict combined(const Verdict& laser, const Verdict& seen, const SenseChecks& checks, const FusionOptions& options) {
  const bool by_laser = laser.decision == Decision::accepted, by_camera = seen.decision == Decision::accepted;
  if (by_laser && by_camera) {
    Verdict verdict = laser;
    verdict.kind = "laser and vision";
    verdict.hypotheses = both(laser.hypotheses, seen.hypotheses);
    verdict.witnesses.insert(verdict.witnesses.end(), seen.witnesses.begin(), seen.witnesses.end());
    std::sort(verdict.witnesses.begin(), verdict.witnesses.end());
    verdict.probability = 1.0 - (1.0 - laser.probability) * (1.0 - seen.probability);
    if (!checks.do_lie_alike()) leave_open(verdict, Reason::ambiguous);
    return verdict;
  }
  if (by_camera) {
    Verdict verdict = seen;
    verdict.hypotheses = both(seen.hypotheses, laser.hypotheses);
    verdict.merge = laser.merge;
    verdict.conflict = std::max(verdict.conflict, checks.wall_conflict());
    if (verdict.conflict > options.max_wall_conflict) refuse(verdict, Reason::contradiction);
    return verdict;
  }
  Verdict verdict = laser;
  verdict.hypotheses = both(laser.hypotheses, seen.hypotheses);
  if (by_laser && checks.do_cameras_contradict()) {
    refuse(verdict, Reason::contradiction);
    verdict.kind = "laser and vision";
  }
  return verdict;
}

void refuse_as_inconsistent(Verdict& verdict) { refuse(verdict, Reason::inconsistent); }

void refuse_by_audit(Verdict& verdict) { refuse(verdict, Reason::contradiction); }

}  // namespace mapweave::fusion
