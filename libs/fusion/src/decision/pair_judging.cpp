#include "pair_judging.h"
#include "early_end.h"
#include "verdict.h"

#include <mapweave/core/error.h>
#include <mapweave/core/stopwatch.h>

#include <algorithm>

namespace mapweave::fusion {
namespace {

std::vector<const Map*> sorted(const std::vector<Map>& maps) {
  std::vector<const Map*> order;
  for (const auto& map : maps) order.push_back(&map);
  std::sort(order.begin(), order.end(), [](const Map* a, const Map* b) { return a->id < b->id; });
  std::vector<std::pair<NodeId, const Map*>> nodes;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i > 0 && order[i]->id == order[i - 1]->id)
      throw Error(ErrorCode::kBadInput, "two maps are called '" + order[i]->id.str() + "'", {},
                  "give each its own name");
    for (const auto& entry : order[i]->nodes) nodes.emplace_back(entry.first, order[i]);
  }
  std::stable_sort(nodes.begin(), nodes.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (std::size_t i = 1; i < nodes.size(); ++i)
    if (nodes[i].first == nodes[i - 1].first)
      throw Error(ErrorCode::kBadInput,
                  "session " + to_string(nodes[i].first.session) + " stands in two maps, '" +
                      nodes[i - 1].second->id.str() + "' and '" + nodes[i].second->id.str() + "'",
                  {}, "leave one of them out");
  return order;
}

}  // namespace

PairJudging::PairJudging(const FusionInput& input, const FusionOptions& options, Memo& memo, WorkerPool& pool)
    : input_(input),
      options_(options),
      pool_(pool),
      models_(input.models ? input.models : make_models(options)),
      visual_judge_(options_.visual, input, memo, pool),
      memo_(memo) {}

void PairJudging::prepare_maps() {
  const std::vector<const Map*> maps = sorted(input_.maps);
  const bool is_preview = input_.is_preview || !input_.teams.empty() || !input_.judged.empty();
  copies_ = is_preview ? std::vector<std::optional<CopyOf>>(maps.size()) : copies_among(maps);
  for (std::size_t a = 0; a < maps.size(); ++a)
    for (std::size_t b = a + 1; b < maps.size(); ++b)
      if (copies_[a] || copies_[b] || input_.refused.count({maps[a]->id, maps[b]->id}) != 0) excluded_.emplace(a, b);
  grids_.emplace(maps, input_, options_, pool_, excluded_);
  for (std::size_t m = 0; m < maps.size(); ++m) {
    maps_.push_back(prepare(grids_->rescaled(m), cache_, options_.stride_m, pool_));
    seen_.emplace_back(*maps[m], options_.visual.vocabulary, *input_.pictures, pool_);
  }
  for (const auto& entry : grids_->pairs()) {
    const Judgement& judgement = entry.second.judgement;
    memo_.emplace(judgement.id, judgement);
    judged_.push_back(judgement.id);
  }
  claimed_.emplace(input_.borrowed, seen_);
  incremental_.emplace(input_.teams, seen_, *claimed_, options_.visual, pool_);
}

std::vector<Judgement> PairJudging::judgements() {
  std::sort(judged_.begin(), judged_.end());
  judged_.erase(std::unique(judged_.begin(), judged_.end()), judged_.end());
  std::vector<Judgement> all;
  for (const auto& id : judged_) all.push_back(memo_.at(id));
  return all;
}

std::size_t PairJudging::number_of(const MapId& id) const {
  const auto map = std::find_if(maps_.begin(), maps_.end(), [&](const PreparedMap& one) { return one.map->id == id; });
  return static_cast<std::size_t>(map - maps_.begin());
}

bool PairJudging::refuse(std::size_t a, std::size_t b, const Verdict& why) {
  return refused_.emplace(std::minmax(a, b), why).second;
}

std::vector<PairJoin> PairJudging::all_pairs(Progress& progress) {
  for (;;) {
    std::set<std::pair<std::size_t, std::size_t>> refused = excluded_;
    for (const auto& entry : refused_) refused.insert(entry.first);
    lasers_.emplace(maps_, *grids_, input_, options_, refused, JudgeResources{cache_, memo_, pool_, input_});
    lasers_->run(progress);
    judged_.insert(judged_.end(), lasers_->judged().begin(), lasers_->judged().end());
    std::vector<PairJoin> pairs = compare_all(progress);
    // What lasers believe and cameras contradict is taken back, and the lasers decide again without it.
    bool again = false;
    for (const PairJoin& pair : pairs)
      if (!pair.is_accepted() && pair.is_matched_by_lasers)
        again = refuse(pair.a, pair.b, pair.result.verdict) || again;
    if (again) continue;
    for (PairJoin& pair : pairs) {
      const auto why = refused_.find({pair.a, pair.b});
      if (why == refused_.end()) continue;
      const std::optional<TeamMerge> merge = pair.result.verdict.merge;
      pair.result.verdict = why->second;
      pair.result.verdict.merge = merge;
      pair.result.witnesses.clear();
      pair.seen.clear();
    }
    return pairs;
  }
}

std::vector<PairJoin> PairJudging::compare_all(Progress& progress) {
  std::vector<PairJoin> pairs;
  const std::size_t count = maps_.size() * (maps_.size() - (maps_.empty() ? 0 : 1)) / 2;
  if (count == 0) return pairs;
  const int task = progress.begin("deciding", count, "pairs of maps");
  for (std::size_t a = 0; a < maps_.size(); ++a)
    for (std::size_t b = a + 1; b < maps_.size(); ++b) {
      // A copy is reported with its original alone.
      if ((copies_[a] && copies_[a]->original != b) || (copies_[b] && copies_[b]->original != a)) continue;
      Stopwatch watch;
      pairs.push_back(compared_or_cut_short(a, b));
      auto& result = pairs.back().result;
      result.verdict.seconds = watch.lap();
      judged_.insert(judged_.end(), result.judged.begin(), result.judged.end());
      progress.advance(task, pairs.size());
    }
  progress.end(task);
  doubt_what_repeats(pairs);
  return pairs;
}

// What a map has twice is no evidence in other maps either.
void PairJudging::doubt_what_repeats(std::vector<PairJoin>& pairs) const {
  std::vector<std::set<std::size_t>> known(maps_.size());
  std::vector<std::vector<Hash>> because(maps_.size());
  for (const PairJoin& pair : pairs) {
    known[pair.a].insert(pair.repetition.of_a.begin(), pair.repetition.of_a.end());
    known[pair.b].insert(pair.repetition.of_b.begin(), pair.repetition.of_b.end());
    for (const std::size_t map : {pair.a, pair.b})
      because[map].insert(because[map].end(), pair.repetition.because.begin(), pair.repetition.because.end());
  }
  for (PairJoin& pair : pairs) {
    if (!pair.is_accepted() || pair.result.verdict.kind != "vision") continue;
    if (!rests_on(known[pair.a], known[pair.b], seen_[pair.a], seen_[pair.b], pair.seen)) continue;
    for (const std::size_t map : {pair.a, pair.b}) doubt_as_repeated(pair.result.verdict, because[map]);
    pair.seen.clear();
  }
}

// Nothing is compared.
Verdict PairJudging::not_compared(std::size_t a, std::size_t b, Reason reason) const {
  const bool by_laser = !maps_[a].submaps.empty() && !maps_[b].submaps.empty();
  Verdict verdict = unseen(maps_[a].map->id, maps_[b].map->id, input_.by,
                           maps_[a].is_grid || maps_[b].is_grid ? "grid"
                           : by_laser                           ? "laser"
                                                                : "vision");
  set_aside(verdict, reason);
  if (by_laser && lasers_) verdict.merge = lasers_->merge_of(a, b);
  return verdict;
}

VisualPairResult PairJudging::seen_by_cameras(std::size_t a, std::size_t b) {
  auto questions = incremental_->questions(a, b);
  if (!questions) questions.emplace().first = claimed_->pairs(a, b);
  return decide(seen_[a], seen_[b], *questions, input_, options_, visual_judge_);
}

// What lasers found until an interruption counts; cameras that were not compared then are not compared.
PairJoin PairJudging::compared_or_cut_short(std::size_t a, std::size_t b) {
  const bool cameras = !seen_[a].empty() && !seen_[b].empty();
  PairJoin join{a, b, {}, {}, {}};
  try {
    if (cameras && is_over(input_)) throw Interrupted();
    join = compared(a, b);
  } catch (const Interrupted&) {
    if (!is_over(input_)) throw;
    join.result.verdict = not_compared(a, b, Reason::too_few_witnesses);
  }
  if (is_over(input_) && !join.is_accepted()) join.result.verdict.detail = "an interruption cut the comparison short";
  return join;
}

PairJoin PairJudging::compared(std::size_t a, std::size_t b) {
  PairJoin join{a, b, {}, {}, {}};
  if (excluded_.count({a, b}) != 0) {
    const auto& copy = copies_[a] ? copies_[a] : copies_[b];
    join.result.verdict = not_compared(a, b, copy ? Reason::same_recording : Reason::excluded);
    if (copy) join.result.verdict.overlap = copy->share;
    return join;
  }
  const bool cameras = !seen_[a].empty() && !seen_[b].empty(),
             lasers = !maps_[a].submaps.empty() && !maps_[b].submaps.empty();
  if (lasers || !cameras) join.result = lasers_->result_of(a, b);
  join.is_matched_by_lasers = !join.result.witnesses.empty();
  if (!cameras) return join;
  VisualPairResult seen = seen_by_cameras(a, b);
  join.result.judged.insert(join.result.judged.end(), seen.judged.begin(), seen.judged.end());
  join.result.verdict =
      lasers ? combined_verdict(join.result.verdict, seen.verdict, a, b, join.result.judged) : seen.verdict;
  join.repetition = std::move(seen.repetition);
  if (join.is_accepted() && seen.verdict.decision == Decision::accepted) join.seen = std::move(seen.witnesses);
  if (!join.is_accepted() || join.result.verdict.kind == "vision") join.result.witnesses.clear();
  return join;
}

// One verdict of two senses.
Verdict PairJudging::combined_verdict(const Verdict& laser, const Verdict& seen, std::size_t a, std::size_t b,
                                      std::vector<Hash>& judged) {
  SenseChecks checks;
  checks.do_lie_alike = [&] { return lie_alike(seen_[b], laser.alignment->a_from_b, seen.alignment->a_from_b); };
  checks.wall_conflict = [&] { return wall_conflict(a, b, planar(seen.alignment->a_from_b.pose)); };
  checks.do_cameras_contradict = [&] {
    return contradict(seen_[a], seen_[b], laser.alignment->a_from_b, visual_judge_, judged);
  };
  return combined(laser, seen, checks, options_);
}

// Share of the walls of one map that the other saw through, once b lies so. Nothing is searched for, so that nothing
// can be missed.
double PairJudging::wall_conflict(std::size_t a, std::size_t b, const Pose2& a_from_b) {
  double conflict = 0.0, overlap_m2 = 0.0;
  for (const std::size_t j : maps_[b].representatives) {
    std::pair<double, std::size_t> nearest{1e300, 0};
    const Pose2 there = compose(a_from_b, maps_[b].map_from_submap[j]);
    for (const std::size_t i : maps_[a].representatives) {
      const Pose2 apart = between(maps_[a].map_from_submap[i], there);
      nearest = std::min(nearest, {std::hypot(apart.x, apart.y), i});
    }
    constexpr double kNear_m = 6.0;  // nearer submaps see about the same
    if (nearest.first > kNear_m) continue;
    const PreparedMap &one = maps_[a], &other = maps_[b];
    const Evidence e = matching::weigh(*cache_.get(*one.submaps[nearest.second], one.map->nodes),
                                       *cache_.get(*other.submaps[j], other.map->nodes),
                                       between(one.map_from_submap[nearest.second], there));
    conflict += e.conflict * e.overlap_m2;
    overlap_m2 += e.overlap_m2;
  }
  return overlap_m2 > options_.judge.min_overlap_m2 ? conflict / overlap_m2 : 0.0;
}

std::size_t PairJudging::known_number(const MapId& id) const {
  const std::size_t number = number_of(id);
  if (number == maps_.size())
    throw Error(ErrorCode::kBadInput, "map '" + id.str() + "' is to be judged and is not there");
  return number;
}

void PairJudging::judge(const std::vector<FirstPair>& pairs, Progress& progress) {
  const int task = progress.begin("comparing maps", pairs.size(), "pairs of maps");
  lasers_.emplace(maps_, *grids_, input_, options_, std::set<std::pair<std::size_t, std::size_t>>{},
                  JudgeResources{cache_, memo_, pool_, input_});
  const auto number_of_submap = [&](std::size_t map, const SubmapId& id) {
    const auto& submaps = maps_[map].submaps;
    const auto place =
        std::find_if(submaps.begin(), submaps.end(), [&](const Submap* submap) { return submap->id == id; });
    if (place == submaps.end())
      throw Error(ErrorCode::kBadInput,
                  "a submap of map '" + maps_[map].map->id.str() + "' is to be judged and is not there");
    return lasers_->graph().number(map, static_cast<std::size_t>(place - submaps.begin()));
  };
  std::vector<SubmapQuestion> questions;
  for (const FirstPair& pair : pairs)
    for (const SubmapPair& places : pair.submaps)
      questions.push_back({number_of_submap(known_number(pair.a), places.a),
                           number_of_submap(known_number(pair.b), places.b), places.a_from_b});
  lasers_->judge_first(questions);
  judged_.insert(judged_.end(), lasers_->judged().begin(), lasers_->judged().end());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const std::size_t one = known_number(pairs[i].a), other = known_number(pairs[i].b);
    const auto [a, b] = std::minmax(one, other);
    if (!seen_[a].empty() && !seen_[b].empty()) {
      const auto ids = seen_by_cameras(a, b).judged;
      judged_.insert(judged_.end(), ids.begin(), ids.end());
    }
    progress.advance(task, i + 1);
  }
  progress.end(task);
}

std::vector<FirstPair> PairJudging::first_pairs() {
  lasers_.emplace(maps_, *grids_, input_, options_, excluded_, JudgeResources{cache_, memo_, pool_, input_});
  std::map<std::pair<std::size_t, std::size_t>, FirstPair> pairs;
  const auto pair_of = [&](std::size_t a, std::size_t b) -> FirstPair& {
    FirstPair& pair = pairs[{a, b}];
    pair.a = maps_[a].map->id;
    pair.b = maps_[b].map->id;
    return pair;
  };
  const SubmapGraph& graph = lasers_->graph();
  const auto id_of = [&](std::size_t submap) {
    return maps_[graph.map_of(submap)].submaps[graph.submap_of(submap)]->id;
  };
  for (const SubmapQuestion& question : lasers_->first_questions_of_all())
    pair_of(graph.map_of(question.from), graph.map_of(question.to))
        .submaps.push_back({id_of(question.from), id_of(question.to), question.from_from_to});
  for (std::size_t a = 0; a < maps_.size(); ++a)
    for (std::size_t b = a + 1; b < maps_.size(); ++b)
      if (!seen_[a].empty() && !seen_[b].empty() && excluded_.count({a, b}) == 0) pair_of(a, b).have_cameras = true;
  std::vector<FirstPair> result;
  for (auto& entry : pairs) result.push_back(std::move(entry.second));
  return result;
}

bool lie_alike(const VisualMap& b, const Sim3& one, const Sim3& other) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const MappedKeyframe& keyframe : b.keyframes())
    middle += keyframe.map_from_node.t / static_cast<double>(b.keyframes().size());
  constexpr double kAlike_m = 1.0, kAlike_rad = 0.15;  // senses err: within that, two say the same
  const Eigen::Vector3d apart = transformed(middle, one) - transformed(middle, other);
  return apart.head<2>().norm() < kAlike_m &&
         std::abs(wrap_angle(planar(one.pose).phi - planar(other.pose).phi)) < kAlike_rad;
}

}  // namespace mapweave::fusion
