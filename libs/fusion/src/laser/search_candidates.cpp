#include "search_candidates.h"

#include <mapweave/maps/alignment.h>
#include <mapweave/maps/map_noise.h>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace mapweave::fusion {
namespace {

constexpr double kKnown_m = 0.07, kKnown_rad = 0.01;  // a match of what is known as well says nothing new
constexpr double kFarthestReach_m = 50.0;
// Of where the graph expects a submap: what is compared at all, and the wider window in which it is searched.
constexpr double kReachSigmas = 2.5, kWindowSigmas = 3.0;
// Of a window: what submaps are off however sure the graph is.
constexpr double kLeastWindow_m = 0.5, kLeastYaw_rad = 0.04;
// Since a pair was examined: moved by less, as a share of its window's radius and in heading, it is where it was.
constexpr double kMovedShare = 0.5, kMoved_rad = 0.1;
constexpr double kUnexpectedSigmas = 12.0;  // what the graph may be wrong by, where it misses a loop: 7 were seen
constexpr std::size_t kAlike = 4, kAlikeTried = 16;  // that a place chooses, from so many that look most like it
constexpr std::size_t kMostAlike = 600;              // questions
constexpr std::size_t kNearest = 2, kNearestWide = 1, kAlikeWide = 2;  // that a submap chooses; others choose it, too

// Of motions of a frame, as motions of a place of the team's frame that moves along with it.
Eigen::Matrix3d at_place(const Eigen::Matrix3d& covariance, const Pose2& team_from_frame,
                         const Eigen::Vector2d& place) {
  const Eigen::Matrix3d carry = adjoint(between(Pose2{place.x(), place.y(), 0.0}, team_from_frame));
  return carry * covariance * carry.transpose();
}

}  // namespace

double position_sigma(const Eigen::Matrix3d& covariance) {
  const double half = 0.5 * (covariance(0, 0) + covariance(1, 1)),
               difference = 0.5 * (covariance(0, 0) - covariance(1, 1));
  return std::sqrt(std::max(0.0, half + std::sqrt(difference * difference + covariance(0, 1) * covariance(0, 1))));
}

bool SearchCandidates::Near::operator<(const Near& other) const {
  return std::tie(distance, unlikeness, place) < std::tie(other.distance, other.unlikeness, other.place);
}

SearchCandidates::SearchCandidates(const std::vector<PreparedMap>& maps, const SubmapGraph& graph,
                                   const SubmapsInScope& in_scope, const SolvedSubmaps& solved,
                                   graph::RelativeCovariance& covariance, const ExaminedPairs& examined)
    : maps_(maps), graph_(graph), in_scope_(in_scope), solved_(solved), covariance_(covariance), examined_(examined) {
  for (std::size_t k = 0; k < solved.submaps.size(); ++k) {
    const std::size_t s = solved.submaps[k];
    middles_.push_back(middle_of(maps_[graph_.map_of(s)], graph_.submap_of(s), solved.team_from_submap[k]));
  }
}

// How far apart the middles of two submaps may lie that show the same.
double SearchCandidates::reach_m(std::size_t i, std::size_t j) const {
  const auto radius_m = [&](std::size_t s) {
    return static_cast<double>(
        std::min(matching::kLargestOverlapRadius_m, maps_[graph_.map_of(s)].radii_m[graph_.submap_of(s)]));
  };
  return std::clamp(matching::kOverlapShare * (radius_m(i) + radius_m(j)), kNearSubmaps_m, kFarSubmaps_m);
}

double SearchCandidates::unlikeness(std::size_t i, std::size_t j) const {
  const PreparedMap &map_i = maps_[graph_.map_of(i)], &map_j = maps_[graph_.map_of(j)];
  const std::size_t si = graph_.submap_of(i), sj = graph_.submap_of(j);
  return matching::ring_distance(map_i.keys[si], map_j.keys[sj]) +
         matching::ring_distance(map_i.far_keys[si], map_j.far_keys[sj]);
}

// Whether they were compared where they are still expected.
bool SearchCandidates::is_examined(std::size_t place, std::size_t of) const {
  const auto before = examined_.find({solved_.submaps[place], solved_.submaps[of]});
  if (before == examined_.end()) return false;
  const Pose2 moved =
      between(before->second.expected, between(solved_.team_from_submap[place], solved_.team_from_submap[of]));
  return std::hypot(moved.x, moved.y) < kMovedShare * before->second.radius_m && std::abs(moved.phi) < kMoved_rad;
}

// place < of. Nothing where they are not worth a question.
std::optional<SearchCandidates::Near> SearchCandidates::near(std::size_t place, std::size_t of, double widest_m) {
  const bool is_wide = widest_m > 0.0;
  const std::size_t i = solved_.submaps[place], j = solved_.submaps[of];
  const double distance = (middles_[place] - middles_[of]).norm(), near_m = reach_m(i, j);
  if (distance > (is_wide ? kFarSubmaps_m + kFarthestReach_m : near_m) || !in_scope_(i, j) ||
      graph_.is_constrained(i, j))
    return std::nullopt;
  const Eigen::Matrix3d apart_by =
      covariance_.between(static_cast<std::uint32_t>(place), static_cast<std::uint32_t>(of));
  // At the walls of either, not where a submap happens to begin.
  const Pose2& there = solved_.team_from_submap[of];
  const double sigma_m = std::max(position_sigma(at_place(apart_by, there, middles_[place])),
                                  position_sigma(at_place(apart_by, there, middles_[of])));
  const double sigma_rad = std::sqrt(apart_by(2, 2));
  const bool is_left_out = is_wide ? sigma_m <= kSure_m || sigma_m > widest_m ||
                                         distance > near_m + std::min(kFarthestReach_m, kReachSigmas * sigma_m)
                                   : sigma_m > kSure_m || (sigma_m < kKnown_m && sigma_rad < kKnown_rad);
  if (is_left_out || is_examined(place, of)) return std::nullopt;
  return Near{distance, is_wide ? unlikeness(i, j) : 0.0, place, sigma_m, sigma_rad};
}

// Of each place: others, whichever robot comes first.
std::vector<std::vector<SearchCandidates::Near>> SearchCandidates::all_near(double widest_m) {
  const double reach = widest_m > 0.0 ? kFarSubmaps_m + kFarthestReach_m : kFarSubmaps_m;
  // Blocks, so that only what may be near is compared.
  std::map<std::pair<int, int>, std::vector<std::size_t>> blocks;
  const auto block_of = [&](const Eigen::Vector2d& p) {
    return std::make_pair(matching::cell_of(p.x(), 1.0 / reach), matching::cell_of(p.y(), 1.0 / reach));
  };
  for (std::size_t k = 0; k < middles_.size(); ++k) blocks[block_of(middles_[k])].push_back(k);
  std::vector<std::vector<Near>> result(middles_.size());
  for (std::size_t kj = 0; kj < middles_.size(); ++kj) {
    const auto block = block_of(middles_[kj]);
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x) {
        const auto found = blocks.find({block.first + x, block.second + y});
        if (found == blocks.end()) continue;
        for (const std::size_t ki : found->second) {
          if (ki >= kj) continue;
          auto seen = near(ki, kj, widest_m);
          if (!seen) continue;
          result[kj].push_back(*seen);
          seen->place = kj;
          result[ki].push_back(*seen);
        }
      }
  }
  return result;
}

// The nearest of each place, and of those farther away the most alike. Points into `near`, which it sorts.
SearchCandidates::ChosenPairs SearchCandidates::chosen(std::vector<std::vector<Near>>& near, double widest_m) {
  const bool is_wide = widest_m > 0.0;
  ChosenPairs result;
  const auto choose = [&](std::size_t place, const Near& other) {
    result.emplace(std::minmax(place, other.place), &other);
  };
  // Where hardly anything is known, the nearest are no better than others.
  const std::size_t nearest = is_wide ? (widest_m > kWidest_m ? 0 : kNearestWide) : kNearest;
  for (std::size_t place = 0; place < near.size(); ++place) {
    std::sort(near[place].begin(), near[place].end());
    const std::size_t some = std::min(nearest, near[place].size());
    for (std::size_t k = 0; k < some; ++k) choose(place, near[place][k]);
    if (!is_wide) continue;
    std::vector<std::pair<double, std::size_t>> alike;
    for (std::size_t k = some; k < near[place].size(); ++k) alike.emplace_back(near[place][k].unlikeness, k);
    std::sort(alike.begin(), alike.end());
    for (std::size_t k = 0; k < std::min(kAlikeWide, alike.size()); ++k) choose(place, near[place][alike[k].second]);
  }
  return result;
}

std::vector<SubmapQuestion> SearchCandidates::questions(double widest_m) {
  std::vector<std::vector<Near>> near = all_near(widest_m);
  std::vector<SubmapQuestion> result;
  for (const auto& [pair, between_them] : chosen(near, widest_m)) {
    matching::WideWindow window;
    window.a_from_b = between(solved_.team_from_submap[pair.first], solved_.team_from_submap[pair.second]);
    window.radius_m = std::clamp(kWindowSigmas * between_them->sigma_m, kLeastWindow_m, kFarthestReach_m);
    window.yaw_rad = std::min(M_PI, kLeastYaw_rad + kWindowSigmas * between_them->sigma_rad);
    result.push_back({solved_.submaps[pair.first], solved_.submaps[pair.second], window});
  }
  return result;
}

// The middles of their walls on each other, with the heading that the graph expects.
matching::WideWindow SearchCandidates::window_on_each_other(std::size_t place, std::size_t of, double yaw_rad) const {
  const auto middle_in_submap = [&](std::size_t k) {
    const Pose2& pose = solved_.team_from_submap[k];
    return between(pose, Pose2{middles_[k].x(), middles_[k].y(), pose.phi});
  };
  const double phi = between(solved_.team_from_submap[place], solved_.team_from_submap[of]).phi;
  const Pose2 middle = middle_in_submap(place), other = middle_in_submap(of);
  const Pose2 turned_other = compose(Pose2{0.0, 0.0, phi}, other);
  matching::WideWindow window;
  window.a_from_b = {middle.x - turned_other.x, middle.y - turned_other.y, phi};
  const auto radius_m = [&](std::size_t k) {
    const std::size_t s = solved_.submaps[k];
    return static_cast<double>(maps_[graph_.map_of(s)].radii_m[graph_.submap_of(s)]);
  };
  window.radius_m = wide_radius_m(radius_m(place) + radius_m(of));
  window.yaw_rad = yaw_rad;
  return window;
}

std::vector<SubmapQuestion> SearchCandidates::alike() {
  std::map<std::pair<std::size_t, std::size_t>, std::pair<double, double>> chosen;  // unlikeness, yaw
  for (std::size_t place = 0; place < middles_.size(); ++place) {
    std::vector<std::pair<double, std::size_t>> ranked;
    for (std::size_t of = 0; of < middles_.size(); ++of) {
      const std::size_t i = solved_.submaps[std::min(place, of)], j = solved_.submaps[std::max(place, of)];
      if (i != j && in_scope_(i, j) && !graph_.is_constrained(i, j)) ranked.emplace_back(unlikeness(i, j), of);
    }
    const auto some = static_cast<std::ptrdiff_t>(std::min(kAlikeTried, ranked.size()));
    std::partial_sort(ranked.begin(), ranked.begin() + some, ranked.end());
    std::size_t count = 0;
    for (auto entry = ranked.begin(); entry != ranked.begin() + some && count < kAlike; ++entry) {
      const auto [lower, upper] = std::minmax(place, entry->second);
      const Eigen::Matrix3d apart_by =
          covariance_.between(static_cast<std::uint32_t>(lower), static_cast<std::uint32_t>(upper));
      const Pose2& there = solved_.team_from_submap[upper];
      const double sigma_m = std::max(position_sigma(at_place(apart_by, there, middles_[lower])),
                                      position_sigma(at_place(apart_by, there, middles_[upper])));
      const double farthest_m = reach_m(solved_.submaps[lower], solved_.submaps[upper]) + kUnexpectedSigmas * sigma_m;
      if (sigma_m < kLittleKnown_m || (middles_[lower] - middles_[upper]).norm() > farthest_m) continue;
      ++count;
      chosen[{lower, upper}] = {entry->first,
                                std::min(M_PI, kLeastYaw_rad + kUnexpectedSigmas * std::sqrt(apart_by(2, 2)))};
    }
  }
  std::vector<std::pair<double, SubmapQuestion>> ranked;
  for (const auto& [pair, how] : chosen)
    ranked.push_back({how.first,
                      {solved_.submaps[pair.first], solved_.submaps[pair.second],
                       window_on_each_other(pair.first, pair.second, how.second), Thoroughness::part}});
  std::stable_sort(ranked.begin(), ranked.end(), [](const auto& l, const auto& r) { return l.first < r.first; });
  std::vector<SubmapQuestion> result;
  for (std::size_t k = 0; k < std::min(kMostAlike, ranked.size()); ++k) result.push_back(ranked[k].second);
  return result;
}

bool SearchCandidates::may_be(const SubmapMatch& match) {
  const std::size_t from = solved_.place_of(match.from), to = solved_.place_of(match.to);
  const Pose2 error =
      between(match.from_from_to, between(solved_.team_from_submap[from], solved_.team_from_submap[to]));
  const Eigen::Matrix3d covariance = match.information.inverse() + covariance_.between(static_cast<std::uint32_t>(from),
                                                                                       static_cast<std::uint32_t>(to));
  const Eigen::Vector3d e(error.x, error.y, error.phi);
  return e.dot(covariance.ldlt().solve(e)) < kUnexpectedSigmas * kUnexpectedSigmas;
}

}  // namespace mapweave::fusion
