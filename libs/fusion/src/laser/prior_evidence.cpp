#include "prior_evidence.h"
#include "sorted_numbers.h"

#include <mapweave/maps/map_noise.h>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace mapweave::fusion {
namespace {

// A prior that agrees outweighs what would fit by chance in a large map, but no clear contradiction; one in five may be
// wrong altogether.
constexpr double kMostLogOdds = 4.0, kWrong = 0.2;
// Of a match that agrees, log odds: twice what a hypothesis has to begin with (kLeastSeed in merge_evaluation.cpp),
// half of what the prior says of the whole.
constexpr double kSeedWeight = 2.0;
// Around where the prior puts a submap. The bound on the radius is that of wide windows, the floors are what submaps of
// the best prior are off.
constexpr double kSigmas = 3.0, kLeastReach_m = 0.5, kFarthestReach_m = kWideRadius_m, kLeastReach_rad = 0.04;
constexpr double kNearSigmas = 2.0;  // farther apart than submaps that share walls: pairs are asked about all the same
constexpr std::size_t kNearest = 2;  // submaps of the other map for each: a place lies in two, as submaps overlap
constexpr std::size_t kMostQuestions = 16;  // of a pair of maps, the nearest first: bounds the time that a prior costs
// Walls that are seen through where the prior puts maps that were not merged: a moved chair is less than a metre, and
// maps that are bent contradict each other a little wherever much coincides.
constexpr double kLeastContradiction_m = 1.0, kContradictedShare = 0.5;
constexpr double kContradicted = 11.3;  // chi2 of three degrees of freedom: 99 % of what agrees is nearer

double reach(const matching::Point2f& centre) { return std::hypot(centre.x, centre.y); }

}  // namespace

PriorEvidence::PriorEvidence(const std::vector<PreparedMap>& maps, const SubmapGraph& graph,
                             const std::vector<MapPrior>& priors)
    : maps_(maps), graph_(graph) {
  const auto number_of = [&](const MapId& id) {
    return static_cast<std::size_t>(
        std::find_if(maps.begin(), maps.end(), [&](const PreparedMap& map) { return map.map->id == id; }) -
        maps.begin());
  };
  for (const MapPrior& prior : priors) {
    const std::size_t a = number_of(prior.a), b = number_of(prior.b);
    if (a < maps.size() && b < maps.size() && a != b && of(std::min(a, b), std::max(a, b)) == nullptr)
      priors_.push_back({a, b, prior.a_from_b, prior.sigma_m, prior.sigma_rad});
  }
}

const PriorEvidence::Prior* PriorEvidence::of(std::size_t a, std::size_t b) const {
  for (const Prior& prior : priors_)
    if (std::minmax(prior.a, prior.b) == std::minmax(a, b)) return &prior;
  return nullptr;
}

double PriorEvidence::distance2(const Prior& prior, const Pose2& a_from_b, double drift_m) {
  const Pose2 error = between(prior.a_from_b, a_from_b);
  return (error.x * error.x + error.y * error.y) / (prior.sigma_m * prior.sigma_m + drift_m * drift_m) +
         error.phi * error.phi / (prior.sigma_rad * prior.sigma_rad);
}

std::vector<SubmapQuestion> PriorEvidence::questions(std::size_t a, std::size_t b) const {
  const Prior* prior = of(a, b);
  std::vector<SubmapQuestion> result;
  if (prior == nullptr) return result;
  const Pose2 a_from_b = prior->a == a ? prior->a_from_b : inverse(prior->a_from_b);
  const PreparedMap &one = maps_[a], &other = maps_[b];
  std::vector<std::tuple<double, Hash, Hash, SubmapQuestion>> ranked;
  for (const std::size_t j : other.representatives) {
    const Eigen::Vector2d there = middle_of(other, j, compose(a_from_b, other.map_from_submap[j]));
    std::vector<std::tuple<double, Hash, std::size_t, double>> near;
    for (const std::size_t i : one.representatives) {
      const double distance = std::hypot(one.centres[i].x - there.x(), one.centres[i].y - there.y());
      const double lever_m = reach(prior->a == a ? other.centres[j] : one.centres[i]);
      const double drift_m = kPathDrift_per_m * (reach(one.centres[i]) + reach(other.centres[j]));
      const double sigma_m = std::sqrt(prior->sigma_m * prior->sigma_m +
                                       lever_m * lever_m * prior->sigma_rad * prior->sigma_rad + drift_m * drift_m);
      if (distance < std::min(kFarSubmaps_m, kNearSubmaps_m + kNearSigmas * sigma_m))
        near.emplace_back(distance, one.fingerprints[i], i, sigma_m);
    }
    std::sort(near.begin(), near.end());
    for (std::size_t k = 0; k < std::min(kNearest, near.size()); ++k) {
      const auto& [distance, print, i, sigma_m] = near[k];
      SubmapQuestion question{graph_.number(a, i), graph_.number(b, j), {}, Thoroughness::whole, Proposer::prior};
      question.from_from_to.a_from_b = between(one.map_from_submap[i], compose(a_from_b, other.map_from_submap[j]));
      question.from_from_to.radius_m = std::clamp(kSigmas * sigma_m, kLeastReach_m, kFarthestReach_m);
      question.from_from_to.yaw_rad = std::min(M_PI, kLeastReach_rad + kSigmas * prior->sigma_rad);
      const auto prints = std::minmax(print, other.fingerprints[j]);
      ranked.emplace_back(distance, prints.first, prints.second, question);
    }
  }
  std::stable_sort(ranked.begin(), ranked.end(), [](const auto& l, const auto& r) {
    return std::tie(std::get<0>(l), std::get<1>(l), std::get<2>(l)) <
           std::tie(std::get<0>(r), std::get<1>(r), std::get<2>(r));
  });
  for (std::size_t k = 0; k < std::min(kMostQuestions, ranked.size()); ++k) result.push_back(std::get<3>(ranked[k]));
  return result;
}

double PriorEvidence::weight(const SubmapMatch& match) const {
  const std::size_t from = graph_.map_of(match.from), to = graph_.map_of(match.to);
  const Prior* prior = of(from, to);
  if (prior == nullptr) return 0.0;
  const std::size_t i = graph_.submap_of(match.from), j = graph_.submap_of(match.to);
  const Pose2 from_from_to =
      compose(compose(maps_[from].map_from_submap[i], match.from_from_to), inverse(maps_[to].map_from_submap[j]));
  const double drift_m = kPathDrift_per_m * (reach(maps_[from].centres[i]) + reach(maps_[to].centres[j]));
  return kSeedWeight *
         std::exp(-0.5 * distance2(*prior, prior->a == from ? from_from_to : inverse(from_from_to), drift_m));
}

double PriorEvidence::log_odds(const SolvedSubmaps& solved, const std::vector<std::size_t>& x,
                               const std::vector<std::size_t>& z) const {
  double sum = 0.0;
  std::size_t count = 0;
  const auto map_frame = [&](std::size_t map) {
    return compose(solved.pose_of(graph_.number(map, 0)), inverse(maps_[map].map_from_submap.front()));
  };
  for (const Prior& prior : priors_) {
    if (!(contains(x, prior.a) && contains(z, prior.b)) && !(contains(z, prior.a) && contains(x, prior.b))) continue;
    const double d2 = distance2(prior, between(map_frame(prior.a), map_frame(prior.b)), 0.0);
    sum += std::log(kWrong + std::exp(kMostLogOdds - 0.5 * d2));
    ++count;
  }
  // Priors of one group come from the same starts: together they say no more than one does.
  return count == 0 ? 0.0 : sum / static_cast<double>(count);
}

std::optional<PriorCheck> PriorEvidence::check(
    std::size_t a, std::size_t b, const std::optional<Pose2>& a_from_b,
    const std::function<WallAgreement(const Pose2& a_from_b)>& walls_at) const {
  const Prior* prior = of(a, b);
  if (prior == nullptr) return std::nullopt;
  PriorCheck check;
  check.a_from_b = prior->a == a ? prior->a_from_b : inverse(prior->a_from_b);
  check.sigma_m = prior->sigma_m;
  check.sigma_rad = prior->sigma_rad;
  if (a_from_b) {
    const Pose2 error = between(check.a_from_b, *a_from_b);
    check.off_m = std::hypot(error.x, error.y);
    check.off_rad = std::abs(error.phi);
    check.is_contradicted = distance2(*prior, prior->a == a ? *a_from_b : inverse(*a_from_b), 0.0) > kContradicted;
  }
  if (maps_[a].submaps.empty() || maps_[b].submaps.empty()) return check;
  const WallAgreement walls = walls_at(check.a_from_b);
  check.coinciding_m = walls.coinciding_m;
  check.contradicted_m = walls.contradicted_m;
  if (!a_from_b)
    check.is_contradicted =
        walls.contradicted_m > std::max(kLeastContradiction_m, kContradictedShare * walls.coinciding_m);
  return check;
}

}  // namespace mapweave::fusion
