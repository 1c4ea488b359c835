// Loops that end farther away than drift explains. Places that look alike propose them, contradicted or not; places
// beside have to agree, and what lies on what then decides.

#include "graph_loop_closer.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace mapweave::laser {
namespace {

constexpr double kSigmas = 6.0;                      // what drift may be worse than it is taken to be
constexpr double kLittleKnown_m = 2.0;               // standard deviation from which a loop may have been missed
constexpr std::size_t kAlike = 8, kAlikeTried = 48;  // that a place chooses, from so many that look most like it
constexpr std::size_t kMostAlike = 2000;             // pairs: bounds the time
constexpr double kLeastWindow_m = 4.0, kLargestWindow_m = 12.0, kYaw_rad = 0.8;
constexpr double kOverlapping = 0.7;   // share of two submaps' radii within which their middles lie
constexpr std::ptrdiff_t kBeside = 3;  // submaps on either side of a loop
constexpr double kBesideRadius_m = 1.5, kBesideYaw_rad = 0.15;
constexpr std::ptrdiff_t kFewest = 3;   // loops that agree
constexpr std::size_t kMostTried = 24;  // proposals, each by itself: bounds the time

}  // namespace

std::vector<std::pair<std::size_t, std::size_t>> LaserLoopCloser::alike() const {
  std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
  const std::vector<Eigen::Vector2d> centres = centres_by(poses_);
  for (std::size_t b = kSharing + 1; b < submaps_.size(); ++b) {
    const std::vector<Uncertainty> uncertainty = uncertainty_from(b);
    const auto may_coincide = [&](std::size_t a) {
      const double sigma_m = uncertainty[a].position_m;
      return sigma_m >= kLittleKnown_m && (centres[a] - centres[b]).norm() <= kLargestWindow_m + kSigmas * sigma_m;
    };
    std::vector<std::pair<double, std::size_t>> ranked;
    bool may_any = false;
    for (std::size_t a = 0; a + kSharing < b && !may_any; ++a) may_any = may_coincide(a);
    for (std::size_t a = 0; a + kSharing < b && may_any; ++a)
      ranked.emplace_back(matching::ring_distance(submaps_[a].keys, submaps_[b].keys), a);
    std::sort(ranked.begin(), ranked.end());
    if (ranked.size() > kAlikeTried) ranked.resize(kAlikeTried);
    std::size_t chosen = 0;
    for (const auto& [unlikeness, a] : ranked) {
      if (!may_coincide(a) || is_known(a, b) || chosen == kAlike) continue;
      ++chosen;
      pairs.emplace_back(unlikeness, a, b);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  if (pairs.size() > kMostAlike) pairs.resize(kMostAlike);
  std::vector<std::pair<std::size_t, std::size_t>> result;
  for (const auto& pair : pairs) result.emplace_back(std::get<1>(pair), std::get<2>(pair));
  return result;
}

void LaserLoopCloser::close_unexpected(const Map& map) {
  std::vector<Loop> proposed, doubtful;
  for (const auto& [a, b] : alike()) {
    // The middles of their walls on each other, with the heading that is expected.
    const double phi = between(poses_[a], poses_[b]).phi;
    const auto &centre_a = submaps_[a].centre, &centre_b = submaps_[b].centre;
    const Pose2 turned = compose(Pose2{0.0, 0.0, phi}, Pose2{centre_b.x, centre_b.y, 0.0});
    matching::WideWindow window;
    window.a_from_b = {centre_a.x - turned.x, centre_a.y - turned.y, phi};
    window.radius_m = std::clamp(kOverlapping * static_cast<double>(submaps_[a].radius_m + submaps_[b].radius_m),
                                 kLeastWindow_m, kLargestWindow_m);
    window.yaw_rad = kYaw_rad;
    Judgement judgement = judged(a, b, window, map);
    if (judgement.hypotheses.empty()) continue;
    const bool holds = is_believed(judgement);
    if (!holds && judgement.doubt != Reason::contradiction) continue;
    (holds ? proposed : doubtful).push_back(loop_of(a, b, std::move(judgement)));
  }
  if (!proposed.empty() && closes(proposed, map)) return;
  // Each by itself: wrong ones contradict right ones, and one place may have changed where those beside it have not.
  std::stable_sort(doubtful.begin(), doubtful.end(), [](const Loop& one, const Loop& other) {
    return one.judgement.probability > other.judgement.probability;
  });
  if (proposed.size() == 1) proposed.clear();
  proposed.insert(proposed.end(), doubtful.begin(), doubtful.end());
  if (proposed.size() > kMostTried) proposed.resize(kMostTried);
  for (const Loop& loop : proposed)
    if (closes({loop}, map)) return;
}

// Whether loops beside the proposed ones agree, and hold once the map is bent by them. If not, they are taken back.
bool LaserLoopCloser::closes(const std::vector<Loop>& proposed, const Map& map) {
  const std::vector<Pose2> poses = poses_;
  const std::vector<Loop> loops = loops_;
  Pairs contradicting;
  for (const Loop& loop : proposed)
    if (is_believed(loop.judgement)) loops_.push_back(loop);
  for (const Loop& loop : proposed) search_beside(loop, map, contradicting);
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
      if (search(a, b, window, map) == Found::contradiction) contradicting.insert({a, b});
    }
}

}  // namespace mapweave::laser
