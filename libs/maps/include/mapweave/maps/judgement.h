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
                    6>::Zero();  // of a small motion of b in b's frame, order as Constraint; planar: x, y, yaw
};

// What speaks for and against the best hypothesis.
struct Evidence {
  double overlap_m2 = 0.0;  // known cells that coincide
  double overlap = 0.0;     // |A and B| / min(|A|, |B|) in known cells, 0..1
  double inliers =
      0.0;  // of the wall points of each that the other could see, share that finds a wall there, 0..1; the lower side
  double conflict =
      0.0;  // of the walls of each that the other saw, the share that the other saw through; the higher side
  double longest_contradiction_m[2] = {0.0, 0.0};  // longest wall of a that b saw through, and of b that a saw through
  double second_best_ratio = 0.0;                  // score of the best distinct rival over the best, 0..1
  double verifier_inliers = 0.0;                   // the independent second verifier's, 0..1
  double verifier_disagreement_m = 0.0;            // how far it moved the alignment
  Eigen::Vector3d observability =
      Eigen::Vector3d::Zero();  // along the better and the worse direction, and in yaw; 0..1
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
  Hash id;        // of a, b, matcher and options
  SubmapId a, b;  // a < b
  Hash content_a, content_b;
  std::vector<Alignment> hypotheses;  // best first; may be empty
  std::vector<double> scores;         // of the hypotheses, 0..1
  Evidence evidence;                  // of the best
  double probability = 0.0;           // that the best is right
  Reason doubt = Reason::none;        // why the probability is low
};

enum class Decision : std::uint8_t { accepted = 0, refused = 1, deferred = 2 };

// What a hypothesis rests on, which says what its numbers are: regions of lasers, whole map_server grids, pictures.
enum class Sense : std::uint8_t { lasers = 0, grids = 1, cameras = 2 };

// One way in which two maps may lie to each other, with what speaks for and against it: metres of wall of both (of
// grids the mean of both), places of cameras.
struct PairHypothesis {
  Sense sense = Sense::lasers;
  Sim3 a_from_b;
  std::uint32_t matches = 0;       // of places of both maps that agree on it
  double log_odds = 0.0;           // that it is right, by itself; the prior's are among them
  double prior_log_odds = 0.0;     // that a prior adds
  double coinciding_m = 0.0;       // walls of both
  double distinctive_m = 0.0;      // that fit here and nowhere around
  double wider_m = 0.0;            // b's rooms are at least so much wider where walls coincide; negative: narrower
  double contradicted_m = 0.0;     // that the other one saw through
  double unclear_m = 0.0;          // where the other one looked and saw neither
  double counted_unclear_m = 0.0;  // of these, what speaks against it: where maps overlap little, views just end
  double by_chance_m = 0.0;        // that would fit by chance
  double support_m = 0.0;          // of grids: what fits, by how unusual that is, less what lies in free space
  double overlap = 0.0;            // share of the smaller map's walls that lie where the other one looked
  std::uint32_t elsewhere = 0;     // of cameras: places that put the maps otherwise
  bool is_of_teams = false;        // the numbers are of all maps of the two teams that the maps were in then
  bool is_taken_apart = false;     // a team had the maps so until its audit; how unusual is what fits was not weighed
  struct Place {
    double x_m = 0.0, y_m = 0.0;  // a's map frame
    double length_m = 0.0;
  };
  std::vector<Place> contradictions;  // longest first
};
constexpr std::size_t kMostPairHypotheses = 4;  // that a verdict reports

// Where somebody said that two maps lie to each other, and what the maps say to it.
struct PriorCheck {
  Pose2 a_from_b;  // as it was given
  double sigma_m = 0.0, sigma_rad = 0.0;
  bool is_contradicted = false;
  std::optional<double> off_m, off_rad;             // from it to where the maps were merged, or else fit best
  double coinciding_m = 0.0, contradicted_m = 0.0;  // walls, where it puts the maps
};

// By which two maps came into one: of all maps of one team with all of another.
struct TeamMerge {
  std::vector<MapId> of, with;  // sorted; the first one's lowest id is the lowest
  double probability = 0.0;     // that it is right, as it was decided
  std::string proposer;         // as in a verdict
};

// Two maps that lie in one team map, whether they were matched to each other or not.
struct InOneMap {
  Sim3 a_from_b;               // as that map has them
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
  std::optional<Alignment>
      alignment;  // in the frames of the two maps; of the best cluster, also where it was not accepted
  double probability = 0.0;
  double overlap = 0.0, conflict = 0.0, second_best = 0.0;  // of the two maps under the alignment
  std::vector<Hash> witnesses, contradicted;                // judgements that hold, and that were overruled
  double seconds = 0.0;                                     // spent on it; not part of a sealed result
  // What else is reported of the pair; stores do not keep it.
  std::vector<PairHypothesis> hypotheses;  // most probable first; of the accepted one, as the team has it
  std::optional<PriorCheck> prior;
  std::string detail;  // more on the reason, with numbers; may be empty
  std::optional<TeamMerge> merge;
  std::optional<InOneMap> in_one_map;
};

std::string_view to_text(Reason);
std::string_view to_text(Decision);

}  // namespace mapweave
