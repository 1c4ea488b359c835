#pragma once
// Every verdict about two maps, with its reason: merged, refused, or left open. Others count what speaks for and
// against a merge; what follows from the counts is decided here, for cameras and for both senses together. Lasers and
// grids merge by whole maps (laser/merge_evaluation.cpp, grid/grid_pair.cpp): here is said what that means for a pair.
// What a judge doubts of two places or of two grids it says in its judgement (matching/judge.h, grid_pair.h), and that
// doubt may become a verdict's reason here.

#include <mapweave/fusion/fusion_options.h>
#include <mapweave/maps/judgement.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::fusion {

struct WallAgreement;

// Refused for little overlap, until something is found that the two maps share.
Verdict unseen(const MapId& a, const MapId& b, const TierId& by, std::string kind);
// Nothing is compared: the user excluded the pair, or the two hold the same recording.
void set_aside(Verdict& verdict, Reason reason);
// A judgement of them was vetoed, and nothing else holds.
void veto(Verdict& verdict);
// No judgement holds. `likeliest`: the best of those that do not; the verdict gets its numbers and its doubt, or
// `otherwise` where it has none.
void doubt_as(Verdict& verdict, const Judgement& likeliest, double overlap,
              Reason otherwise = Reason::too_few_witnesses);
// Judgements that hold count once each.
void set_witnesses(Verdict& verdict, std::vector<Hash> witnesses);

// What speaks for cameras' best alignment of two maps: witnesses of which no two share a keyframe.
struct VisualSupport {
  std::size_t witnesses = 0;
  std::size_t far_rivals = 0;              // that put the second map far elsewhere
  double rival = 0.0;                      // weight of the best rival over that of the best alignment
  std::optional<double> sole_probability;  // of a witness that is the only one
};
void decide_by_cameras(Verdict& verdict, const VisualSupport& support, const FusionOptions& options);
// What it rests on looks like other places; `because` says so.
void doubt_as_repeated(Verdict& verdict, const std::vector<Hash>& because);

// Lasers decide by hypotheses of whole maps (laser_team.h); here is said what that means for a pair.
void accept_by_lasers(Verdict& verdict, double log_odds);
// The pair's best hypothesis, where it was not merged. `walls`: of both maps, as that one lays them.
struct LaserDoubt {
  double log_odds = 0.0, probability = 0.0;
  double rival = 0.0;             // probability of the second best hypothesis over that of the best
  bool repeats = false;           // what fits looks like other places of the same maps
  bool has_other_widths = false;  // more would speak for it than against it, were rooms as wide in both maps
  double unique_m = 0.0;          // wall that speaks for it
};
void doubt_by_lasers(Verdict& verdict, const LaserDoubt& doubt, const WallAgreement& walls,
                     const FusionOptions& options);

// Of two map_server grids, aligned as a whole. `doubt`: of that alignment, none where it is sure; then a third grid
// contradicts.
void accept_grids(Verdict& verdict, Reason doubt);
void refuse_grids(Verdict& verdict, Reason doubt, bool is_vetoed);

// What one sense says of a merge that the other one believes in. Each is asked only where it decides.
struct SenseChecks {
  std::function<bool()> do_lie_alike;           // both senses lay the maps the same way
  std::function<double()> wall_conflict;        // of the walls, as cameras lay the maps
  std::function<bool()> do_cameras_contradict;  // as lasers lay the maps
};
// One verdict of two senses. What one believes, the other must not contradict.
Verdict combined(const Verdict& laser, const Verdict& seen, const SenseChecks& checks, const FusionOptions& options);

// The pair contradicts the other merges of its team.
void refuse_as_inconsistent(Verdict& verdict);
// Merged, the two showed walls twice.
void refuse_by_audit(Verdict& verdict);

}  // namespace mapweave::fusion
