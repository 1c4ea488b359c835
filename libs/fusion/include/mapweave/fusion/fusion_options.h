#pragma once
// Options of fuse().

#include <mapweave/fusion/grid_pair.h>
#include <mapweave/graph/pose_graph.h>
#include <mapweave/maps/map_noise.h>
#include <mapweave/matching/binary_vocabulary.h>
#include <mapweave/matching/judge.h>
#include <mapweave/matching/rematch.h>
#include <mapweave/matching/visual_judge.h>
#include <mapweave/rig/laser_camera_alignment.h>

namespace mapweave::fusion {

// Of keyframes.
struct VisualFusionOptions {
  int candidates = 4;
  int most_pairs = 120;
  int enough_witnesses = 6;
  int covisible = 3;
  double least_alike = 0.3;
  int adjustments = 2;
  double sigma_px = kLandmarkSigma_px;
  double inverse_depth_sigma = kInverseDepthSigma_per_m;
  matching::VisualJudgeOptions judge;
  matching::ChosenVocabulary vocabulary;  // the run's
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("candidates", candidates, 1, 1000,
              "number of most similar keyframes of another map that each keyframe is compared with; larger values find "
              "more common "
              "places and take longer");
    v.integer("most_pairs", most_pairs, 1, 1000000,
              "most pairs of keyframes that are compared for one pair of camera maps; larger values find more common "
              "places and take longer");
    v.integer("enough_witnesses", enough_witnesses, 1, 1000000,
              "number of agreeing pairs of different keyframes, contradicted by none, after which further pairs at the "
              "same place are not compared; larger values compare more pairs and take longer");
    v.integer("covisible", covisible, 0, 100,
              "number of covisible keyframes whose landmarks are added to each side when two keyframes of different "
              "maps are compared; of these, fusion.visual.judge.neighbours have their features matched as well; larger "
              "values recognise more places and take longer");
    v.fraction("least_alike", least_alike,
               "least similarity of two keyframes to be compared, as a share of the similarity of consecutive "
               "keyframes; larger values "
               "compare fewer pairs");
    v.integer("adjustments", adjustments, 0, 100,
              "rounds of matching the landmarks that camera maps share and of bundle adjustment over all maps; larger "
              "values are more accurate and slower; 0 leaves the pose graph's result");
    v.positive("sigma_px", sigma_px,
               "standard deviation in pixels of where a landmark is seen in the full picture, for the bundle "
               "adjustment of merged camera maps; larger values trust pixels less against measured depths");
    v.positive("inverse_depth_sigma", inverse_depth_sigma,
               "standard deviation of a measured inverse depth in 1/m, for the bundle adjustment of merged camera "
               "maps; larger values trust measured depths less");
    v.section("judge", judge, "when keyframes of two camera maps are taken for the same place");
  }
};

// What says where two laser maps may lie on each other, in the order in which they are asked: the next one where the
// two stay apart. `ring_keys`: submaps that look alike; `corners`: matching/corner_proposals.h; `whole_maps`: walls and
// free space of both as images (matching/grid_proposals.h).
enum class Proposer : std::uint8_t { prior, ring_keys, corners, whole_maps };

struct FusionOptions {
  int candidates_per_submap = 4;
  int most_pairs = 400;
  Proposer last_proposer = Proposer::whole_maps;
  double stride_m = 4.0;
  double consistency_m = 0.35;
  double consistency_per_m = 0.02;
  double consistency_yaw_rad = 0.06;
  int min_witnesses = 2;
  double sole_witness_probability = 0.999;
  double min_probability = 0.6;
  double merge_probability = 0.95;
  double max_wall_conflict = 0.15;
  double max_rival = 0.3;
  int cache_mb = 512;
  matching::JudgeOptions judge;
  matching::RematchOptions rematch;
  graph::SolveOptions solve;
  VisualFusionOptions visual;
  GridPairOptions grids;
  rig::LaserCameraOptions laser_cameras;  // of the robots' own maps as well, so no option here
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("candidates_per_submap", candidates_per_submap, 1, 1000,
              "number of most similar submaps of another map that each submap is compared with; larger values find "
              "more common places "
              "and take longer");
    v.integer("most_pairs", most_pairs, 1, 1000000,
              "most pairs of submaps that are compared for one pair of laser maps; larger values find more common "
              "places and take longer");
    v.choice("last_proposer", last_proposer,
             {{"ring-keys", Proposer::ring_keys}, {"corners", Proposer::corners}, {"whole-maps", Proposer::whole_maps}},
             "last of the searches for where two laser maps that stay apart may lie on each other: ring-keys (submaps "
             "that look alike), then corners (corners of walls, aligned by PCL), then whole-maps (images of walls and "
             "free space); later ones find more merges and take longer");
    v.non_negative("stride_m", stride_m,
                   "distance in metres between the submaps of one map that take part in the first search, each of "
                   "which represents its neighbours; larger values are faster and may miss common places, 0 takes all");
    v.positive(
        "consistency_m", consistency_m,
        "two matches between camera maps agree when the transforms they imply differ by less than this distance in "
        "metres; larger values accept more merges of camera maps; laser maps use the pose graph's covariance instead");
    v.non_negative("consistency_per_m", consistency_per_m,
                   "growth of consistency_m (camera maps) in metres per metre between the places of the two matches, "
                   "since maps bend with distance; larger values accept more merges of camera maps that bend");
    v.positive("consistency_yaw_rad", consistency_yaw_rad,
               "two matches between camera maps agree when the headings they imply differ by less than this angle in "
               "radians; larger values accept more merges of camera maps");
    v.integer("min_witnesses", min_witnesses, 1, 1000,
              "number of agreeing matches of different keyframes from which two camera maps are merged; larger values "
              "leave more camera maps apart");
    v.fraction("sole_witness_probability", sole_witness_probability,
               "probability from which a single match of two keyframes is enough to merge their camera maps; larger "
               "values leave more camera maps apart");
    v.fraction("min_probability", min_probability,
               "least probability that two submaps or keyframes show one place for their match to support a merge; "
               "larger values leave more maps apart");
    v.fraction("merge_probability", merge_probability,
               "least probability from which two laser maps are merged; larger values leave more maps apart");
    v.fraction("max_wall_conflict", max_wall_conflict,
               "largest share of walls in the other map's free space at which maps that cameras alone have aligned are "
               "merged (robots with laser and camera); larger values merge more maps");
    v.fraction("max_rival", max_rival,
               "largest weight of another alignment of two maps, as a share of the best one's, at which the pair still "
               "counts as unambiguous; larger values merge more maps");
    v.integer("cache_mb", cache_mb, 1, 100000,
              "memory in megabytes for submaps that are kept ready for matching; larger values are faster and give the "
              "same map");
    v.section("judge", judge, "when submaps of two robots are taken for the same place");
    v.section("rematch", rematch, "matching scans to submaps of other robots again once their maps are aligned");
    v.section("solve", solve, "optimisation of the joint pose graph of merged maps");
    v.section("visual", visual, "merging camera maps (keyframes and landmarks)");
    v.section("grids", grids, "merging occupancy grids of other programs (map_server files), which have no scans");
  }
};

}  // namespace mapweave::fusion
