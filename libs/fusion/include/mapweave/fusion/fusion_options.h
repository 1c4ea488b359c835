#pragma once
// Options of fuse().

#include <mapweave/fusion/grid_pair.h>
#include <mapweave/graph/pose_graph.h>
#include <mapweave/maps/map_noise.h>
#include <mapweave/matching/judge.h>
#include <mapweave/matching/rematch.h>
#include <mapweave/matching/visual_judge.h>

namespace mapweave::fusion {

// Of keyframes.
struct VisualFusionOptions {
  int candidates = 4;
  int most_pairs = 120;
  int enough_witnesses = 6;
  int companions = 3;
  double least_alike = 0.3;
  int adjustments = 2;
  double sigma_px = kLandmarkSigma_px;
  double inverse_depth_sigma = kInverseDepthSigma_per_m;
  matching::VisualJudgeOptions judge;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("candidates", candidates, 1, 1000, "keyframes of another map, most alike first, that each keyframe is compared with");
    v.integer("most_pairs", most_pairs, 1, 1000000, "pairs of keyframes compared for one pair of maps");
    v.integer("enough_witnesses", enough_witnesses, 1, 1000000,
              "of different keyframes, that agree and that nothing contradicts: then pairs beside theirs are not judged");
    v.integer("companions", companions, 0, 100, "keyframes that see most of the same landmarks and speak with each");
    v.fraction("least_alike", least_alike, "share of the likeness of two keyframes in a row, below which two places are not compared");
    v.integer("adjustments", adjustments, 0, 100, "rounds of finding landmarks that two maps share and adjusting the bundle of all");
    v.positive("sigma_px", sigma_px, "error of a landmark's place in the full picture");
    v.positive("inverse_depth_sigma", inverse_depth_sigma, "error of the inverse of a measured depth, 1/m");
    v.section("judge", judge, "when two keyframes show the same place");
  }
};

struct FusionOptions {
  int candidates_per_submap = 4;
  int most_pairs = 400;
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
  int cache_mb = 128;
  matching::JudgeOptions judge;
  matching::RematchOptions rematch;
  graph::SolveOptions solve;
  VisualFusionOptions visual;
  GridPairOptions grids;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("candidates_per_submap", candidates_per_submap, 1, 1000,
              "submaps of another map, most alike first, that each submap is compared with");
    v.integer("most_pairs", most_pairs, 1, 1000000, "submap pairs compared for one pair of maps");
    v.non_negative("stride_m", stride_m, "submaps of one map nearer to each other than this stand for each other in the first search");
    v.positive("consistency_m", consistency_m,
               "two judgements of cameras agree when the transforms they imply differ by less than this (lasers: by the graph's uncertainty)");
    v.non_negative("consistency_per_m", consistency_per_m, "and this more per metre between their places");
    v.positive("consistency_yaw_rad", consistency_yaw_rad, "and by less than this in heading");
    v.integer("min_witnesses", min_witnesses, 1, 1000, "judgements of different keyframes that must agree before two maps of cameras are merged");
    v.fraction("sole_witness_probability", sole_witness_probability, "probability from which a single judgement of two keyframes is enough to merge their maps");
    v.fraction("min_probability", min_probability, "of a judgement, to be a witness");
    v.fraction("merge_probability", merge_probability,
               "probability from which maps of lasers are merged; larger leaves more maps apart (verdicts give each pair's)");
    v.fraction("max_wall_conflict", max_wall_conflict, "the same, for maps that cameras lay on each other, before lasers refined it");
    v.fraction("max_rival", max_rival, "share of the best hypothesis' weight up to which another one leaves two maps unambiguous");
    v.integer("cache_mb", cache_mb, 1, 100000, "memory for submaps that are ready to be compared");
    v.section("judge", judge, "when two submaps show the same place");
    v.section("rematch", rematch, "matching scans to the submaps of other robots once the maps lie on each other");
    v.section("solve", solve, "the joint pose graph");
    v.section("visual", visual, "maps of keyframes");
    v.section("grids", grids, "map_server grids, each two of them");
  }
};

}  // namespace mapweave::fusion
