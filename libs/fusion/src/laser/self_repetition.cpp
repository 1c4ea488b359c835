// Whether what makes two maps fit stands more than once in one of them.

#include "laser_team.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace mapweave::fusion {

// Whether most of the places that fit look, to the judge, like other places of the same map: then they would fit there as well.
bool LaserMerger::looks_like_elsewhere(const MergeHypothesis& hypothesis) {
  constexpr std::size_t kMostPlaces = 6;
  constexpr double kElsewhere_m = 4.0;
  constexpr double kAsSure = 0.9, kAlike = 0.85;
  std::vector<std::size_t> places;
  for (const SubmapMatch& match : hypothesis.matches) {
    places.push_back(match.from);
    places.push_back(match.to);
  }
  std::sort(places.begin(), places.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
  std::vector<SubmapQuestion> questions;
  const std::size_t count = std::min(kMostPlaces, places.size());
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t here = places[k * places.size() / count], map = graph_.map_of(here);
    const PreparedMap& own = maps_[map];
    const std::size_t s = graph_.submap_of(here);
    std::vector<std::tuple<double, Hash, std::size_t>> alike;
    for (const std::size_t other : own.representatives)
      if (std::hypot(own.centres[other].x - own.centres[s].x, own.centres[other].y - own.centres[s].y) > kElsewhere_m &&
          !graph_.is_tied(here, graph_.number(map, other)))
        alike.emplace_back(matching::ring_distance(own.keys[s], own.keys[other]) + matching::ring_distance(own.far_keys[s], own.far_keys[other]),
                           own.fingerprints[other], other);
    if (alike.empty()) continue;
    const std::size_t other = std::get<2>(*std::min_element(alike.begin(), alike.end()));
    questions.push_back({here, graph_.number(map, other), window_for(map, s, map, other)});
  }
  std::size_t repeated = 0;
  for (const SubmapAnswer& answer : judge_.ask(questions)) {
    if (answer.hypotheses.empty()) continue;
    if (answer.judgement.doubt == Reason::ambiguous) {
      ++repeated;  // it fits there even in two ways
      continue;
    }
    const PreparedMap& own = maps_[graph_.map_of(answer.from)];
    const Pose2 as_mapped = between(own.map_from_submap[graph_.submap_of(answer.from)], own.map_from_submap[graph_.submap_of(answer.to)]);
    const auto is_elsewhere = [&](const SubmapMatch& match) {
      const Pose2 apart = between(as_mapped, match.from_from_to);
      return std::hypot(apart.x, apart.y) > 1.0 || std::abs(apart.phi) > 0.3;
    };
    const SubmapMatch& best = answer.hypotheses.front();
    if (!answer.holds || best.probability < kAsSure || !best.is_observable) continue;
    repeated += is_elsewhere(best) || (answer.judgement.evidence.second_best_ratio > kAlike && answer.hypotheses.size() > 1 &&
                                       is_elsewhere(answer.hypotheses[1]));
  }
  return questions.size() >= 2 && 2 * repeated >= questions.size();
}

}  // namespace mapweave::fusion
