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
      Eigen::Matrix<double, 6, 6>::Zero();  // of a small motion of b in b's frame, order as Constraint; planar: x, y, yaw
};

// What speaks for and against the best hypothesis.
struct Evidence {
  double overlap_m2 = 0.0;  // known cells that coincide
  double overlap = 0.0;     // |A and B| / min(|A|, |B|) in known cells, 0..1
  double inliers = 0.0;     // of the wall points of each that the other could see, share that finds a wall there, 0..1; the lower side
  double conflict = 0.0;    // of the walls of each that the other saw, the share that the other saw through; the higher side
  double longest_contradiction_m[2] = {0.0, 0.0};           // longest wall of a that b saw through, and of b that a saw through
  double second_best_ratio = 0.0;                           // score of the best distinct rival over the best, 0..1
  double verifier_inliers = 0.0;                            // the independent second verifier's, 0..1
  double verifier_disagreement_m = 0.0;                     // how far it moved the alignment
  Eigen::Vector3d observability = Eigen::Vector3d::Zero();  // along the better and the worse direction, and in yaw; 0..1
};

enum class Reason : std::uint8_t {
  none = 0,
  little_overlap = 1,
  contradiction = 2,
  ambiguous = 3,
  unobservable = 4,
  inconsistent = 5,
  vetoed = 6,
  too_few_witnesses = 7
};

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

// Whether two maps join, and how we know.
struct Verdict {
  MapId a, b;  // a < b
  TierId by;
  std::string kind = "laser";  // laser, vision, laser and vision, grid
  std::string proposer;        // what proposed the alignment: "descriptor", "exhaustive", ...
  Decision decision = Decision::deferred;
  Reason reason = Reason::none;
  std::optional<Alignment> alignment;  // in the frames of the two maps; of the best cluster, also where it was not accepted
  double probability = 0.0;
  double overlap = 0.0, conflict = 0.0, second_best = 0.0;  // of the two maps under the alignment
  std::vector<Hash> witnesses, contradicted;                // judgements that hold, and that were overruled
  double seconds = 0.0;                                     // spent on it; not part of a sealed result
};

std::string_view to_text(Reason);
std::string_view to_text(Decision);

}  // namespace mapweave
