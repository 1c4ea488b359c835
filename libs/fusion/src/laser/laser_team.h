#pragma once
// Which robots' laser maps belong together, and how: hypotheses of all pairs are decided together, the surest merge
// first, and every merge is judged by the whole maps as the joint graph bends them.

#include "constraint_search.h"
#include "grid/grid_alignments.h"
#include "merged_teams.h"
#include "prior_evidence.h"
#include "team_audit.h"
#include "whole_map_proposals.h"

#include <mapweave/core/progress.h>

#include <map>
#include <optional>

namespace mapweave::fusion {

// What proposed how two grids of other makers lie.
constexpr const char* kGridProposer = "walls and free space";
// Log odds that two groups of maps lie as compared; no surer than this either way.
constexpr double kSurestLogOdds = 20.0;
constexpr double kCertain = 15.0;                           // from which a merge waits for no other
constexpr std::size_t kFirstRound = 4;                      // questions of a pair of maps, then four times as many
constexpr double kBentRadius_m = 0.7, kBentYaw_rad = 0.06;  // how a submap may lie to what its region says
PairAudit pair_audit(const AuditedPair& pair, const PreparedMap& a, const PreparedMap& b);
// What the log odds of a merge are the sum of: what fits nowhere around, less what is seen through and what is unclear
// (each by its weight, wall_weights.h), less what would fit by chance. Metres.
struct WeighedWalls {
  double unique_m = 0.0;                        // that fit nowhere around, nor as far as walls repeat or slide
  double distinctive_m = 0.0, unclear_m = 0.0;  // that count: of unique_m, less where rooms have other widths
  double by_chance_m = 0.0;
  double sum_m = 0.0;
  double log_odds = 0.0;  // the sum, within kSurestLogOdds
};
WeighedWalls weighed(const WallAgreement& walls);
double log_odds_of(const WallAgreement& walls);
// Whether as much may fit by chance as decides here: what fits nowhere around at another place, which cannot be right
// as well, is more than the log odds here stand without, or that place has `enough` log odds itself.
bool fits_by_chance(const WallAgreement& here, const WallAgreement& elsewhere, double log_odds_elsewhere,
                    double enough);
// Metres of wall that two hypotheses are compared by.
double fit_of(const WallAgreement& walls);
// The same match, from the other side.
SubmapMatch turned(SubmapMatch match);

// One way in which two groups of maps may lie to each other.
struct MergeHypothesis {
  std::vector<SubmapMatch> matches;     // between the groups, with those that the search found
  SolvedSubmaps solved;                 // both groups, with all their matches
  WallAgreement walls;                  // of the two groups
  double log_odds = 0.0;                // that it is right, by itself
  double prior_log_odds = 0.0;          // of these, what priors add
  bool is_of_grids = false;             // two map_server grids, aligned as a whole
  Proposer proposer = Proposer::prior;  // the last one whose matches it began with
  Hash grown_from;                      // hash_of() all matches it began with: of each group, and between them
};
// Of sets of matches: their judgements, and where each has it, since a judgement may leave a choice.
Hash hash_of(std::initializer_list<const std::vector<SubmapMatch>*> matches);

struct LaserTeam {
  std::vector<std::size_t> maps;     // numbers, rising
  std::vector<SubmapMatch> matches;  // between any two of its submaps
  SolvedSubmaps solved;
};

using PoseOfSubmap = std::function<Pose2(std::size_t map, std::size_t submap)>;

// Maps that have no submaps are left out.
class LaserMerger {
 public:
  // Everything must outlive it. `refused`: pairs of maps (numbers, the lower first) that must not be matched to each
  // other.
  LaserMerger(const std::vector<PreparedMap>& maps, const GridAlignments& grids, const FusionInput& input,
              const FusionOptions& options, const std::set<std::pair<std::size_t, std::size_t>>& refused,
              const JudgeResources& resources);

  void run(Progress& progress);
  const std::vector<LaserTeam>& teams() const { return teams_; }
  // Null before run().
  const LaserTeam* team_of(std::size_t map) const {
    return map < place_of_team_.size() && place_of_team_[map] < teams_.size() ? &teams_[place_of_team_[map]] : nullptr;
  }
  const SubmapGraph& graph() const { return graph_; }
  const MergedTeams& merged() const { return merged_; }  // that were given
  // How run() merged these maps; none where it did not. Judgements are the memo's.
  std::optional<MergedMaps> merged_maps(const std::vector<std::size_t>& maps) const;
  // Of maps that lie so. Numbers in the result are places among `maps`.
  TeamAudit audited(const std::vector<std::size_t>& maps, const PoseOfSubmap& pose_of,
                    const GhostBounds& bounds = {}) const;
  // Whether matches of run() overrule loops of this map.
  bool is_overruled(std::size_t map) const { return !overruling(map).empty(); }
  std::vector<SubmapMatch> overruling(std::size_t map) const;
  // The merge of teams by which two maps came into one; none where they did not.
  std::optional<TeamMerge> merge_of(std::size_t a, std::size_t b) const;
  // Of two maps, a < b.
  PairResult result_of(std::size_t a, std::size_t b) const;
  // Its pairs with one map that show something twice, in the frames of their first maps.
  std::vector<PairAudit> ghosts_of(const TeamAudit& audit, const std::vector<std::size_t>& maps, std::size_t with,
                                   const PoseOfSubmap& pose_of) const;
  const std::vector<PairAudit>& taken_apart() const { return taken_apart_; }  // by the audit of run()
  // What became of the prior of two maps, a < b, that were merged so, else fit best so. Nothing without one.
  std::optional<PriorCheck> check_of_prior(std::size_t a, std::size_t b, const std::optional<Pose2>& a_from_b) const;
  const std::vector<Hash>& judged() const { return judge_.asked(); }
  // What run() asks before anything is merged, instead of run(); of each pair of maps the lower first.
  std::vector<SubmapQuestion> first_questions_of_all();
  void judge_first(const std::vector<SubmapQuestion>& questions) { judge_.ask(questions); }

 private:
  using MapPair = std::pair<std::size_t, std::size_t>;
  struct PairState {
    std::vector<SubmapQuestion> open;     // those of a prior, then the most alike first
    std::size_t of_prior = 0;             // how many are a prior's: they are asked beside the others
    Proposer last = Proposer::ring_keys;  // whose questions they are
    double unlikeness = 0.0;  // of the places that the first questions are about; maps with a prior are asked first
    std::vector<SubmapAnswer> answers;
  };
  struct Evaluation {
    std::size_t answers = 0, refused = 0;     // that it rests on: judgements, pairs of maps that must not be matched
    std::vector<MergeHypothesis> hypotheses;  // best first
    double probability = 0.0;                 // of the best, against the others and against none
    bool repeats = false;                     // what fits looks like other places of the same maps
    double rival = 0.0;                       // probability of the second best, as a share of the best one's
  };
  std::vector<SubmapQuestion> first_questions(std::size_t a, std::size_t b) const;
  matching::WideWindow window_for(std::size_t map_a, std::size_t a, std::size_t map_b, std::size_t b) const;
  bool propose_next();
  void open_pairs();
  double unlikeness(const std::vector<SubmapQuestion>& questions) const;
  std::vector<MapPair> next_pairs(bool is_first, std::set<MapPair>& asked) const;
  bool ask_more(std::size_t count, std::set<MapPair>& asked);
  std::vector<SubmapQuestion> next_questions(PairState& state, std::size_t count) const;
  std::vector<const SubmapAnswer*> answers_between(const LaserTeam& x, const LaserTeam& z) const;
  std::vector<MergeHypothesis> seeds(const LaserTeam& x, const LaserTeam& z) const;
  // Of grids in one team with grids in the other.
  std::vector<MergeHypothesis> grid_hypotheses(const LaserTeam& x, const LaserTeam& z) const;
  bool add_grid_pair(MergeHypothesis& hypothesis, std::size_t a, std::size_t b) const;
  Pose2 a_from_b(const SolvedSubmaps& solved, std::size_t a, std::size_t b) const;
  void describe_grids(std::size_t a, std::size_t b, Verdict& verdict) const;
  bool are_grids(std::size_t submap, std::size_t other) const {
    return grids_.is_grid(graph_.map_of(submap)) && grids_.is_grid(graph_.map_of(other));
  }
  void grow(MergeHypothesis& hypothesis, const LaserTeam& x, const LaserTeam& z);
  const Evaluation& evaluated(const LaserTeam& x, const LaserTeam& z);
  const Evaluation* last_evaluation(const std::vector<std::size_t>& one, const std::vector<std::size_t>& other) const;
  bool is_known_to_repeat(const MapPair& pair) const;
  WallAgreement agreement(const SolvedSubmaps& solved, const std::vector<std::size_t>& a,
                          const std::vector<std::size_t>& b) const;
  PoseOfSubmap pose_in(const SolvedSubmaps& solved) const {
    return [this, &solved](std::size_t map, std::size_t s) { return solved.pose_of(graph_.number(map, s)); };
  }
  PlacedSubmap placed_submap(std::size_t map, std::size_t submap, const Pose2& pose) const;
  std::vector<PlacedSubmap> placed(const std::vector<std::size_t>& maps, const PoseOfSubmap& pose_of) const;
  SightOf sight_of(const std::vector<const std::vector<PlacedSubmap>*>& sides) const;
  bool fits_elsewhere(const std::vector<MergeHypothesis>& hypotheses) const;
  bool stands_twice(const MergeHypothesis& hypothesis, const LaserTeam& x, const LaserTeam& z);
  void remember_teams();  // after every change of teams_
  std::vector<std::pair<std::size_t, std::size_t>> comparable_teams() const;
  std::vector<std::pair<std::size_t, std::size_t>> likeliest_first() const;
  bool merge_surest();
  void merge_all();
  void close_loops(LaserTeam& team);
  std::vector<std::vector<PlacedSubmap>> visits(const LaserTeam& team, std::size_t map) const;
  // Whether one of its robots saw other walls where it came back to.
  bool shows_itself_twice(const LaserTeam& team, std::size_t map) const;
  bool shows_ghosts(const LaserTeam& team) const;    // between its maps
  using Searcher = std::function<void(LaserTeam&)>;  // for matches, from those that it has
  void mend_between(LaserTeam& team, const Searcher& search);
  void mend_within(LaserTeam& team, const Searcher& search);
  bool close_unexpected_loops(LaserTeam& team, const SubmapsInScope& in_scope);
  struct LoopEvidence {
    double fit_m = 0.0, log_odds = 0.0;
  };
  LoopEvidence loop_evidence(const LaserTeam& team) const;
  std::vector<std::vector<PlacedSubmap>> placed_apart(const std::vector<std::size_t>& maps,
                                                      const PoseOfSubmap& pose_of) const;
  struct Mending {
    std::vector<SubmapMatch> matches;  // new ones
    double in_doubt_m = 0.0;           // before them
  };
  // Where sides, which lie so, would no longer show something twice. `asked`: judgements that were tried.
  Mending mending_of(const std::vector<std::vector<PlacedSubmap>>& sides,
                     const std::function<bool(std::size_t, std::size_t)>& may_be_bent, PlaceSizes sizes,
                     std::set<Hash>& asked);
  // The same of maps, of which one may be matched to another.
  Mending mending_between(const std::vector<std::size_t>& maps, const SolvedSubmaps& solved,
                          const std::function<bool(std::size_t, std::size_t)>& may_match, PlaceSizes sizes,
                          std::set<Hash>& asked);
  // The same of the visits of each map by itself.
  Mending mending_within(const LaserTeam& team, std::set<Hash>& asked);
  void split_unconnected();
  bool take_back();
  bool is_same(const MergeHypothesis& one, const MergeHypothesis& other) const;
  std::string last_proposer(std::size_t a, std::size_t b) const;
  std::vector<SubmapMatch> doubted(std::size_t a, std::size_t b, Verdict& verdict) const;
  void remember_taken_back(const LaserTeam& team, const TeamAudit& audit, std::size_t who);
  std::size_t matches_between(const LaserTeam& team, std::size_t a, std::size_t b) const;
  PairHypothesis hypothesis_of(std::size_t a, std::size_t b, const SolvedSubmaps& solved,
                               const WallAgreement& walls) const;
  std::vector<PairHypothesis> hypotheses_of(std::size_t a, std::size_t b, const WallAgreement* accepted) const;

  const std::vector<PreparedMap>& maps_;
  const GridAlignments& grids_;
  const FusionInput& input_;
  const FusionOptions& options_;
  std::set<MapPair> refused_, refused_by_user_, contradicted_, vetoed_;
  Memo& memo_;
  SubmapGraph graph_;
  PriorEvidence priors_;
  MergedTeams merged_;
  mutable SubmapJudge judge_;  // keeps what it looked at
  ConstraintSearch search_;
  WholeMapProposals proposals_;
  std::map<MapPair, PairState> pairs_;
  std::map<MapPair, PairHypothesis> taken_back_;  // how they lay in the team that the audit took them out of
  std::set<MapPair> answered_;                    // pairs of maps that something was asked about
  std::vector<LaserTeam> teams_;
  std::vector<std::size_t> place_of_team_;  // in teams_, of each map; one that is none without a team
  std::vector<TeamsMerged> merges_;         // in the order in which they were decided
  std::vector<PairAudit> taken_apart_;
  std::map<std::pair<std::vector<std::size_t>, std::vector<std::size_t>>, Evaluation> evaluations_;
};

}  // namespace mapweave::fusion
