#include "decision/commitment.h"
#include "decision/verdict.h"
#include "repetition.h"

#include <mapweave/core/interrupt.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <deque>
#include <set>

namespace mapweave::fusion {
namespace {

using Eigen::Vector3d;

constexpr double kSameScale = 0.1;      // of the logarithms of two scales
constexpr double kYaw_per_m = 0.002;    // growth of consistency_yaw_rad, as consistency_per_m is that of consistency_m
constexpr double kMostProbable = 0.98;  // of one witness: none is certain by itself

bool agree(const VisualWitness& one, const VisualWitness& other, const VisualMap& b, const FusionOptions& options) {
  const Vector3d &p = b.keyframes()[one.keyframe_b].map_from_node.t,
                 &q = b.keyframes()[other.keyframe_b].map_from_node.t;
  const Vector3d middle = 0.5 * (p + q);
  const double scale = std::sqrt(one.a_from_b.scale * other.a_from_b.scale), far = scale * (p - q).norm();
  const double apart = (transformed(middle, one.a_from_b) - transformed(middle, other.a_from_b)).norm();
  return apart < options.consistency_m + options.consistency_per_m * far &&
         one.a_from_b.pose.q.angularDistance(other.a_from_b.pose.q) < options.consistency_yaw_rad + kYaw_per_m * far &&
         std::abs(std::log(one.a_from_b.scale / other.a_from_b.scale)) < kSameScale;
}

// Witnesses of which no two share a keyframe.
std::size_t disjoint(const std::vector<const VisualWitness*>& witnesses) {
  std::set<std::size_t> of_a, of_b;
  std::size_t count = 0;
  for (const VisualWitness* w : witnesses) {
    if (of_a.count(w->keyframe_a) != 0 || of_b.count(w->keyframe_b) != 0) continue;
    of_a.insert(w->keyframe_a);
    of_b.insert(w->keyframe_b);
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
    in_b += share * p;
    in_a += share * transformed(p, w->a_from_b);
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

// What is most like each of the keyframes of b in a.
std::vector<VisualQuestion> questions_of(const VisualMap& a, const VisualMap& b, const VisualFusionOptions& options) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> ranked;  // likeness, with a minus; keyframes of a and b
  for (std::size_t j = 0; j < b.keyframes().size(); ++j) {
    const MappedKeyframe& keyframe = b.keyframes()[j];
    const int least = std::max(1, static_cast<int>(options.least_alike * keyframe.likeness));
    for (const matching::SimilarPlace& place :
         a.alike(keyframe.words->bag, least, static_cast<std::size_t>(options.candidates)))
      ranked.emplace_back(-static_cast<double>(place.score) / std::max(1, keyframe.likeness), a.number_of(place.id),
                          j);  // groups' sums: above 1
  }
  std::sort(ranked.begin(), ranked.end());
  if (ranked.size() > static_cast<std::size_t>(options.most_pairs))
    ranked.resize(static_cast<std::size_t>(options.most_pairs));
  std::vector<VisualQuestion> questions;
  for (const auto& [score, i, j] : ranked) questions.push_back({i, j});
  return questions;
}

}  // namespace

bool contradict(const VisualMap& a, const VisualMap& b, const Sim3& a_from_b, VisualJudge& judge,
                std::vector<Hash>& judged) {
  constexpr double kNear_m = 1.0, kAlike_rad = 0.35;  // views that show the same, if the alignment is right
  // Bound time; fewer looks, or empty walls, contradict nothing.
  constexpr std::size_t kMostLooks = 12, kLeastLooks = 4, kLeastFeatures = 150;
  std::vector<std::tuple<double, std::size_t, std::size_t>> near;
  for (std::size_t j = 0; j < b.keyframes().size(); ++j) {
    if (b.keyframes()[j].points.size() < kLeastFeatures) continue;
    const Pose3 there = transformed(b.keyframes()[j].map_from_camera, a_from_b);
    std::pair<double, std::size_t> nearest{1e300, 0};
    for (std::size_t i = 0; i < a.keyframes().size(); ++i) {
      const Pose3& here = a.keyframes()[i].map_from_camera;
      if (a.keyframes()[i].points.size() < kLeastFeatures || (here.t - there.t).norm() > kNear_m) continue;
      const double turn =
          std::acos(std::clamp((here.q * Vector3d::UnitZ()).dot(there.q * Vector3d::UnitZ()), -1.0, 1.0));
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
    known += (transformed(p, w.a_from_b) - transformed(p, a_from_b)).norm() < kNear_m;
  }
  constexpr std::size_t kOneIn = 5;  // of the near pairs: fewer that match contradict the alignment
  return kOneIn * known < near.size();
}

namespace {

// What the judgements so far make of two maps.
struct VisualCommitment {
  std::vector<const VisualWitness*> clique,
      others;  // the heaviest set that holds together; those that hold, and agree with none of it
  std::vector<std::vector<const VisualWitness*>> sets;  // that hold together, the heaviest (the clique) first
  double weight = 0.0, rival_weight = 0.0;              // of the clique, and of the heaviest set of the others
};

VisualCommitment commit_to(const std::deque<VisualWitness>& witnesses, const VisualMap& b, const std::set<Hash>& vetoed,
                           const FusionOptions& options) {
  std::vector<const VisualWitness*> good;
  for (const VisualWitness& w : witnesses)
    if (holds(w, vetoed, options)) good.push_back(&w);
  std::vector<char> agreement(good.size() * good.size());
  std::vector<double> weights;
  for (std::size_t i = 0; i < good.size(); ++i) {
    weights.push_back(log_odds(good[i]->judgement.probability));
    for (std::size_t j = 0; j < good.size(); ++j)
      agreement[i * good.size() + j] = i != j && agree(*good[i], *good[j], b, options);
  }
  const std::vector<Commitment> sets = commit(agreement, weights);
  VisualCommitment result;
  if (sets.empty()) return result;
  for (const std::size_t i : sets[0].agreeing) result.clique.push_back(good[i]);
  for (const std::size_t i : sets[0].contradicting) result.others.push_back(good[i]);
  for (const Commitment& set : sets) {
    auto& members = result.sets.emplace_back();
    for (const std::size_t i : set.agreeing) members.push_back(good[i]);
  }
  result.weight = sets[0].weight;
  if (sets.size() > 1) result.rival_weight = sets[1].weight;
  return result;
}

// Whether they would look at the same things from near, if b lay so.
bool would_see_the_same(const VisualMap& a, const VisualMap& b, const VisualQuestion& question, const Sim3& a_from_b) {
  constexpr double kNear_m = 3.0, kAlike_rad = 0.9;  // generous: most of a view is shared within it
  const Pose3 &here = a.keyframes()[question.keyframe_a].map_from_camera,
              there = transformed(b.keyframes()[question.keyframe_b].map_from_camera, a_from_b);
  const bool is_near = !a.is_metric() || (here.t - there.t).norm() < kNear_m;
  return is_near &&
         std::acos(std::clamp((here.q * Vector3d::UnitZ()).dot(there.q * Vector3d::UnitZ()), -1.0, 1.0)) < kAlike_rad;
}

// Judged in rounds, those claimed first, then those most alike, so that maps that clearly lie on each other cost
// little. Once enough witnesses agree and nothing speaks against them, pairs beside one of theirs are left out (they
// see the same again), and of those that could only be rivals all but the first. Rounds that bring nothing new are then
// the last. Where anything contradicts, all are judged. Vetoes change nothing here: what they take away, no other
// judgement takes the place of.
class Rounds {
 public:
  Rounds(const VisualMap& a, const VisualMap& b, const FusionOptions& options, VisualJudge& judge)
      : a_(a), b_(b), options_(options), judge_(judge) {}

  std::deque<VisualWitness> run(const VisualQuestions& questions) {
    if (questions.is_incremental) return incremental(questions.first);
    open_ = questions.first;
    while (!open_.empty() && !is_over_) round(true);
    open_new(questions_of(a_, b_, options_.visual));
    is_over_ = false;
    barren_ = 0;
    leave_out();
    while (!open_.empty() && !is_over_) round(false);
    return std::move(witnesses_);
  }

 private:
  // What stands, and what is new.
  std::deque<VisualWitness> incremental(const std::vector<VisualQuestion>& questions) {
    take(judge_.ask(a_, b_, judge_.known_places(a_, b_)));
    open_new(questions);
    take(judge_.ask(a_, b_, open_));
    return std::move(witnesses_);
  }

  void open_new(const std::vector<VisualQuestion>& questions) {
    const auto is_same = [](const VisualQuestion& one, std::size_t a, std::size_t b) {
      return one.keyframe_a == a && one.keyframe_b == b;
    };
    for (const VisualQuestion& question : questions)
      if (std::none_of(witnesses_.begin(), witnesses_.end(),
                       [&](const VisualWitness& w) { return is_same(question, w.keyframe_a, w.keyframe_b); }) &&
          std::none_of(open_.begin(), open_.end(), [&](const VisualQuestion& other) {
            return is_same(question, other.keyframe_a, other.keyframe_b);
          }))
        open_.push_back(question);
  }

  void round(bool are_claimed) {
    constexpr std::size_t kRound = 4;  // small, so that little is asked once maps agree
    constexpr int kBarren = 3;         // rounds without a new witness
    const auto end = open_.begin() + static_cast<std::ptrdiff_t>(std::min(kRound, open_.size()));
    const std::vector<VisualQuestion> asked(open_.begin(), end);
    open_.erase(open_.begin(), end);
    const bool found = take(judge_.ask(a_, b_, asked)) || (are_claimed && take(judge_.ask(a_, b_, asked, false)));
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
    constexpr std::size_t kMostRivals = 12;  // pairs that could only be rivals, before the others are left out
    const VisualCommitment now = commit_to(witnesses_, b_, {}, options_);
    if (!now.others.empty() || disjoint(now.clique) < static_cast<std::size_t>(options_.visual.enough_witnesses))
      return false;
    const Sim3 a_from_b = mean_transform(now.clique, b_);
    std::size_t rivals = 0;
    for (const VisualWitness& w : witnesses_)
      rivals += !would_see_the_same(a_, b_, {w.keyframe_a, w.keyframe_b}, a_from_b);
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

// Witnesses that put the second map far from where the others have it.
std::vector<const VisualWitness*> far_from(const Sim3& a_from_b, const std::vector<const VisualWitness*>& witnesses,
                                           const VisualMap& b) {
  constexpr double kFar_m = 2.0;  // as in repetition: nearer, it is the same place
  std::vector<const VisualWitness*> far;
  for (const VisualWitness* w : witnesses) {
    const Vector3d& there = b.keyframes()[w->keyframe_b].map_from_node.t;
    if ((transformed(there, w->a_from_b) - transformed(there, a_from_b)).norm() > kFar_m) far.push_back(w);
  }
  return far;
}

double probability_of_one(const std::vector<const VisualWitness*>& witnesses) {
  double none_right = 1.0;
  for (const VisualWitness* w : witnesses) none_right *= 1.0 - std::clamp(w->judgement.probability, 0.0, kMostProbable);
  return 1.0 - none_right;
}

PairHypothesis hypothesis_of(const std::vector<const VisualWitness*>& witnesses, const VisualMap& b) {
  PairHypothesis hypothesis;
  hypothesis.sense = Sense::cameras;
  hypothesis.a_from_b = mean_transform(witnesses, b);
  hypothesis.matches = static_cast<std::uint32_t>(witnesses.size());
  const double p = std::clamp(probability_of_one(witnesses), 1e-9, 1.0 - 1e-9);
  hypothesis.log_odds = std::log(p / (1.0 - p));
  for (const VisualWitness* w : witnesses)
    hypothesis.overlap += w->judgement.evidence.inliers / static_cast<double>(witnesses.size());
  return hypothesis;
}

std::vector<PairHypothesis> hypotheses_of(const VisualCommitment& commitment, const VisualMap& b) {
  std::vector<PairHypothesis> hypotheses;
  for (const auto& set : commitment.sets) {
    if (hypotheses.size() == kMostPairHypotheses) break;
    hypotheses.push_back(hypothesis_of(set, b));
  }
  // Beside each set stand all that hold and are not in it.
  const std::size_t all = commitment.clique.size() + commitment.others.size();
  for (PairHypothesis& hypothesis : hypotheses)
    hypothesis.elsewhere = static_cast<std::uint32_t>(all - hypothesis.matches);
  return hypotheses;
}

// What the clique says of the two maps, and how sure it is.
void describe(Verdict& verdict, const VisualCommitment& commitment, const VisualMap& b) {
  const auto& clique = commitment.clique;
  for (const VisualWitness* w : commitment.others) verdict.contradicted.push_back(w->judgement.id);
  std::sort(verdict.contradicted.begin(), verdict.contradicted.end());
  verdict.second_best = commitment.rival_weight / commitment.weight;
  for (const VisualWitness* w : clique) {
    const auto share = 1.0 / static_cast<double>(clique.size());
    verdict.overlap += share * w->judgement.evidence.inliers;
    verdict.conflict += share * w->judgement.evidence.conflict;
    verdict.witnesses.push_back(w->judgement.id);
  }
  std::sort(verdict.witnesses.begin(), verdict.witnesses.end());
  verdict.probability = probability_of_one(clique) * (1.0 - std::min(1.0, verdict.second_best));
  Alignment alignment;
  alignment.a_from_b = mean_transform(clique, b);
  const VisualWitness& nearest = *clique.front();
  const Pose3 node_from_map = inverse(b.keyframes()[nearest.keyframe_b].map_from_node);
  alignment.covariance = exchanged(nearest.information.inverse(), {inverse(node_from_map), 1.0});
  verdict.alignment = alignment;
}

VisualSupport support_of(const VisualCommitment& commitment, const Verdict& verdict, const VisualMap& b) {
  VisualSupport support;
  support.witnesses = disjoint(commitment.clique);
  support.far_rivals = disjoint(far_from(verdict.alignment->a_from_b, commitment.others, b));
  support.rival = verdict.second_best;
  if (commitment.clique.size() == 1) support.sole_probability = commitment.clique.front()->judgement.probability;
  return support;
}

}  // namespace

VisualPairResult decide(const VisualMap& a, const VisualMap& b, const VisualQuestions& questions,
                        const FusionInput& input, const FusionOptions& options, VisualJudge& judge) {
  VisualPairResult result;
  Verdict& verdict = result.verdict = unseen(a.map().id, b.map().id, input.by, "vision");
  verdict.proposer = "words";
  const auto witnesses = Rounds(a, b, options, judge).run(questions);
  const VisualWitness* likeliest = nullptr;
  std::size_t vetoed = 0;
  for (const VisualWitness& w : witnesses) {
    result.judged.push_back(w.judgement.id);
    vetoed += input.vetoed.count(w.judgement.id);
    if (!w.judgement.hypotheses.empty() &&
        (likeliest == nullptr || w.judgement.probability > likeliest->judgement.probability))
      likeliest = &w;
  }
  const VisualCommitment commitment = commit_to(witnesses, b, input.vetoed, options);
  if (commitment.clique.empty()) {
    if (likeliest != nullptr) {
      doubt_as(verdict, likeliest->judgement, likeliest->judgement.evidence.inliers);
      verdict.hypotheses = {hypothesis_of({likeliest}, b)};
    }
    if (vetoed > 0) veto(verdict);
    return result;
  }
  describe(verdict, commitment, b);
  verdict.hypotheses = hypotheses_of(commitment, b);
  decide_by_cameras(verdict, support_of(commitment, verdict, b), options);
  if (verdict.reason == Reason::ambiguous)
    result.repetition = repetition_between(a, b, commitment.clique, commitment.others);
  if (verdict.decision != Decision::accepted) return result;
  if (questions.is_doubted)
    result.repetition = repetition_within(a, b, commitment.clique, options, judge, result.judged);
  if (!result.repetition.because.empty()) {
    doubt_as_repeated(verdict, result.repetition.because);
    return result;
  }
  for (const VisualWitness* w : commitment.clique) result.witnesses.push_back(*w);
  return result;
}

}  // namespace mapweave::fusion
