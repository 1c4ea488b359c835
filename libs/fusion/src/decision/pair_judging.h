#pragma once
// Stages 1 and 2 of fuse(): maps made ready, and each two of them judged by all senses that both have.

#include "laser/laser_team.h"
#include "prepared_map.h"
#include "same_recording.h"
#include "visual/incremental_candidates.h"
#include "visual/repetition.h"

#include <deque>
#include <optional>

namespace mapweave::fusion {

struct PairJoin {
  std::size_t a, b;  // numbers in id order
  PairResult result;
  std::vector<VisualWitness> seen;  // that hold, where cameras saw it
  VisualRepetition repetition;
  bool is_matched_by_lasers = false;  // whatever cameras say
  bool is_accepted() const { return result.verdict.decision == Decision::accepted; }
  std::size_t witnesses() const { return result.witnesses.size() + seen.size(); }
};

// Numbers of maps are in the order of their ids. Not thread-safe; works in parallel within. Input and memo must outlive
// it.
class PairJudging {
 public:
  PairJudging(const FusionInput& input, const FusionOptions& options, Memo& memo, WorkerPool& pool);

  // Before all else. Throws as fuse() does.
  void prepare_maps();
  const std::vector<PreparedMap>& maps() const { return maps_; }
  const GridAlignments& grids() const { return *grids_; }
  std::size_t number_of(const MapId& id) const;  // the number of maps where there is no such map
  // As a team has it. A grid that is alone keeps the scale that it was given with.
  const Map& map_in_team(std::size_t number, bool is_alone) const {
    return is_alone ? grids_->given(number) : *maps_[number].map;
  }
  const std::deque<VisualMap>& seen() const { return seen_; }  // of each map; empty without keyframes
  matching::ModelCache& models() const { return cache_; }
  const ClaimedSightings& claimed_sightings() const { return *claimed_; }

  std::vector<PairJoin> all_pairs(Progress& progress);
  // From now on the two maps stay apart, for this reason. False where they were refused already.
  bool refuse(std::size_t a, std::size_t b, const Verdict& why);
  const LaserMerger& lasers() const { return *lasers_; }  // after all_pairs()
  void judge(const std::vector<FirstPair>& pairs, Progress& progress);
  std::vector<FirstPair> first_pairs();  // instead of all_pairs()
  std::vector<Judgement> judgements();   // that were asked for, sorted by id

 private:
  std::size_t known_number(const MapId& id) const;
  void doubt_what_repeats(std::vector<PairJoin>& pairs) const;
  std::vector<PairJoin> compare_all(Progress& progress);
  PairJoin compared_or_cut_short(std::size_t a, std::size_t b);
  PairJoin compared(std::size_t a, std::size_t b);
  Verdict not_compared(std::size_t a, std::size_t b, Reason reason) const;
  VisualPairResult seen_by_cameras(std::size_t a, std::size_t b);
  Verdict combined_verdict(const Verdict& laser, const Verdict& seen, std::size_t a, std::size_t b,
                           std::vector<Hash>& judged);
  double wall_conflict(std::size_t a, std::size_t b, const Pose2& a_from_b);

  const FusionInput& input_;
  const FusionOptions options_;
  WorkerPool& pool_;
  const std::shared_ptr<matching::ModelCache> models_;
  matching::ModelCache& cache_ = *models_;
  VisualJudge visual_judge_;
  Memo& memo_;
  std::optional<GridAlignments> grids_;
  std::vector<PreparedMap> maps_;                           // grids with their scales applied
  std::set<std::pair<std::size_t, std::size_t>> excluded_;  // pairs that the input refuses, or of a copy
  std::vector<std::optional<CopyOf>> copies_;               // of each map
  std::deque<VisualMap> seen_;
  std::optional<ClaimedSightings> claimed_;
  std::optional<IncrementalCandidates> incremental_;
  std::optional<LaserMerger> lasers_;
  std::map<std::pair<std::size_t, std::size_t>, Verdict> refused_;  // once they were merged, with the reason
  std::vector<Hash> judged_;
};

// Whether two ways to lay map b put its keyframes in about the same place.
bool lie_alike(const VisualMap& b, const Sim3& one, const Sim3& other);

}  // namespace mapweave::fusion
