#include "visual_map.h"

#include <mapweave/fusion/place_finder.h>

#include <mapweave/matching/rigid_from_points.h>

#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

constexpr double kSamePlace_m = 1.0, kSamePlace_rad = 0.5;  // answers that far apart are two places

}  // namespace

struct PlaceFinder::Known {
  VisualMap map;
  matching::ChosenVocabulary vocabulary;
};

PlaceFinder::PlaceFinder(const Map& map, const matching::ChosenVocabulary& vocabulary, BagOfWordsCache& pictures,
                         WorkerPool& pool)
    : known_(new Known{VisualMap(map, vocabulary, pictures, pool), vocabulary}) {}
PlaceFinder::~PlaceFinder() = default;
PlaceFinder::PlaceFinder(PlaceFinder&&) noexcept = default;
PlaceFinder& PlaceFinder::operator=(PlaceFinder&&) noexcept = default;

std::optional<FoundPlace> PlaceFinder::find(const KeyframeFeatures& picture, const FusionOptions& options,
                                            WorkerPool& pool) const {
  const VisualMap& map = known_->map;
  if (map.empty()) return std::nullopt;
  Map asked;  // of this picture alone, named before all others
  asked.nodes.set(NodeId{}, {NodeId{}, {}, {}, std::make_shared<const Payload>(picture)});
  BagOfWordsCache pictures;
  const VisualMap question(asked, known_->vocabulary, pictures, pool);
  const VisualPlace place = question.place(0, 0);
  std::vector<matching::SimilarPlace> alike =
      map.alike(question.keyframes().front().words->bag, 1, static_cast<std::size_t>(options.visual.candidates));
  alike.erase(std::remove_if(alike.begin(), alike.end(),
                             [&](const matching::SimilarPlace& one) {
                               return one.score <
                                      options.visual.least_alike * map.keyframes()[map.number_of(one.id)].likeness;
                             }),
              alike.end());
  const auto found = pool.map(alike.size(), [&](std::size_t i) -> std::optional<FoundPlace> {
    const std::size_t keyframe = map.number_of(alike[i].id);
    const VisualPlace there = map.place(keyframe, static_cast<std::size_t>(options.visual.covisible));
    const Judgement judgement = matching::judge_places(place.view, there.view, options.visual.judge).judgement;
    if (judgement.hypotheses.empty() || judgement.doubt != Reason::none ||
        judgement.probability < options.min_probability)
      return std::nullopt;
    const Pose3 there_from_asked = inverse(judgement.hypotheses.front().a_from_b).pose;
    return FoundPlace{alike[i].id, compose(map.keyframes()[keyframe].map_from_node, there_from_asked),
                      judgement.probability};
  });
  std::optional<FoundPlace> best;
  for (const auto& one : found) {
    if (!one) continue;
    if (best) {
      const Pose3 apart = between(best->map_from_robot, one->map_from_robot);
      if (apart.t.norm() > kSamePlace_m || 2.0 * std::asin(std::min(1.0, apart.q.vec().norm())) > kSamePlace_rad)
        return std::nullopt;
    }
    if (!best || one->probability > best->probability) best = one;
  }
  return best;
}

}  // namespace mapweave::fusion
