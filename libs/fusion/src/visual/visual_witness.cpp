#include "visual_witness.h"

#include <mapweave/core/interrupt.h>

#include <Eigen/LU>
#include <algorithm>
#include <set>

namespace mapweave::fusion {
namespace {

const Pose3& extrinsics(const VisualMap& map, std::size_t keyframe) {
  return map.keyframes()[keyframe].content->geometry->robot_from_camera;
}

}  // namespace

Eigen::Matrix<double, 6, 6> exchanged(const Eigen::Matrix<double, 6, 6>& covariance, const Sim3& a_from_b) {
  const Eigen::Matrix3d rotation = a_from_b.pose.q.toRotationMatrix();
  const Eigen::Vector3d& t = a_from_b.pose.t;
  Eigen::Matrix3d cross;
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  Eigen::Matrix<double, 6, 6> carry = Eigen::Matrix<double, 6, 6>::Zero();
  carry.topLeftCorner<3, 3>() = a_from_b.scale * rotation;
  carry.bottomRightCorner<3, 3>() = rotation;
  carry.topRightCorner<3, 3>() = cross * rotation;
  return carry * covariance * carry.transpose();
}

MetricWitness rescaled(const VisualWitness& w, const VisualMap& a, const VisualMap& b, double scale_a, double scale_b) {
  MetricWitness result{w.node_a_from_node_b.pose, w.information};
  const Pose3& here = w.node_a_from_node_b.pose;
  const Eigen::Vector3d &camera_a = extrinsics(a, w.keyframe_a).t, &camera_b = extrinsics(b, w.keyframe_b).t;
  if (scale_a != 1.0 || w.node_a_from_node_b.scale != 1.0) {
    const Eigen::Vector3d b_in_a = transformed(camera_b, w.node_a_from_node_b);  // b's camera, in a's scale
    result.node_a_from_node_b.t = camera_a + scale_a * (b_in_a - camera_a) - here.q * camera_b;
  }
  // Of a small motion of b, in b's scale.
  result.information.topRows<3>() /= scale_b;
  result.information.leftCols<3>() /= scale_b;
  return result;
}

VisualJudge::VisualJudge(const VisualFusionOptions& options, const FusionInput& input, Memo& memo, WorkerPool& pool)
    : options_(options), memo_(memo), pool_(pool) {
  for (const Judgement& judgement : input.judged) {
    const auto [known, is_new] = before_.emplace(std::make_pair(judgement.a, judgement.b), &judgement);
    if (!is_new && known->second->probability < judgement.probability) known->second = &judgement;
  }
  for (const auto& [places, judgement] : before_)
    if (!judgement->hypotheses.empty() && judgement->doubt == Reason::none)
      same_[{places.first.session, places.second.session}].push_back(judgement);
}

std::vector<VisualQuestion> VisualJudge::known_places(const VisualMap& a, const VisualMap& b) const {
  constexpr std::size_t kMost = 24;  // bounds time
  const auto sessions_of = [](const VisualMap& map) {
    std::set<SessionId> sessions;
    for (const MappedKeyframe& keyframe : map.keyframes()) sessions.insert(keyframe.id.session);
    return sessions;
  };
  std::vector<std::tuple<double, std::size_t, std::size_t>> ranked;
  const auto add = [&](const SessionId& one, const SessionId& other, bool swapped) {
    const auto known = same_.find({one, other});
    if (known == same_.end()) return;
    for (const Judgement* judgement : known->second) {
      const SubmapId &in_a = swapped ? judgement->b : judgement->a, &in_b = swapped ? judgement->a : judgement->b;
      const std::size_t i = a.number_of({in_a.session, in_a.index}), j = b.number_of({in_b.session, in_b.index});
      if (i < a.keyframes().size() && j < b.keyframes().size()) ranked.emplace_back(-judgement->probability, i, j);
    }
  };
  for (const SessionId& one : sessions_of(a))
    for (const SessionId& other : sessions_of(b)) other < one ? add(other, one, true) : add(one, other, false);
  std::sort(ranked.begin(), ranked.end());
  std::vector<VisualQuestion> questions;
  std::set<std::size_t> of_a, of_b;
  for (const auto& [probability, i, j] : ranked)
    if (questions.size() < kMost && of_a.count(i) == 0 && of_b.count(j) == 0) {
      questions.push_back({i, j});
      of_a.insert(i);
      of_b.insert(j);
    }
  return questions;
}

std::vector<VisualWitness> VisualJudge::ask(const VisualMap& a, const VisualMap& b,
                                            const std::vector<VisualQuestion>& questions, bool by_words) {
  const auto place_id = [](const VisualMap& map, std::size_t keyframe) {
    const NodeId& id = map.keyframes()[keyframe].id;
    return SubmapId{id.session, id.index};
  };
  // The scale of a single camera may have changed since.
  const bool may_be_old = a.is_metric() && b.is_metric();
  std::vector<const Judgement*> old(questions.size(), nullptr);
  std::set<std::size_t> of_a, of_b;
  for (std::size_t i = 0; i < questions.size(); ++i) {
    const auto [in_a, in_b] = questions[i];
    const std::pair<SubmapId, SubmapId> ids = std::minmax(place_id(a, in_a), place_id(b, in_b));
    if (const auto found = before_.find(ids); may_be_old && found != before_.end()) {
      old[i] = found->second;
    } else {
      of_a.insert(in_a);
      of_b.insert(in_b);
    }
  }
  const auto places_of = [&](const VisualMap& map, const std::set<std::size_t>& numbers) {
    const std::vector<std::size_t> order(numbers.begin(), numbers.end());
    auto made = pool_.map(order.size(), [&](std::size_t i) {
      return map.place(order[i], static_cast<std::size_t>(options_.covisible), by_words);
    });
    std::map<std::size_t, VisualPlace> places;
    for (std::size_t i = 0; i < order.size(); ++i) places.emplace(order[i], std::move(made[i]));
    return places;
  };
  const auto places_a = places_of(a, of_a), places_b = places_of(b, of_b);
  const auto judged = [&](const VisualQuestion& question, bool swapped) {
    const matching::PlaceView &one = places_a.at(question.keyframe_a).view,
                              &other = places_b.at(question.keyframe_b).view;
    const matching::PlaceView &first = swapped ? other : one, &second = swapped ? one : other;
    const auto known = memo_.find(matching::visual_judgement_id(first.content, second.content, options_.judge));
    return known != memo_.end() ? known->second : matching::judge_places(first, second, options_.judge).judgement;
  };
  auto witnesses = pool_.map(questions.size(), [&](std::size_t i) {
    throw_if_interrupted();
    const auto [in_a, in_b] = questions[i];
    const bool swapped = place_id(b, in_b) < place_id(a, in_a);
    VisualWitness witness;
    witness.keyframe_a = in_a;
    witness.keyframe_b = in_b;
    witness.judgement = old[i] != nullptr ? *old[i] : judged(questions[i], swapped);
    if (witness.judgement.hypotheses.empty()) return witness;
    const Alignment& best = witness.judgement.hypotheses.front();
    witness.node_a_from_node_b = swapped ? inverse(best.a_from_b) : best.a_from_b;
    const Eigen::Matrix<double, 6, 6> covariance =
        swapped ? exchanged(best.covariance, best.a_from_b) : best.covariance;
    witness.information = covariance.inverse();
    witness.information = (0.5 * (witness.information + witness.information.transpose())).eval();
    witness.a_from_b = compose(compose(Sim3{a.keyframes()[in_a].map_from_node, 1.0}, witness.node_a_from_node_b),
                               Sim3{inverse(b.keyframes()[in_b].map_from_node), 1.0});
    return witness;
  });
  for (const VisualWitness& witness : witnesses) memo_.emplace(witness.judgement.id, witness.judgement);
  return witnesses;
}

bool holds(const VisualWitness& w, const std::set<Hash>& vetoed, const FusionOptions& options) {
  return !w.judgement.hypotheses.empty() && w.judgement.doubt == Reason::none &&
         w.judgement.probability >= options.min_probability && vetoed.count(w.judgement.id) == 0;
}

bool beside(const VisualMap& map, std::size_t keyframe, std::size_t other) {
  const auto& covisible = map.keyframes()[keyframe].covisible;
  return keyframe == other ||
         std::any_of(covisible.begin(), covisible.end(), [&](const auto& entry) { return entry.second == other; });
}

}  // namespace mapweave::fusion
