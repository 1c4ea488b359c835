#include "repetition.h"

#include <algorithm>

namespace mapweave::fusion {
namespace {

constexpr std::size_t kOneIn = 6;  // witnesses at places that repeat are too many

// Elsewhere in the same map, what looks most like this keyframe.
std::vector<VisualQuestion> elsewhere(const VisualMap& map, std::size_t keyframe, const VisualFusionOptions& options) {
  constexpr double kApart_m = 2.0;   // nearer, it is the same place
  constexpr std::size_t kAsked = 2;  // most alike elsewhere: bounds time
  const MappedKeyframe& here = map.keyframes()[keyframe];
  const int least = std::max(1, static_cast<int>(options.least_alike * here.likeness));
  const auto is_here = [&](const NodeId& id) {
    const std::size_t other = map.number_of(id);
    return beside(map, keyframe, other) ||
           (map.keyframes()[other].map_from_camera.t - here.map_from_camera.t).norm() < kApart_m;
  };
  std::vector<VisualQuestion> questions;
  for (const matching::SimilarPlace& place : map.alike(here.words->bag, least, kAsked, is_here))
    questions.push_back({keyframe, map.number_of(place.id)});
  return questions;
}

// Adds a witness whose keyframes none before it has.
bool is_of_its_own(const VisualWitness& w, VisualRepetition& looked_at) {
  if (looked_at.of_a.count(w.keyframe_a) != 0 || looked_at.of_b.count(w.keyframe_b) != 0) return false;
  looked_at.of_a.insert(w.keyframe_a);
  looked_at.of_b.insert(w.keyframe_b);
  return true;
}

}  // namespace

VisualRepetition repetition_within(const VisualMap& a, const VisualMap& b, std::vector<const VisualWitness*> clique,
                                   const FusionOptions& options, VisualJudge& judge, std::vector<Hash>& judged) {
  constexpr std::size_t kMostLooks = 12;  // twice kOneIn: bounds time
  constexpr double kMoved_m = 1.0;        // less, and the match says where the keyframe is anyway
  std::stable_sort(clique.begin(), clique.end(), [](const VisualWitness* one, const VisualWitness* other) {
    return one->judgement.probability > other->judgement.probability;
  });
  VisualRepetition found, looked_at;
  const auto repeats = [&](const VisualMap& map, std::size_t keyframe) {
    for (const VisualWitness& w : judge.ask(map, map, elsewhere(map, keyframe, options.visual))) {
      judged.push_back(w.judgement.id);
      const Eigen::Vector3d& there = map.keyframes()[w.keyframe_b].map_from_node.t;
      if (!holds(w, {}, options) || (transformed(there, w.a_from_b) - there).norm() < kMoved_m) continue;
      found.because.push_back(w.judgement.id);
      return true;
    }
    return false;
  };
  for (const VisualWitness* w : clique) {
    if (looked_at.of_a.size() == kMostLooks || kOneIn * found.of_a.size() >= kMostLooks) break;
    if (is_of_its_own(*w, looked_at) && (repeats(a, w->keyframe_a) || repeats(b, w->keyframe_b))) {
      found.of_a.insert(w->keyframe_a);
      found.of_b.insert(w->keyframe_b);
    }
  }
  return kOneIn * found.of_a.size() < looked_at.of_a.size() ? VisualRepetition{} : found;
}

VisualRepetition repetition_between(const VisualMap& a, const VisualMap& b,
                                    const std::vector<const VisualWitness*>& clique,
                                    const std::vector<const VisualWitness*>& rivals) {
  VisualRepetition found;
  for (const VisualWitness* one : clique)
    for (const VisualWitness* other : rivals) {
      if (!beside(a, one->keyframe_a, other->keyframe_a) && !beside(b, one->keyframe_b, other->keyframe_b)) continue;
      found.of_a.insert({one->keyframe_a, other->keyframe_a});
      found.of_b.insert({one->keyframe_b, other->keyframe_b});
      found.because.push_back(other->judgement.id);
    }
  std::sort(found.because.begin(), found.because.end());
  found.because.erase(std::unique(found.because.begin(), found.because.end()), found.because.end());
  return found;
}

bool rests_on(const std::set<std::size_t>& known_of_a, const std::set<std::size_t>& known_of_b, const VisualMap& a,
              const VisualMap& b, const std::vector<VisualWitness>& witnesses) {
  const auto is_known = [](const std::set<std::size_t>& known, const VisualMap& map, std::size_t keyframe) {
    return std::any_of(known.begin(), known.end(), [&](std::size_t other) { return beside(map, keyframe, other); });
  };
  VisualRepetition looked_at;
  std::size_t repeated = 0;
  for (const VisualWitness& w : witnesses)
    repeated +=
        is_of_its_own(w, looked_at) && (is_known(known_of_a, a, w.keyframe_a) || is_known(known_of_b, b, w.keyframe_b));
  return repeated > 0 && kOneIn * repeated >= looked_at.of_a.size();
}

}  // namespace mapweave::fusion
