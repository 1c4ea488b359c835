#pragma once
// Many maps -> team maps: the one operator of every tier (RecSLAM fig. 7a). Edge servers call it on the
// maps they hold (preparative fusion), the cloud on everything (global fusion).

#include <mapweave/core/progress.h>
#include <mapweave/core/worker_pool.h>
#include <mapweave/fusion/bag_of_words_cache.h>
#include <mapweave/fusion/fusion_options.h>
#include <mapweave/maps/judgement.h>
#include <mapweave/maps/map.h>
#include <mapweave/maps/merged_maps.h>

#include <atomic>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace mapweave::matching {
class ModelCache;
}

namespace mapweave::fusion {

class KeptSights;

// Maps that a merge before this one found to belong together.
struct PreviousMerge {
  std::vector<MapId> members;           // sorted
  Table<NodeId, Pose3> map_from_node;   // of their keyframes, as their own maps had them then
  Table<NodeId, Pose3> team_from_node;  // as they were adjusted
  bool is_adjusted_again = false;       // all of them, not what is new alone
};

// Where somebody says that a map lies in another one: measured with a tape, or known starts. Evidence beside others:
// walls may contradict it.
struct MapPrior {
  MapId a, b;
  Pose2 a_from_b;  // b's map frame in a's
  double sigma_m = 0.5, sigma_rad = 0.1;
};

struct FusionInput {
  std::vector<Map> maps;  // in any order; ids differ. Not fused before: robots' own maps, or map_server grids
  std::set<Hash> vetoed;  // judgements not to be believed
  TierId by;              // who asks; stands in the verdicts
  // Judgements made when the maps were smaller: keyframes of metric scale are not judged again where one of these names
  // both. For previews of maps that grow; who wants a sealed result gives none.
  std::vector<Judgement> judged = {};
  // For the same previews, of metric maps: only keyframes that are new are compared, each with the few of all other
  // maps that are most like it; and keyframes of a team that grows stay where they were adjusted, unless what is new
  // says that they lie elsewhere.
  std::vector<PreviousMerge> teams = {};
  // Landmarks of one map that keyframes of another say they saw (MapUpdate::borrowed). Unverified: these pairs are
  // judged first, as all others are, and sightings count in the bundle where keyframes that were found to see the same
  // claimed them. What names nothing known is left out.
  std::vector<LandmarkChange> borrowed = {};
  std::shared_ptr<BagOfWordsCache> pictures = std::make_shared<BagOfWordsCache>();  // to be kept for the next merge
  std::set<std::pair<MapId, MapId>> refused =
      {};                             // never to be matched to each other, the lower id first; unknown ids say nothing
  std::vector<MapPrior> priors = {};  // for lasers; at most one of two maps counts. Unknown ids say nothing
  std::shared_ptr<matching::ModelCache> models = {};  // to be kept for the next merge; speed, never content
  // Of maps of lasers: what edges merged already. Taken as they are, unless what else is known contradicts them
  // (FusionResult::reopened). What names a map, a submap or a node that is not here is left out.
  std::vector<MergedMaps> merged = {};
  // Of maps of lasers that still grow, in rounds while robots drive: they lie as the graph of their submaps puts them;
  // no scan is matched again, maps are not laid on each other as wholes, and copies of a recording are not looked for.
  bool is_preview = false;
  std::shared_ptr<KeptSights> sights = {};  // to be kept for the next merge of the same maps; speed, never content
  // Where it is given, an interruption ends the search for places that coincide instead of fuse(): it becomes true,
  // what was found until then decides, and the interruption is taken (clear_interrupt()).
  std::shared_ptr<std::atomic<bool>> early_end = {};
};

struct Component {
  Map map;  // all members' content under the fused belief; frame: the map frame of the member with the lowest id
  std::vector<MapId> members;  // sorted
  // Of each member's map frame after fusion, by its first node. Where the scale changed, of what cameras saw and of
  // where they were: a point of the map, times the scale, lies there; robots are under their cameras, which sit on them
  // in metres whatever the map's scale.
  Table<MapId, Pose3> team_from_map;
  Table<MapId, double>
      scales;  // of members that were rescaled: one camera does not know its scale, and a grid's may be wrong
  // Landmarks of two members that show the same thing are one: under the other's id, with the sightings of both. The
  // members' own maps still hold them, so that a merge can be undone.
  Table<LandmarkId, LandmarkId> same_as;
  // What lasers found between the members, where they have all of them; without constraints, which the map holds.
  std::optional<MergedMaps> merged = {};
  // Members of which walls stood double in their own map, whose own loops were overruled where that mended it. Sorted.
  std::vector<MapId> bent = {};
};

// What two robots of a team saw of each other's walls in the map that came out.
struct PairAudit {
  struct Conflict {
    double x_m = 0.0, y_m = 0.0;  // middle of walls of one that the other saw through; in the team map's frame
    double length_m = 0.0;
  };
  MapId a, b;  // a < b
  double coinciding_m = 0.0, contradicted_m = 0.0, unclear_m = 0.0;
  std::vector<Conflict> conflicts;  // longest first, at most 20
  // So many in one region that the team map showed something twice: these maps were taken apart again. The frame is
  // then that of a's map.
  bool is_ghost = false;
};

struct StageTime {
  std::string name;  // features, pairwise matching, component connection, transform optimisation, audit; who draws
                     // (compose_grid) adds composing
  double seconds = 0.0;
};

struct FusionResult {
  std::vector<Component> components;              // largest first (nodes with payload), ties by lowest member
  std::vector<Verdict> verdicts;                  // of every pair of maps that was looked at, sorted by (a, b)
  std::vector<Judgement> judgements;              // all, sorted by id
  std::vector<std::vector<MapId>> reopened = {};  // members of FusionInput::merged that were not taken as they are
  std::vector<PairAudit> audits;  // of maps of lasers that saw the same, merged or taken apart; sorted by (a, b)
  std::vector<StageTime> stages;  // wall time; not part of a sealed result
};

// Judgements made before, by id: speed, never content.
using Memo = std::map<Hash, Judgement>;

// Pure in its input and options: neither the order of maps, nor the memo, nor the number of threads changes a byte.
// Throws Error(kBadInput) for two maps with one id or one node in two maps.
FusionResult fuse(const FusionInput&, const FusionOptions&, Memo&, WorkerPool&, Progress&);

// Two submaps to be laid on each other, and where to search.
struct SubmapPair {
  SubmapId a, b;
  matching::WideWindow a_from_b;
};
// What fuse() asks of two maps before it merges any: of these submaps, and of all keyframes that cameras left.
struct FirstPair {
  MapId a, b;
  std::vector<SubmapPair> submaps;
  bool have_cameras = false;
};
// Its answers, sorted by id: for who has time beside the one that fuses, which takes them as its memo. Of maps without
// cameras no more need be there than these submaps and their nodes. Throws Error(kBadInput) for maps or submaps that
// are not there.
std::vector<Judgement> judge_pairs(const FusionInput&, const std::vector<FirstPair>&, const FusionOptions&, Memo&,
                                   WorkerPool&, Progress&);
// For FusionInput::models and ::sights.
std::shared_ptr<matching::ModelCache> make_models(const FusionOptions&);
std::shared_ptr<KeptSights> make_sights();
// With each map of a laser those most like it. Sorted, of each the lower id first.
std::vector<FirstPair> first_pairs(const FusionInput&, const FusionOptions&, WorkerPool&);

}  // namespace mapweave::fusion
