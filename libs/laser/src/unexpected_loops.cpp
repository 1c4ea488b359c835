// Loops that end farther away than drift explains. Stretches of the path that look alike propose them, although some
// walls contradict; submaps beside have to agree, and what lies on what then decides.

#include "graph_loop_closer.h"

#include <mapweave/core/hash.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/maps/map_noise.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace mapweave::laser {
namespace {

constexpr double kSigmas = 6.0;                       // what drift may be worse than it is taken to be
constexpr std::size_t kStretch = 3, kEvery = 2;       // submaps of a stretch of the path, and from one to the next
constexpr std::size_t kAlike = 8, kMostAlike = 2000;  // that a stretch chooses; of all: bounds the time
constexpr double kLeastWindow_m = 4.0, kLargestWindow_m = 16.0, kLeastYaw_rad = 0.2, kLargestYaw_rad = 0.8;
constexpr double kOverlapping = 0.7;    // share of two stretches' radii within which their middles lie
constexpr double kOtherSide = 0.6;      // of the least likelihood: what is seen on the way back is seen from behind
constexpr double kObservability = 0.1;  // less: a corridor, along which places look alike
constexpr std::ptrdiff_t kBeside = 3;   // submaps on either side of a loop
constexpr double kBesideRadius_m = 1.5, kBesideYaw_rad = 0.15;
constexpr std::ptrdiff_t kFewest = 3;   // loops that agree
constexpr int kRounds = 4;              // a loop that is closed shows where the next one ends
constexpr std::size_t kMostTried = 24;  // proposals, each by itself: bounds the time

// Of walls of two visits that lie on each other, but for some that one saw through since something changed or the map
// bends. 13 of 18 right alignments of stretches are within these bounds, and none of 263 wrong ones (fr-clinic).
constexpr double kInliers = 0.62, kConflict = 0.2, kVerifierInliers = 0.25, kSecondBest = 0.75;

bool lies_roughly(const Evidence& evidence) {
  return evidence.inliers >= kInliers && evidence.conflict <= kConflict &&
         evidence.verifier_inliers >= kVerifierInliers && evidence.second_best_ratio <= kSecondBest;
}

}  // namespace

bool LaserLoopCloser::contradicts(const Judgement& judgement) {
  return (judgement.doubt == Reason::contradiction || judgement.doubt == Reason::inconsistent) &&
         !lies_roughly(judgement.evidence);
}

// Submaps from number `first` on as one, where the graph has them.
matching::SubmapView LaserLoopCloser::stretch_from(std::size_t first, const Map& map) const {
  Submap joint;
  joint.id = submaps_[first].id;
  joint.frozen = true;
  Hasher content;
  std::set<NodeId> known;
  for (std::size_t i = first; i < first + kStretch; ++i) {
    const Submap& submap = *map.submaps.find(submaps_[i].id);
    content.add(submap.content);
    const Pose2 first_from_submap = between(poses_[first], poses_[i]);
    for (const auto& [node, submap_from_node] : submap.submap_from_node)
      if (known.insert(node).second)
        joint.submap_from_node.emplace_back(node, spatial(compose(first_from_submap, planar(submap_from_node))));
  }
  joint.content = content.finish();
  return {joint.id, joint.content, std::make_shared<matching::SubmapModel>(joint, map.nodes)};
}

// Stretches that begin at b and may show what an earlier one does, although the graph hardly knows how they lie.
std::vector<LaserLoopCloser::Revisit> LaserLoopCloser::possible_revisits(std::size_t b) const {
  std::vector<Revisit> result;
  const std::vector<Uncertainty> uncertainty = uncertainty_from(b);
  const auto middle_of = [&](std::size_t first) {
    const auto& centre = submaps_[first + kStretch / 2].centre;
    return compose(poses_[first + kStretch / 2], Pose2{centre.x, centre.y, 0.0});
  };
  const Pose2 middle_b = middle_of(b);
  for (std::size_t a = 0; a < b; a += kEvery) {
    const Pose2 middle_a = middle_of(a);
    if (uncertainty[a].position_m >= kLittleKnown_m && std::hypot(middle_a.x - middle_b.x, middle_a.y - middle_b.y) <=
                                                           kLargestWindow_m + kSigmas * uncertainty[a].position_m)
      result.push_back({a, b, std::clamp(kSigmas * uncertainty[a].yaw_rad, kLeastYaw_rad, kLargestYaw_rad)});
  }
  return result;
}

// Those whose walls look most alike, the most alike first.
std::vector<LaserLoopCloser::Revisit> LaserLoopCloser::alike(const Stretch& stretch) const {
  using Ranked = std::pair<double, Revisit>;
  const auto by_unlikeness = [](const Ranked& one, const Ranked& other) { return one.first < other.first; };
  std::vector<Ranked> all;
  for (std::size_t b = 0; b + kStretch <= submaps_.size(); b += kEvery) {
    std::vector<Ranked> ranked;
    for (const Revisit& revisit : possible_revisits(b))
      ranked.emplace_back(matching::ring_distance(*stretch(revisit.a).model, *stretch(b).model), revisit);
    std::stable_sort(ranked.begin(), ranked.end(), by_unlikeness);
    all.insert(all.end(), ranked.begin(),
               ranked.begin() + static_cast<std::ptrdiff_t>(std::min(kAlike, ranked.size())));
  }
  std::stable_sort(all.begin(), all.end(), by_unlikeness);
  std::vector<Revisit> result;
  for (std::size_t i = 0; i < std::min(kMostAlike, all.size()); ++i) result.push_back(all[i].second);
  return result;
}

// The middles of the walls of two stretches on each other, with the heading that is expected.
matching::WideWindow LaserLoopCloser::window_of(const Revisit& revisit, const Stretch& stretch) const {
  const matching::SubmapModel &a = *stretch(revisit.a).model, &b = *stretch(revisit.b).model;
  const double phi = between(poses_[revisit.a], poses_[revisit.b]).phi;
  const Pose2 turned = compose(Pose2{0.0, 0.0, phi}, Pose2{b.centre().x, b.centre().y, 0.0});
  matching::WideWindow window;
  window.a_from_b = {a.centre().x - turned.x, a.centre().y - turned.y, phi};
  window.radius_m =
      std::clamp(kOverlapping * static_cast<double>(a.radius_m() + b.radius_m()), kLeastWindow_m, kLargestWindow_m);
  window.yaw_rad = revisit.yaw_rad;
  return window;
}

// Those first with which most others agree.
std::vector<LaserLoopCloser::Loop> LaserLoopCloser::proposed_loops(const Stretch& stretch) const {
  matching::JudgeOptions options = options_.judge;
  options.min_score *= kOtherSide;
  std::vector<Loop> proposed;
  for (const Revisit& revisit : alike(stretch)) {
    throw_if_interrupted();
    Judgement judgement = matching::judge(stretch(revisit.a), stretch(revisit.b), window_of(revisit, stretch), options);
    if (!judgement.hypotheses.empty() && lies_roughly(judgement.evidence) &&
        judgement.evidence.observability(1) >= kObservability)
      proposed.push_back(loop_of(revisit.a, revisit.b, std::move(judgement)));
  }
  using Worth = std::pair<std::ptrdiff_t, double>;
  std::vector<std::pair<Worth, std::size_t>> order;
  for (std::size_t i = 0; i < proposed.size(); ++i) {
    const Evidence& evidence = proposed[i].judgement.evidence;
    const auto agreeing =
        std::count_if(proposed.begin(), proposed.end(), [&](const Loop& other) { return agree(proposed[i], other); });
    order.emplace_back(Worth(-agreeing, (evidence.conflict - evidence.inliers) * evidence.overlap_m2), i);
  }
  std::sort(order.begin(), order.end());
  std::vector<Loop> best;
  for (std::size_t i = 0; i < std::min(kMostTried, order.size()); ++i)
    best.push_back(std::move(proposed[order[i].second]));
  return best;
}

void LaserLoopCloser::close_unexpected(const Map& map) {
  std::map<std::size_t, matching::SubmapView> made;
  const Stretch stretch = [&](std::size_t first) -> const matching::SubmapView& {
    const auto known = made.find(first);
    return known != made.end() ? known->second : made.emplace(first, stretch_from(first, map)).first->second;
  };
  for (int round = 0; round < kRounds; ++round) {
    const std::vector<Loop> proposed = proposed_loops(stretch);
    // Each by itself: wrong ones contradict right ones.
    if (std::none_of(proposed.begin(), proposed.end(), [&](const Loop& loop) { return closes(loop, map); })) return;
  }
}

// Whether loops beside the proposed one agree, and hold once the map is bent by them. If not, they are taken back.
bool LaserLoopCloser::closes(const Loop& proposed, const Map& map) {
  const std::vector<Pose2> poses = poses_;
  const std::vector<Loop> loops = loops_;
  Pairs contradicting;
  search_beside(proposed, map, contradicting);
  const auto first = loops_.begin() + static_cast<std::ptrdiff_t>(loops.size());
  for (auto loop = first; loop != loops_.end(); ++loop) loop->sure = false;
  commit_agreeing();
  const auto agreeing =
      std::count_if(first, loops_.end(), [](const Loop& loop) { return loop.state == State::committed; });
  if (agreeing >= kFewest && agreeing > static_cast<std::ptrdiff_t>(contradicting.size())) {
    solve();
    if (look_near(map, poses, contradicting) >= 0 && !take_back_folds(map)) return true;
  }
  poses_ = poses;
  loops_ = loops;
  return false;
}

void LaserLoopCloser::search_beside(const Loop& loop, const Map& map, Pairs& contradicting) {
  matching::JudgeOptions options = options_.judge;
  options.min_score *= kOtherSide;
  for (std::ptrdiff_t i = -kBeside; i <= kBeside; ++i)
    for (std::ptrdiff_t j = -kBeside; j <= kBeside; ++j) {
      const std::ptrdiff_t from = static_cast<std::ptrdiff_t>(loop.a) + i, to = static_cast<std::ptrdiff_t>(loop.b) + j;
      if (from < 0 || to >= static_cast<std::ptrdiff_t>(submaps_.size()) ||
          to - from <= static_cast<std::ptrdiff_t>(kSharing))
        continue;
      const auto a = static_cast<std::size_t>(from), b = static_cast<std::size_t>(to);
      if (is_known(a, b)) continue;
      matching::WideWindow window;
      window.a_from_b =
          compose(compose(between(poses_[a], poses_[loop.a]), loop.a_from_b), between(poses_[loop.b], poses_[b]));
      window.radius_m = kBesideRadius_m;
      window.yaw_rad = kBesideYaw_rad;
      Judgement judgement = judged(a, b, window, options, map);
      if (is_believed(judgement))
        loops_.push_back(loop_of(a, b, std::move(judgement)));
      else if (contradicts(judgement))
        contradicting.insert({a, b});
    }
}

}  // namespace mapweave::laser
