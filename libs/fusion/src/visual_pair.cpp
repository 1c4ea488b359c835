#include "visual_pair.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/graph/consistent_set.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <deque>
#include <set>

namespace mapweave::fusion {
namespace {

using Eigen::Vector3d;

constexpr double kSameScale = 0.1;  // of the logarithms of two scales

// A small motion of b in its own frame is the opposite motion of a, seen through the transform between them.
Eigen::Matrix<double, 6, 6> exchanged(const Eigen::Matrix<double, 6, 6>& covariance, const Sim3& a_from_b) {
  const Eigen::Matrix3d rotation = a_from_b.pose.q.toRotationMatrix();
  const Vector3d& t = a_from_b.pose.t;
  Eigen::Matrix3d cross;
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  Eigen::Matrix<double, 6, 6> carry = Eigen::Matrix<double, 6, 6>::Zero();
  carry.topLeftCorner<3, 3>() = a_from_b.scale * rotation;
  carry.bottomRightCorner<3, 3>() = rotation;
  carry.topRightCorner<3, 3>() = cross * rotation;
  return carry * covariance * carry.transpose();
}

bool agree(const VisualWitness& one, const VisualWitness& other, const VisualMap& b, const FusionOptions& options) {
  const Vector3d &p = b.keyframes()[one.keyframe_b].map_from_node.t, &q = b.keyframes()[other.keyframe_b].map_from_node.t;
  const Vector3d middle = 0.5 * (p + q);
  const double scale = std::sqrt(one.a_from_b.scale * other.a_from_b.scale), far = scale * (p - q).norm();
  const double apart = (matching::transformed(middle, one.a_from_b) - matching::transformed(middle, other.a_from_b)).norm();
  return apart < options.consistency_m + options.consistency_per_m * far &&
         one.a_from_b.pose.q.angularDistance(other.a_from_b.pose.q) < options.consistency_yaw_rad + 0.002 * far &&
         std::abs(std::log(one.a_from_b.scale / other.a_from_b.scale)) < kSameScale;
}

double log_odds(double p) { return std::log(std::clamp(p, 0.5001, 0.9999) / (1.0 - std::clamp(p, 0.5001, 0.9999))); }

bool holds(const VisualWitness& w, const std::set<Hash>& vetoed, const FusionOptions& options) {
  return !w.judgement.hypotheses.empty() && w.judgement.doubt == Reason::none && w.judgement.probability >= options.min_probability &&
         vetoed.count(w.judgement.id) == 0;
}

// Witnesses of which no two share a keyframe.
std::size_t disjoint(const std::vector<const VisualWitness*>& witnesses) {
  std::set<std::size_t> of_a, of_b;
  std::size_t count = 0;
  for (const VisualWitness* w : witnesses) {
    if (of_a.count(w->keyframe_a) != 0 || of_b.count(w->keyframe_b) != 0) continue;
    of_a.insert(w->keyframe_a), of_b.insert(w->keyframe_b);
    ++count;
  }
  return count;
}

// Mean of the transforms, at the middle of the places in b.
Sim3 mean_transform(const std::vector<const VisualWitness*>& witnesses, const VisualMap& b) {
  Vector3d in_a = Vector3d::Zero(), in_b = Vector3d::Zero();
  Eigen::Vector4d turn = Eigen::Vector4d::Zero();
  double log_scale = 0.0;
  const auto share = 1.0 / static_cast<double>(witnesses.size());
  for (const VisualWitness* w : witnesses) {
    const Vector3d& p = b.keyframes()[w->keyframe_b].map_from_node.t;
    in_b += share * p, in_a += share * matching::transformed(p, w->a_from_b);
    const Eigen::Vector4d q = w->a_from_b.pose.q.coeffs();
    turn += q.dot(witnesses.front()->a_from_b.pose.q.coeffs()) < 0.0 ? Eigen::Vector4d(-q) : q;
    log_scale += share * std::log(w->a_from_b.scale);
  }
  Sim3 result;
  result.scale = std::exp(log_scale);
  result.pose.q = Eigen::Quaterniond(turn).normalized();
  result.pose.t = in_a - result.scale * (result.pose.q * in_b);
  return result;
}

std::vector<VisualQuestion> questions_of(const VisualMap& a, const VisualMap& b, const VisualFusionOptions& options) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> ranked;
  for (std::size_t j = 0; j < b.keyframes().size(); ++j) {
    const MappedKeyframe& keyframe = b.keyframes()[j];
    const int least = std::max(1, static_cast<int>(options.least_alike * keyframe.likeness));
    for (const matching::SimilarPlace& place : a.alike(keyframe.bag, least, static_cast<std::size_t>(options.candidates)))
      ranked.emplace_back(-static_cast<double>(place.score) / std::max(1, keyframe.likeness), a.number_of(place.id),
                          j);  // groups' sums: above 1
  }
  std::sort(ranked.begin(), ranked.end());
  if (ranked.size() > static_cast<std::size_t>(options.most_pairs)) ranked.resize(static_cast<std::size_t>(options.most_pairs));
  std::vector<VisualQuestion> questions;
  for (const auto& [score, i, j] : ranked) questions.push_back({i, j});
  return questions;
}

}  // namespace

bool contradict(const VisualMap& a, const VisualMap& b, const Sim3& a_from_b, VisualJudge& judge, std::vector<Hash>& judged) {
  constexpr double kNear_m = 1.0, kAlike_rad = 0.35;
  constexpr std::size_t kMostLooks = 12, kLeastLooks = 4, kLeastFeatures = 150;
  std::vector<std::tuple<double, std::size_t, std::size_t>> near;
  for (std::size_t j = 0; j < b.keyframes().size(); ++j) {
    if (b.keyframes()[j].points.size() < kLeastFeatures) continue;
    const Pose3 there = carried(a_from_b, b.keyframes()[j].map_from_camera);
    std::pair<double, std::size_t> nearest{1e300, 0};
    for (std::size_t i = 0; i < a.keyframes().size(); ++i) {
      const Pose3& here = a.keyframes()[i].map_from_camera;
      if (a.keyframes()[i].points.size() < kLeastFeatures || (here.t - there.t).norm() > kNear_m) continue;
      const double turn = std::acos(std::clamp((here.q * Vector3d::UnitZ()).dot(there.q * Vector3d::UnitZ()), -1.0, 1.0));
      if (turn < kAlike_rad) nearest = std::min(nearest, {(here.t - there.t).norm() + turn, i});
    }
    if (nearest.first < 1e300) near.emplace_back(nearest.first, nearest.second, j);
  }
  std::sort(near.begin(), near.end());
  if (near.size() > kMostLooks) near.resize(kMostLooks);
  if (near.size() < kLeastLooks) return false;
  std::vector<VisualQuestion> questions;
  for (const auto& [apart, i, j] : near) questions.push_back({i, j});
  std::size_t known = 0;
  for (const VisualWitness& w : judge.ask(a, b, questions)) {
    judged.push_back(w.judgement.id);
    if (w.judgement.hypotheses.empty() || w.judgement.doubt != Reason::none) continue;
    const Vector3d& p = b.keyframes()[w.keyframe_b].map_from_node.t;
    known += (matching::transformed(p, w.a_from_b) - matching::transformed(p, a_from_b)).norm() < kNear_m;
  }
  constexpr std::size_t kOneIn = 5;
  return kOneIn * known < near.size();
}

Sim3 composed(const Sim3& a_from_b, const Sim3& b_from_c) {
  Sim3 result;
  result.scale = a_from_b.scale * b_from_c.scale;
  result.pose.q = (a_from_b.pose.q * b_from_c.pose.q).normalized();
  result.pose.t = matching::transformed(b_from_c.pose.t, a_from_b);
  return result;
}

Pose3 carried(const Sim3& a_from_b, const Pose3& b_from_c) { return composed(a_from_b, {b_from_c, 1.0}).pose; }

VisualJudge::VisualJudge(const VisualFusionOptions& options, const std::vector<Judgement>& before, Memo& memo, WorkerPool& pool)
    : options_(options), memo_(memo), pool_(pool) {
  for (const Judgement& judgement : before) {
    const auto [known, is_new] = before_.emplace(std::make_pair(judgement.a, judgement.b), &judgement);
    if (!is_new && known->second->probability < judgement.probability) known->second = &judgement;
  }
}

std::vector<VisualWitness> VisualJudge::ask(const VisualMap& a, const VisualMap& b, const std::vector<VisualQuestion>& questions,
                                            bool by_words) {
  const auto place_id = [](const VisualMap& map, std::size_t keyframe) {
    const NodeId& id = map.keyframes()[keyframe].id;
    return SubmapId{id.session, id.index};
  };
  // Lengths of a single camera may have changed since.
  const bool may_be_old = a.is_metric() && b.is_metric();
  std::vector<const Judgement*> old(questions.size(), nullptr);
  std::set<std::size_t> of_a, of_b;
  for (std::size_t i = 0; i < questions.size(); ++i) {
    const auto [in_a, in_b] = questions[i];
    const std::pair<SubmapId, SubmapId> ids = std::minmax(place_id(a, in_a), place_id(b, in_b));
    if (const auto found = before_.find(ids); may_be_old && found != before_.end())
      old[i] = found->second;
    else
      of_a.insert(in_a), of_b.insert(in_b);
  }
  const auto places_of = [&](const VisualMap& map, const std::set<std::size_t>& numbers) {
    const std::vector<std::size_t> order(numbers.begin(), numbers.end());
    auto made = pool_.map(order.size(),
                          [&](std::size_t i) { return map.place(order[i], static_cast<std::size_t>(options_.companions), by_words); });
    std::map<std::size_t, VisualPlace> places;
    for (std::size_t i = 0; i < order.size(); ++i) places.emplace(order[i], std::move(made[i]));
    return places;
  };
  const auto places_a = places_of(a, of_a), places_b = places_of(b, of_b);
  const auto judged = [&](const VisualQuestion& question, bool swapped) {
    const matching::PlaceView &one = places_a.at(question.keyframe_a).view, &other = places_b.at(question.keyframe_b).view;
    const matching::PlaceView &first = swapped ? other : one, &second = swapped ? one : other;
    const auto known = memo_.find(matching::visual_judgement_id(first.content, second.content, options_.judge));
    return known != memo_.end() ? known->second : matching::judge_places(first, second, options_.judge).judgement;
  };
  auto witnesses = pool_.map(questions.size(), [&](std::size_t i) {
    throw_if_interrupted();
    const auto [in_a, in_b] = questions[i];
    const bool swapped = place_id(b, in_b) < place_id(a, in_a);
    VisualWitness witness;
    witness.keyframe_a = in_a, witness.keyframe_b = in_b;
    witness.judgement = old[i] != nullptr ? *old[i] : judged(questions[i], swapped);
    if (witness.judgement.hypotheses.empty()) return witness;
    const Alignment& best = witness.judgement.hypotheses.front();
    witness.node_a_from_node_b = swapped ? matching::inverse(best.a_from_b) : best.a_from_b;
    const Eigen::Matrix<double, 6, 6> covariance = swapped ? exchanged(best.covariance, best.a_from_b) : best.covariance;
    witness.information = covariance.inverse();
    witness.information = (0.5 * (witness.information + witness.information.transpose())).eval();
    witness.a_from_b = composed(composed({a.keyframes()[in_a].map_from_node, 1.0}, witness.node_a_from_node_b),
                                {inverse(b.keyframes()[in_b].map_from_node), 1.0});
    return witness;
  });
  for (const VisualWitness& witness : witnesses) memo_.emplace(witness.judgement.id, witness.judgement);
  return witnesses;
}

namespace {

// What the judgements so far make of two maps.
struct Commitment {
  std::vector<const VisualWitness*> clique, others;  // the heaviest set that holds together; those that hold, and agree with none of it
  double weight = 0.0, rival_weight = 0.0;           // of the clique, and of the heaviest set of the others
};

Commitment commitment(const std::deque<VisualWitness>& witnesses, const VisualMap& b, const std::set<Hash>& vetoed,
                      const FusionOptions& options) {
  const auto clique_of = [&](const std::vector<const VisualWitness*>& from, double& weight) {
    std::vector<bool> consistent(from.size() * from.size());
    std::vector<double> weights;
    for (std::size_t i = 0; i < from.size(); ++i) {
      weights.push_back(log_odds(from[i]->judgement.probability));
      for (std::size_t j = 0; j < from.size(); ++j) consistent[i * from.size() + j] = i != j && agree(*from[i], *from[j], b, options);
    }
    std::vector<const VisualWitness*> members;
    for (const auto i : graph::consistent_set(consistent, weights)) members.push_back(from[i]), weight += weights[i];
    return members;
  };
  std::vector<const VisualWitness*> good;
  for (const VisualWitness& w : witnesses)
    if (holds(w, vetoed, options)) good.push_back(&w);
  Commitment result;
  if (good.empty()) return result;
  result.clique = clique_of(good, result.weight);
  for (const VisualWitness* w : good)
    if (std::none_of(result.clique.begin(), result.clique.end(),
                     [&](const VisualWitness* c) { return c == w || agree(*c, *w, b, options); }))
      result.others.push_back(w);
  if (!result.others.empty()) clique_of(result.others, result.rival_weight);
  return result;
}

bool beside(const VisualMap& map, std::size_t keyframe, std::size_t other) {
  const auto& companions = map.keyframes()[keyframe].companions;
  return keyframe == other ||
         std::any_of(companions.begin(), companions.end(), [&](const auto& companion) { return companion.second == other; });
}

// Whether they would look at the same things from near, if b lay so.
bool would_see_the_same(const VisualMap& a, const VisualMap& b, const VisualQuestion& question, const Sim3& a_from_b) {
  constexpr double kNear_m = 3.0, kAlike_rad = 0.9;
  const Pose3 &here = a.keyframes()[question.keyframe_a].map_from_camera,
              there = carried(a_from_b, b.keyframes()[question.keyframe_b].map_from_camera);
  const bool is_near = !a.is_metric() || (here.t - there.t).norm() < kNear_m;
  return is_near && std::acos(std::clamp((here.q * Vector3d::UnitZ()).dot(there.q * Vector3d::UnitZ()), -1.0, 1.0)) < kAlike_rad;
}

// Judged in rounds, those told first, then those most alike, so that maps that clearly lie on each other cost little. Once enough witnesses
// agree and nothing speaks against them, pairs beside one of theirs are left out (they see the same again), and of those that could only
// be rivals all but the first. Rounds that bring nothing new are then the last. Where anything contradicts, all are judged. Vetoes change
// nothing here: what they take away, no other judgement takes the place of.
class Rounds {
 public:
  Rounds(const VisualMap& a, const VisualMap& b, const FusionOptions& options, VisualJudge& judge)
      : a_(a), b_(b), options_(options), judge_(judge) {}

  std::deque<VisualWitness> run(const std::vector<VisualQuestion>& told) {
    open_ = told;
    while (!open_.empty() && !is_over_) round(true);
    for (const VisualQuestion& question : questions_of(a_, b_, options_.visual))
      if (std::none_of(witnesses_.begin(), witnesses_.end(),
                       [&](const VisualWitness& w) { return w.keyframe_a == question.keyframe_a && w.keyframe_b == question.keyframe_b; }))
        open_.push_back(question);
    is_over_ = false, barren_ = 0;
    leave_out();
    while (!open_.empty() && !is_over_) round(false);
    return std::move(witnesses_);
  }

 private:
  void round(bool are_told) {
    constexpr std::size_t kRound = 4;
    constexpr int kBarren = 3;
    const auto end = open_.begin() + static_cast<std::ptrdiff_t>(std::min(kRound, open_.size()));
    const std::vector<VisualQuestion> asked(open_.begin(), end);
    open_.erase(open_.begin(), end);
    const bool found = take(judge_.ask(a_, b_, asked)) || (are_told && take(judge_.ask(a_, b_, asked, false)));
    barren_ = found ? 0 : barren_ + 1;
    is_over_ = leave_out() && barren_ >= kBarren;
  }

  bool take(std::vector<VisualWitness> answers) {
    bool any = false;
    for (VisualWitness& w : answers) {
      any = any || holds(w, {}, options_);
      witnesses_.push_back(std::move(w));
    }
    return any;
  }

  // What need not be asked; false where all must.
  bool leave_out() {
    constexpr std::size_t kMostRivals = 12;
    const Commitment now = commitment(witnesses_, b_, {}, options_);
    if (!now.others.empty() || disjoint(now.clique) < static_cast<std::size_t>(options_.visual.enough_witnesses)) return false;
    const Sim3 a_from_b = mean_transform(now.clique, b_);
    std::size_t rivals = 0;
    for (const VisualWitness& w : witnesses_) rivals += !would_see_the_same(a_, b_, {w.keyframe_a, w.keyframe_b}, a_from_b);
    const auto is_idle = [&](const VisualQuestion& question) {
      if (!would_see_the_same(a_, b_, question, a_from_b)) return ++rivals > kMostRivals;
      return std::any_of(now.clique.begin(), now.clique.end(), [&](const VisualWitness* w) {
        return beside(a_, w->keyframe_a, question.keyframe_a) && beside(b_, w->keyframe_b, question.keyframe_b);
      });
    };
    std::vector<VisualQuestion> left;
    for (const VisualQuestion& question : open_)
      if (!is_idle(question)) left.push_back(question);
    open_ = std::move(left);
    return true;
  }

  const VisualMap &a_, &b_;
  const FusionOptions& options_;
  VisualJudge& judge_;
  std::vector<VisualQuestion> open_;
  std::deque<VisualWitness> witnesses_;
  int barren_ = 0;  // rounds
  bool is_over_ = false;
};

}  // namespace

namespace {

// Elsewhere in the same map, what looks most like this keyframe.
std::vector<VisualQuestion> elsewhere(const VisualMap& map, std::size_t keyframe, const VisualFusionOptions& options) {
  constexpr double kApart_m = 2.0;
  constexpr std::size_t kAsked = 2;
  const MappedKeyframe& here = map.keyframes()[keyframe];
  const int least = std::max(1, static_cast<int>(options.least_alike * here.likeness));
  const auto is_here = [&](const NodeId& id) {
    const std::size_t other = map.number_of(id);
    return beside(map, keyframe, other) || (map.keyframes()[other].map_from_camera.t - here.map_from_camera.t).norm() < kApart_m;
  };
  std::vector<VisualQuestion> questions;
  for (const matching::SimilarPlace& place : map.alike(here.bag, least, kAsked, is_here))
    questions.push_back({keyframe, map.number_of(place.id)});
  return questions;
}

// Rooms may be alike to the last picture on the wall, and then agreement says nothing. So a few witnesses, of different keyframes and the
// most probable first, are asked whether their places look like others in their own maps. Where too many do, these are the judgements that
// say so.
std::vector<Hash> repetitions(const VisualMap& a, const VisualMap& b, std::vector<const VisualWitness*> clique,
                              const FusionOptions& options, VisualJudge& judge, std::vector<Hash>& judged) {
  constexpr std::size_t kMostLooks = 12, kOneIn = 6;
  constexpr double kMoved_m = 1.0;
  std::stable_sort(clique.begin(), clique.end(), [](const VisualWitness* one, const VisualWitness* other) {
    return one->judgement.probability > other->judgement.probability;
  });
  std::vector<Hash> found;
  const auto repeats = [&](const VisualMap& map, std::size_t keyframe) {
    for (const VisualWitness& w : judge.ask(map, map, elsewhere(map, keyframe, options.visual))) {
      judged.push_back(w.judgement.id);
      const Vector3d& there = map.keyframes()[w.keyframe_b].map_from_node.t;
      if (!holds(w, {}, options) || (matching::transformed(there, w.a_from_b) - there).norm() < kMoved_m) continue;
      found.push_back(w.judgement.id);
      return true;
    }
    return false;
  };
  std::set<std::size_t> of_a, of_b;
  std::size_t repeated = 0;
  for (const VisualWitness* w : clique) {
    if (of_a.size() == kMostLooks || kOneIn * repeated >= kMostLooks) break;
    if (of_a.count(w->keyframe_a) != 0 || of_b.count(w->keyframe_b) != 0) continue;
    of_a.insert(w->keyframe_a), of_b.insert(w->keyframe_b);
    repeated += repeats(a, w->keyframe_a) || repeats(b, w->keyframe_b);
  }
  if (kOneIn * repeated < of_a.size()) found.clear();
  return found;
}

}  // namespace

VisualPairResult decide(const VisualMap& a, const VisualMap& b, const std::vector<VisualQuestion>& told, const FusionInput& input,
                        const FusionOptions& options, VisualJudge& judge) {
  VisualPairResult result;
  Verdict& verdict = result.verdict;
  verdict.a = a.map().id, verdict.b = b.map().id, verdict.by = input.by;
  verdict.kind = "vision", verdict.proposer = "words";
  verdict.decision = Decision::refused, verdict.reason = Reason::little_overlap;

  const auto witnesses = Rounds(a, b, options, judge).run(told);
  const VisualWitness* likeliest = nullptr;
  std::size_t vetoed = 0;
  for (const VisualWitness& w : witnesses) {
    result.judged.push_back(w.judgement.id);
    vetoed += input.vetoed.count(w.judgement.id);
    if (!w.judgement.hypotheses.empty() && (likeliest == nullptr || w.judgement.probability > likeliest->judgement.probability))
      likeliest = &w;
  }
  const auto [clique, others, weight, rival_weight] = commitment(witnesses, b, input.vetoed, options);
  if (clique.empty()) {
    if (likeliest != nullptr) {
      const Judgement& judgement = likeliest->judgement;
      verdict.probability = judgement.probability, verdict.overlap = judgement.evidence.inliers;
      verdict.conflict = judgement.evidence.conflict, verdict.second_best = judgement.evidence.second_best_ratio;
      verdict.reason = judgement.doubt == Reason::none ? Reason::too_few_witnesses : judgement.doubt;
      if (verdict.reason == Reason::ambiguous || verdict.reason == Reason::unobservable) verdict.decision = Decision::deferred;
    }
    if (vetoed > 0) verdict.reason = Reason::vetoed;
    return result;
  }

  for (const VisualWitness* w : others) verdict.contradicted.push_back(w->judgement.id);
  std::sort(verdict.contradicted.begin(), verdict.contradicted.end());
  verdict.second_best = rival_weight / weight;

  double none_right = 1.0;
  for (const VisualWitness* w : clique) {
    const auto share = 1.0 / static_cast<double>(clique.size());
    none_right *= 1.0 - std::clamp(w->judgement.probability, 0.0, 0.98);
    verdict.overlap += share * w->judgement.evidence.inliers, verdict.conflict += share * w->judgement.evidence.conflict;
    verdict.witnesses.push_back(w->judgement.id);
  }
  std::sort(verdict.witnesses.begin(), verdict.witnesses.end());
  verdict.probability = (1.0 - none_right) * (1.0 - std::min(1.0, verdict.second_best));
  Alignment alignment;
  alignment.a_from_b = mean_transform(clique, b);
  const VisualWitness& nearest = *clique.front();
  const Pose3 node_from_map = inverse(b.keyframes()[nearest.keyframe_b].map_from_node);
  alignment.covariance = exchanged(nearest.information.inverse(), {inverse(node_from_map), 1.0});
  verdict.alignment = alignment;

  const bool sole = clique.size() == 1 && clique.front()->judgement.probability >= options.sole_witness_probability;
  if (verdict.second_best > options.max_rival) {
    verdict.decision = Decision::deferred, verdict.reason = Reason::ambiguous;
  } else if (disjoint(clique) < static_cast<std::size_t>(options.min_witnesses) && !sole) {
    verdict.decision = Decision::deferred, verdict.reason = Reason::too_few_witnesses;
  } else if (const std::vector<Hash> against = repetitions(a, b, clique, options, judge, result.judged); !against.empty()) {
    verdict.decision = Decision::deferred, verdict.reason = Reason::ambiguous;
    verdict.contradicted.insert(verdict.contradicted.end(), against.begin(), against.end());
    std::sort(verdict.contradicted.begin(), verdict.contradicted.end());
  } else {
    verdict.decision = Decision::accepted, verdict.reason = Reason::none;
    for (const VisualWitness* w : clique) result.witnesses.push_back(*w);
  }
  return result;
}

}  // namespace mapweave::fusion
