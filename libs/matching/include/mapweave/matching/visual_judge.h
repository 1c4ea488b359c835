#pragma once
// Is this the same place, as far as cameras can tell, and how do the two sides lie (CORB-SLAM 2.2, map overlap
// detection)? A judgement like the laser's (judge.h), pure in two frozen contents and the options: candidates by
// descriptors, RANSAC on PnP, SE3 or Sim3, a guided search for more, least squares over what was found, and what speaks
// against it.

#include <mapweave/maps/judgement.h>
#include <mapweave/matching/alignment_search.h>
#include <mapweave/matching/feature_matching.h>

#include <vector>

namespace mapweave::matching {

struct VisualJudgeOptions {
  MatchingOptions matching;
  AlignmentOptions alignment;
  double sigma_px = 1.0;
  double guided_radius_px = 8.0;
  int guided_max_distance = 64;
  int neighbours = 3;
  int min_inliers = 20;
  double min_found = 0.06;
  double max_conflict = 0.35;
  double max_second_best = 0.55;
  double min_spread = 0.12;
  template <class Visitor>
  void describe(Visitor& v) {
    v.section("matching", matching,
              "matching of ORB descriptors between two keyframes, which gives candidates for pairs of features");
    v.section("alignment", alignment, "alignment of two keyframes by sampling (RANSAC) and least squares");
    v.positive("sigma_px", sigma_px,
               "standard deviation in pixels of an ORB feature on the lowest pyramid level; larger values accept worse "
               "matches as inliers");
    v.positive("guided_radius_px", guided_radius_px,
               "radius in pixels around the projection of a landmark within which its feature is looked for once a "
               "first alignment is known; larger values find more matches and more wrong ones");
    v.integer("guided_max_distance", guided_max_distance, 1, 256,
              "most bits of 256 in which a feature found by projection may differ from the landmark's descriptor; "
              "larger values find more matches and more wrong ones");
    v.integer("neighbours", neighbours, 0, 100,
              "number of covisible keyframes on each side whose features are matched too where those of the two "
              "keyframes alone do not suffice; at most fusion.visual.covisible take part; larger values recognise more "
              "places and take longer");
    v.integer("min_inliers", min_inliers, 4, 100000,
              "least number of matches that must agree with the alignment of two keyframes; larger values refuse more "
              "pairs of keyframes");
    v.fraction("min_found", min_found,
               "least share of the landmarks expected in the other keyframe's view that must be found there; larger "
               "values refuse more pairs of keyframes");
    v.fraction("max_conflict", max_conflict,
               "largest share of the landmarks expected in the other keyframe's view that it may have seen through to "
               "something farther; larger values accept more pairs of keyframes");
    v.fraction("max_second_best", max_second_best,
               "a distinct rival alignment with more than this share of the best one's matches makes the pair of "
               "keyframes ambiguous; larger values accept more pairs of keyframes");
    v.fraction("min_spread", min_spread,
               "least extent of the matches over the pictures along the narrower direction, as a share of the "
               "picture's size; matches in one corner align badly; larger values refuse more pairs of keyframes");
  }
};

// Views own nothing but their lists; what they point at outlives the call.
struct LandmarkView {
  Eigen::Vector3d point_in_side;
  OrbDescriptor descriptor{};
};

struct KeyframeView {
  NodeId id;
  Pinhole camera;
  Pose3 side_from_camera;
  FeaturesView features;
  const std::int32_t* landmark_of_feature =
      nullptr;               // index into the side's landmarks, -1: none; null: no feature has one
  double level_scale = 1.2;  // of the pyramid
};

// A keyframe with its neighbours and the landmarks they see. The side's frame is the caller's choice (the keyframe's
// camera, the robot in its place, a submap); judgements speak of it.
struct PlaceView {
  SubmapId id;         // names the side in the judgement: a visual map's submap, or session and index of the keyframe
  Hash content;        // of all that follows
  bool metric = true;  // false: monocular, scale unknown
  std::vector<KeyframeView> keyframes;  // the one asked about first, then neighbours, best first
  std::vector<LandmarkView> landmarks;  // of a picture without a map: none
};

struct FeatureId {
  std::uint32_t keyframe = 0, feature = 0;  // index into the side's keyframes and their features
};

struct VisualJudgement {
  // Evidence: `inliers` is the share of the landmarks expected in the other's picture that were found there (the lower
  // of the sides that have landmarks), `conflict` the share that the other saw through, `overlap` the share of the
  // pictures over which matches lie, `observability` how wide they lie (wider, narrower direction) and 1;
  // `verifier_inliers` the share of matches whose landmarks, where both sides have one, meet in space. What concerns
  // areas and walls stays 0.
  Judgement judgement;
  struct Match {
    FeatureId a, b;
  };
  std::vector<Match> matches;  // of the best hypothesis
};

Hash visual_judgement_id(const Hash& content_a, const Hash& content_b, const VisualJudgeOptions&);

// a.id < b.id. Always answers; what found nothing has no hypotheses and probability 0. Scale is solved for where one
// side is not metric; that takes landmarks on both sides, else landmarks on one side are enough (a picture that is
// looked for in a map).
VisualJudgement judge_places(const PlaceView& a, const PlaceView& b, const VisualJudgeOptions& options = {});

}  // namespace mapweave::matching
