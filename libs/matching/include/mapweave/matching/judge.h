#pragma once
// Is this the same place, and how do the two submaps lie? One answer for loops within a robot, between robots and
// between sessions: a judgement, pure in two frozen contents, the window asked about and the options.

#include <mapweave/maps/judgement.h>
#include <mapweave/matching/branch_and_bound.h>

#include <memory>
#include <optional>

namespace mapweave::matching {

struct JudgeOptions {
  double min_score = 0.42;
  double rival_ratio = 0.80;
  double min_overlap_m2 = 6.0;
  double min_inliers = 0.62;
  double max_conflict = 0.06;
  double max_contradiction_m = 0.9;
  double max_second_best = 0.92;
  double min_observability = 0.03;
  bool second_verifier = true;
  double min_verifier_inliers = 0.40;
  double max_verifier_disagreement_m = 0.25;
  int search_budget = 400000;
  template <class Visitor>
  void describe(Visitor& v) {
    v.fraction("min_score", min_score,
               "least mean likelihood of a scan's points in the other submap at which an alignment is considered; "
               "larger values miss "
               "places that look different");
    v.fraction("rival_ratio", rival_ratio,
               "alignments of two submaps that score at least this share of the best one's score are kept as rivals; "
               "larger values keep fewer of them");
    v.non_negative("min_overlap_m2", min_overlap_m2,
                   "least area in square metres that two submaps must both have seen to be taken for the same place; "
                   "larger values refuse more pairs of submaps");
    v.fraction("min_inliers", min_inliers,
               "least share of the walls that both submaps could see that both have; larger values refuse more pairs "
               "of submaps");
    v.fraction("max_conflict", max_conflict,
               "largest share of one submap's walls that may lie where the other submap's laser saw free space; larger "
               "values accept more pairs");
    v.positive("max_contradiction_m", max_contradiction_m,
               "longest single stretch of wall, in metres, that may lie where the other submap's laser saw free space; "
               "larger values accept more pairs of submaps");
    v.fraction("max_second_best", max_second_best,
               "a rival alignment that scores more than this share of the best one's score makes the pair of submaps "
               "ambiguous; larger "
               "values accept more pairs");
    v.fraction("min_observability", min_observability,
               "least constraint of the alignment along its weakest direction, from 0 (a bare corridor) to 1 (walls in "
               "all directions); larger values refuse more pairs of submaps");
    v.flag("second_verifier", second_verifier,
           "check each alignment of two submaps by an independent registration of oriented wall points (ICP); refuses "
           "more wrong pairs "
           "and takes longer");
    v.fraction("min_verifier_inliers", min_verifier_inliers,
               "least share of wall points that the second verifier (ICP) must pair within its reach; larger values "
               "refuse more pairs of submaps");
    v.positive("max_verifier_disagreement_m", max_verifier_disagreement_m,
               "largest distance in metres by which the second verifier (ICP) may move an alignment that was found by "
               "search; larger values accept more pairs of submaps");
    v.integer("search_budget", search_budget, 1000, 100000000,
              "most nodes that one branch-and-bound search of two submaps looks at; a search that reaches it keeps "
              "what it has found; "
              "larger values miss less and take longer");
  }
};

// A frozen submap with its caches.
struct SubmapView {
  SubmapId id;
  Hash content;
  std::shared_ptr<const SubmapModel> model;
};

// What speaks for and against an alignment: rays of each against walls of the other. Scores and verifier are left at
// zero.
Evidence weigh(const SubmapModel& a, const SubmapModel& b, const Pose2& a_from_b);

// Whose walls make the likelihood field; the walls of the other are laid into it. A judgement depends on it a little,
// so whoever wants judgements that do not depend on names chooses by content.
enum class Field : std::uint8_t { a, b };

// Identity of a judgement before it is made.
Hash judgement_id(const Hash& content_a, const Hash& content_b, const WideWindow&, const JudgeOptions&,
                  Field = Field::a);

// a.id < b.id. Always returns a judgement; one that found nothing has no hypotheses and probability 0.
Judgement judge(const SubmapView& a, const SubmapView& b, const WideWindow&, const JudgeOptions& = {},
                Field = Field::a);

// The independent second verifier (PCL): iterative closest point of wall points whose normals agree, started at the
// alignment. nullopt where there are too few points.
struct Verification {
  double inliers = 0.0;  // share of b's points within sight of a that find a partner within 0.15 m and 30 degrees
  double disagreement_m = 0.0;  // at b's centre of walls
  double disagreement_rad = 0.0;
};
std::optional<Verification> verify(const SubmapModel& a, const SubmapModel& b, const Pose2& a_from_b);

}  // namespace mapweave::matching
