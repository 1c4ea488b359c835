#pragma once
// Two layers of decision. A judgement is pure in two frozen contents, made once and cached by hash. A
// verdict (commitment) is pure in the set of all judgements.

#include <mapweave/core/geometry.h>
#include <mapweave/core/hash.h>
#include <mapweave/core/ids.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave {

struct Alignment {
  Sim3 a_from_b;
  Eigen::Matrix<double, 6, 6> covariance =
      Eigen::Matrix<double, 6,
                    6>::Zero();  // of a small motion of b in b's frame, ordered as Constraint; planar: x, y, yaw
};

// What speaks for and against the best hypothesis.
struct Evidence {
  double overlap_m2 = 0.0;  // known cells that coincide
  double overlap = 0.0;     // |A and B| / min(|A|, |B|) in known cells, 0..1
  double inliers =
      0.0;  // share of one map's visible wall points that find a wall in the other, 0..1; lower of both sides
  double conflict = 0.0;  // share of one map's looked-at walls that the other saw through, 0..1; higher of both sides
  double longest_contradiction_m[2] = {0.0, 0.0};  // longest wall of a that b saw through, and of b that a saw through
  double second_best_ratio = 0.0;                  // score of the best distinct rival over the best, 0..1
  double verifier_inliers = 0.0;                   // share of inliers of the second verifier (ICP), 0..1
  double verifier_disagreement_m = 0.0;            // distance by which the second verifier moved the alignment
  Eigen::Vector3d observability = Eigen::Vector3d::Zero();  // along the better and the worse direction, in yaw; 0..1
};

enum class Reason : std::uint8_t {
  none = 0,
  little_overlap = 1,
  contradiction = 2,
  ambiguous = 3,
  unobservable = 4,
  inconsistent = 5,
  vetoed = 6,
  too_few_witnesses = 7,
  excluded = 8,          // the user wants the two maps not to be matched
  same_recording = 9,    // the two maps hold the same scans
  little_evidence = 10,  // walls that fit, but so few that it may be chance
  other_widths = 11      // walls coincide, but rooms are wider in one map than in the other
};

inline constexpr double kProbabilityOfDoubt = 0.1;  // what a doubt leaves of a probability: below any threshold

struct Judgement {
  Hash id;        // hash of a, b, matcher and options
  SubmapId a, b;  // a < b
  Hash content_a, content_b;
  std::vector<Alignment> hypotheses;  // best first; may be empty
  std::vector<double> scores;         // score of each hypothesis, 0..1
  Evidence evidence;                  // evidence of the best hypothesis
  double probability = 0.0;           // probability of the best hypothesis
  Reason doubt = Reason::none;        // why the probability is low
};

enum class Decision : std::uint8_t { accepted = 0, refused = 1, deferred = 2 };

// What a hypothesis rests on, which says what its numbers mean: walls of lasers, whole map_server grids, pictures.
enum class Sense : std::uint8_t { lasers = 0, grids = 1, cameras = 2 };

// One way in which two maps may lie to each other, with what speaks for and against it: metres of wall of both (of
// grids the mean of both), places of cameras.
struct PairHypothesis {
  Sense sense = Sense::lasers;
  Sim3 a_from_b;
  std::uint32_t matches = 0;       // pairs of places of both maps that agree on it
  double log_odds = 0.0;           // log odds that it is right, with those of a prior
  double prior_log_odds = 0.0;     // part of log_odds that a prior adds
  double coinciding_m = 0.0;       // walls that both maps have at one place
  double distinctive_m = 0.0;      // walls that fit here and nowhere around
  double wider_m = 0.0;            // b's rooms are at least so much wider where walls coincide; negative: narrower
  double contradicted_m = 0.0;     // walls that the other robot saw through
  double unclear_m = 0.0;          // walls where the other robot looked and saw neither
  double counted_unclear_m = 0.0;  // part of unclear_m that counts against it; less where maps overlap little
  double by_chance_m = 0.0;        // walls that would fit by chance
  double support_m = 0.0;          // grids: walls that fit, weighed by how unusual that is, less walls in free space
  double overlap = 0.0;            // share of the smaller map's walls that lie where the other one looked
  std::uint32_t elsewhere = 0;     // cameras: pairs of places that imply another alignment
  bool is_of_teams = false;        // the numbers are of all maps of the two teams that the maps were in then
  bool is_taken_apart = false;     // a team had the maps so until its audit; how unusual is what fits was not weighed
  struct ContradictedWall {
    double x_m = 0.0, y_m = 0.0;  // a's map frame
    double length_m = 0.0;
  };
  std::vector<ContradictedWall> contradictions;  // longest first
};
constexpr std::size_t kMostPairHypotheses = 4;  // most hypotheses that a verdict reports

// A user's prior on how two maps lie to each other, and whether the maps agree.
struct PriorCheck {
  Pose2 a_from_b;  // the prior's transform as the user gave it
  double sigma_m = 0.0, sigma_rad = 0.0;
  bool is_contradicted = false;
  std::optional<double> off_m, off_rad;             // error of the prior against the merged maps, or else the best fit
  double coinciding_m = 0.0, contradicted_m = 0.0;  // walls under the prior's transform
};

// The merge of two teams that brought two maps into one map.
struct TeamMerge {
  std::vector<MapId> of, with;  // maps of both teams, sorted; the team with the lowest id first
  double probability = 0.0;     // probability of the merge when it was decided
  std::string proposer;         // what proposed the merge, as Verdict::proposer
};

// Two maps that lie in one team map, whether they were matched to each other or not.
struct InOneMap {
  Sim3 a_from_b;               // transform in the merged map
  std::vector<MapId> through;  // the maps between them on the shortest path of matched pairs that is not their own;
                               // empty: there is none
};

// Whether two maps are merged, and how we know.
struct Verdict {
  MapId a, b;  // a < b
  TierId by;
  std::string kind = "laser";  // laser, vision, laser and vision, grid
  std::string proposer;  // what proposed the alignment: "ring keys", "whole maps", "corners", "prior", "words", ...
  Decision decision = Decision::deferred;
  Reason reason = Reason::none;
  std::optional<Alignment> alignment;  // between the two maps' frames; of the best cluster, accepted or not
  double probability = 0.0;
  double overlap = 0.0, conflict = 0.0, second_best = 0.0;  // shares of walls of the two maps under the alignment
  std::vector<Hash> witnesses, contradicted;                // judgements that support the merge; that it overruled
  double seconds = 0.0;                                     // computing time; not part of a sealed result
  // What else is reported of the pair; stores do not keep it.
  std::vector<PairHypothesis> hypotheses;  // most probable first; the accepted one as the team map has it
  std::optional<PriorCheck> prior;
  std::string detail;  // more on the reason, with numbers; may be empty
  std::optional<TeamMerge> merge;
  std::optional<InOneMap> in_one_map;
};

std::string_view to_text(Reason);
std::string_view to_text(Decision);

}  // namespace mapweave
