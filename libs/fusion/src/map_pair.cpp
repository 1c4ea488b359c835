#include "map_pair.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/graph/consistent_set.h>
#include <mapweave/maps/alignment.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

constexpr double kWideRadius_m = 12.0;
constexpr double kNeighbourhood_m = 8.0;
constexpr std::size_t kMostChecks = 40;
constexpr std::size_t kFewestPlaces = 10;

matching::Point2f placed(const Pose2& pose, const matching::Point2f& p) {
  const double c = std::cos(pose.phi), s = std::sin(pose.phi);
  return {static_cast<float>(pose.x + c * p.x - s * p.y), static_cast<float>(pose.y + s * p.x + c * p.y)};
}

double distance(const matching::Point2f& a, const matching::Point2f& b) { return std::hypot(a.x - b.x, a.y - b.y); }

// Two witnesses agree when the transforms they imply put b's places where they are on (nearly) the same spot. Maps bend, so places far
// apart may disagree more.
bool agree(const Witness& one, const Witness& other, const PreparedMap& b, const FusionOptions& options) {
  const auto& p = b.centres[one.submap_b];
  const auto& q = b.centres[other.submap_b];
  const matching::Point2f middle{0.5F * (p.x + q.x), 0.5F * (p.y + q.y)};
  const double apart = distance(placed(one.a_from_b, middle), placed(other.a_from_b, middle));
  const double far = distance(p, q);
  return apart < options.consistency_m + options.consistency_per_m * far &&
         std::abs(wrap_angle(one.a_from_b.phi - other.a_from_b.phi)) < options.consistency_yaw_rad + 0.002 * far;
}

double log_odds(double p) { return std::log(std::clamp(p, 0.5001, 0.9999) / (1.0 - std::clamp(p, 0.5001, 0.9999))); }

// Witnesses of which no two share a submap, or have neighbouring ones: those tell the same story twice.
std::size_t disjoint(const std::vector<const Witness*>& witnesses) {
  std::vector<const Witness*> chosen;
  for (const Witness* w : witnesses) {
    const bool free = std::none_of(chosen.begin(), chosen.end(), [&](const Witness* c) {
      const auto near = [](std::size_t l, std::size_t r) { return (l > r ? l - r : r - l) < 2; };
      return near(c->submap_a, w->submap_a) || near(c->submap_b, w->submap_b);
    });
    if (free) chosen.push_back(w);
  }
  return chosen.size();
}

// Mean of the transforms, at the middle of the places in b.
Pose2 mean_transform(const std::vector<const Witness*>& witnesses, const PreparedMap& b) {
  double sine = 0, cosine = 0, bx = 0, by = 0, ax = 0, ay = 0;
  for (const Witness* w : witnesses) {
    const auto& p = b.centres[w->submap_b];
    const auto q = placed(w->a_from_b, p);
    sine += std::sin(w->a_from_b.phi), cosine += std::cos(w->a_from_b.phi);
    bx += p.x, by += p.y, ax += q.x, ay += q.y;
  }
  const auto n = static_cast<double>(witnesses.size());
  const double phi = std::atan2(sine, cosine), c = std::cos(phi), s = std::sin(phi);
  bx /= n, by /= n, ax /= n, ay /= n;
  return {ax - (c * bx - s * by), ay - (s * bx + c * by), phi};
}

// Of map b's frame in its own axes. Witnesses that tell the same story count once; maps bend by some centimetres however many agree.
Eigen::Matrix3d covariance_of(const std::vector<const Witness*>& witnesses, const PreparedMap& b, std::size_t independent) {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (const Witness* w : witnesses) {
    const Eigen::Matrix3d carry = adjoint(inverse(b.map_from_submap[w->submap_b]));
    information += carry.transpose() * w->submap_information * carry;
  }
  information *= static_cast<double>(std::max<std::size_t>(1, independent)) / static_cast<double>(witnesses.size());
  return information.inverse() + Eigen::Vector3d(4e-4, 4e-4, 3e-6).asDiagonal().toDenseMatrix();
}

std::vector<Question> first_questions(const PreparedMap& a, const PreparedMap& b, const FusionOptions& options) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> ranked;
  const auto best_of = [&](const PreparedMap& from, const PreparedMap& to, bool swapped) {
    for (const auto i : from.representatives) {
      std::vector<std::pair<double, std::size_t>> alike;
      for (const auto j : to.representatives) alike.emplace_back(matching::ring_distance(from.keys[i], to.keys[j]), j);
      std::sort(alike.begin(), alike.end());
      if (alike.size() > static_cast<std::size_t>(options.candidates_per_submap))
        alike.resize(static_cast<std::size_t>(options.candidates_per_submap));
      for (const auto& [value, j] : alike) ranked.emplace_back(value, swapped ? j : i, swapped ? i : j);
    }
  };
  best_of(a, b, false);
  best_of(b, a, true);
  std::sort(ranked.begin(), ranked.end());
  ranked.erase(std::unique(ranked.begin(), ranked.end()), ranked.end());
  if (ranked.size() > static_cast<std::size_t>(options.most_pairs)) ranked.resize(static_cast<std::size_t>(options.most_pairs));
  std::vector<Question> questions;
  for (const auto& entry : ranked) {
    const std::size_t i = std::get<1>(entry), j = std::get<2>(entry);
    const auto centre_a = placed(inverse(a.map_from_submap[i]), a.centres[i]),
               centre_b = placed(inverse(b.map_from_submap[j]), b.centres[j]);
    matching::WideWindow window;
    window.a_from_b = {static_cast<double>(centre_a.x) - centre_b.x, static_cast<double>(centre_a.y) - centre_b.y, 0.0};
    window.radius_m = std::min(kWideRadius_m, std::max(4.0, 0.7 * static_cast<double>(a.radii_m[i] + b.radii_m[j])));
    window.yaw_rad = M_PI;
    questions.push_back({i, j, window});
  }
  return questions;
}

bool holds(const Witness& w, const FusionInput& input, const FusionOptions& options) {
  return !w.judgement.hypotheses.empty() && w.judgement.doubt == Reason::none && w.judgement.probability >= options.min_probability &&
         input.vetoed.count(w.judgement.id) == 0;
}

}  // namespace

PreparedMap prepare(const Map& map, matching::ModelCache& cache, double stride_m, WorkerPool& pool) {
  PreparedMap prepared;
  prepared.map = &map;
  for (const auto& [id, submap] : map.submaps)
    if (submap.frozen && !std::holds_alternative<KeyframeFeatures>(*map.nodes.find(submap.anchor())->payload))
      prepared.submaps.push_back(&submap);  // what is judged here is walls
  struct Facts {
    matching::Point2f centre;
    std::vector<matching::RingKey> keys;
    float radius_m;
  };
  const auto facts = pool.map(prepared.submaps.size(), [&](std::size_t i) {
    const auto model = cache.get(*prepared.submaps[i], map.nodes);
    return Facts{model->centre(), model->ring_keys(), model->radius_m()};
  });
  for (std::size_t i = 0; i < facts.size(); ++i) {
    const Node& anchor = *map.nodes.find(prepared.submaps[i]->anchor());
    prepared.is_grid = prepared.is_grid || (anchor.payload && std::holds_alternative<OccupancyGrid>(*anchor.payload));
    prepared.map_from_submap.push_back(planar(anchor.map_from_node));
    prepared.centres.push_back(placed(prepared.map_from_submap.back(), facts[i].centre));
    prepared.keys.push_back(facts[i].keys);
    prepared.radii_m.push_back(facts[i].radius_m);
  }
  // A small map has few places to be recognised by: all the closer together they are looked at.
  for (double stride = stride_m;; stride *= 0.5) {
    prepared.representatives.clear();
    for (std::size_t i = 0; i < facts.size(); ++i)
      if (std::none_of(prepared.representatives.begin(), prepared.representatives.end(),
                       [&](std::size_t r) { return distance(prepared.centres[r], prepared.centres[i]) < stride; }))
        prepared.representatives.push_back(i);
    if (prepared.representatives.size() >= std::min(kFewestPlaces, facts.size()) || stride < 0.1) break;
  }
  return prepared;
}

std::vector<Witness> Judge::ask(const PreparedMap& a, const PreparedMap& b, const std::vector<Question>& questions) {
  const auto answers = pool_.map(questions.size(), [&](std::size_t i) {
    throw_if_interrupted();
    const Question& question = questions[i];
    const Submap &sa = *a.submaps[question.submap_a], &sb = *b.submaps[question.submap_b];
    const bool swapped = sb.id < sa.id;
    matching::WideWindow window = question.a_from_b;
    // The judge's middle is of the second submap in the first: the same window, seen from the other side.
    if (swapped) window.a_from_b = inverse(window.a_from_b);
    const Submap &first = swapped ? sb : sa, &second = swapped ? sa : sb;
    const Hash id = matching::judgement_id(first.content, second.content, window, options_.judge);
    const auto known = memo_.find(id);
    if (known != memo_.end()) return known->second;
    const auto& nodes_first = swapped ? b.map->nodes : a.map->nodes;
    const auto& nodes_second = swapped ? a.map->nodes : b.map->nodes;
    return matching::judge({first.id, first.content, cache_.get(first, nodes_first)},
                           {second.id, second.content, cache_.get(second, nodes_second)}, window, options_.judge);
  });
  std::vector<Witness> witnesses;
  for (std::size_t i = 0; i < answers.size(); ++i) {
    memo_.emplace(answers[i].id, answers[i]);
    Witness witness;
    witness.judgement = answers[i];
    witness.submap_a = questions[i].submap_a, witness.submap_b = questions[i].submap_b;
    if (!answers[i].hypotheses.empty()) {
      const bool swapped = b.submaps[witness.submap_b]->id < a.submaps[witness.submap_a]->id;
      const Pose2 aligned = planar(answers[i].hypotheses.front().a_from_b.pose);
      witness.submap_a_from_submap_b = swapped ? inverse(aligned) : aligned;
      witness.submap_information = planar(answers[i].hypotheses.front().covariance).inverse();
      if (swapped) {
        // A small motion of one end is a motion of the other, seen through the transform between them.
        const Eigen::Matrix3d carry = adjoint(inverse(aligned));
        witness.submap_information = (carry.transpose() * witness.submap_information * carry).eval();
      }
      witness.a_from_b = compose(compose(a.map_from_submap[witness.submap_a], witness.submap_a_from_submap_b),
                                 inverse(b.map_from_submap[witness.submap_b]));
    }
    witnesses.push_back(std::move(witness));
  }
  return witnesses;
}

PairResult decide(const PreparedMap& a, const PreparedMap& b, const FusionInput& input, const FusionOptions& options, Judge& judge) {
  PairResult result;
  Verdict& verdict = result.verdict;
  verdict.a = a.map->id, verdict.b = b.map->id, verdict.by = input.by;
  verdict.kind = a.is_grid || b.is_grid ? "grid" : "laser";
  verdict.proposer = "ring keys";
  verdict.decision = Decision::refused;
  verdict.reason = Reason::little_overlap;

  const auto wide = judge.ask(a, b, first_questions(a, b, options));
  std::vector<const Witness*> good;
  std::size_t vetoed = 0;
  for (const auto& w : wide) {
    result.judged.push_back(w.judgement.id);
    vetoed += input.vetoed.count(w.judgement.id);
    if (holds(w, input, options)) good.push_back(&w);
  }
  if (good.empty()) {
    // Nothing at all, or only answers that were themselves in doubt: say which doubt was the least bad.
    const Witness* likeliest = nullptr;
    for (const auto& w : wide)
      if (!w.judgement.hypotheses.empty() && (likeliest == nullptr || w.judgement.probability > likeliest->judgement.probability))
        likeliest = &w;
    if (likeliest != nullptr) {
      verdict.probability = likeliest->judgement.probability;
      verdict.overlap = likeliest->judgement.evidence.overlap;
      verdict.conflict = likeliest->judgement.evidence.conflict;
      verdict.second_best = likeliest->judgement.evidence.second_best_ratio;
      verdict.reason = likeliest->judgement.doubt == Reason::none ? Reason::too_few_witnesses : likeliest->judgement.doubt;
      if (verdict.reason == Reason::ambiguous || verdict.reason == Reason::unobservable) verdict.decision = Decision::deferred;
    }
    if (vetoed > 0) verdict.reason = Reason::vetoed;
    return result;
  }

  const auto clique_of = [&](const std::vector<const Witness*>& from, double& weight) {
    std::vector<bool> consistent(from.size() * from.size());
    std::vector<double> weights;
    for (std::size_t i = 0; i < from.size(); ++i) {
      weights.push_back(log_odds(from[i]->judgement.probability));
      for (std::size_t j = 0; j < from.size(); ++j) consistent[i * from.size() + j] = i != j && agree(*from[i], *from[j], b, options);
    }
    std::vector<const Witness*> members;
    weight = 0.0;
    for (const auto i : graph::consistent_set(consistent, weights)) members.push_back(from[i]), weight += weights[i];
    return members;
  };
  double weight = 0.0, rival_weight = 0.0;
  const auto clique = clique_of(good, weight);
  std::vector<const Witness*> others;
  for (const Witness* w : good)
    if (std::none_of(clique.begin(), clique.end(), [&](const Witness* c) { return c == w || agree(*c, *w, b, options); }))
      others.push_back(w);
  if (!others.empty()) clique_of(others, rival_weight);
  for (const Witness* w : others) verdict.contradicted.push_back(w->judgement.id);
  verdict.second_best = rival_weight / weight;

  // With the maps laid on each other, neighbouring submaps must agree too: those speak for the join, or against it.
  const Pose2 a_from_b = mean_transform(clique, b);
  std::vector<std::tuple<double, std::size_t, std::size_t>> near;
  for (const auto j : b.representatives) {
    std::pair<double, std::size_t> best{1e300, 0};
    for (const auto i : a.representatives) best = std::min(best, {distance(a.centres[i], placed(a_from_b, b.centres[j])), i});
    if (best.first < kNeighbourhood_m) near.emplace_back(best.first, best.second, j);
  }
  std::sort(near.begin(), near.end());
  if (near.size() > kMostChecks) near.resize(kMostChecks);
  std::vector<Question> checks;
  for (const auto& [apart, i, j] : near) {
    matching::WideWindow window;
    double from_witness = 1e300;
    for (const Witness* w : clique) from_witness = std::min(from_witness, distance(b.centres[w->submap_b], b.centres[j]));
    window.a_from_b = compose(inverse(a.map_from_submap[i]), compose(a_from_b, b.map_from_submap[j]));
    window.radius_m = 0.8 + options.consistency_per_m * std::min(from_witness, 60.0);
    window.yaw_rad = options.consistency_yaw_rad + 0.04;
    checks.push_back({i, j, window});
  }
  const auto checked = judge.ask(a, b, checks);
  double overlap_m2 = 0.0, conflict_m2 = 0.0, overlap_sum = 0.0;
  std::size_t support = 0, against = 0;
  std::vector<const Witness*> holding = clique;
  for (const auto& w : checked) {
    result.judged.push_back(w.judgement.id);
    const Evidence& e = w.judgement.evidence;
    if (w.judgement.hypotheses.empty() || e.overlap_m2 < options.judge.min_overlap_m2) continue;
    overlap_m2 += e.overlap_m2, conflict_m2 += e.conflict * e.overlap_m2, overlap_sum += e.overlap * e.overlap_m2;
    if (w.judgement.doubt == Reason::contradiction)
      ++against;
    else if (holds(w, input, options)) {
      ++support;
      holding.push_back(&w);
    }
  }
  for (const Witness* w : clique) {
    const Evidence& e = w->judgement.evidence;
    overlap_m2 += e.overlap_m2, conflict_m2 += e.conflict * e.overlap_m2, overlap_sum += e.overlap * e.overlap_m2;
  }
  verdict.overlap = overlap_m2 > 0 ? overlap_sum / overlap_m2 : 0.0;
  verdict.conflict = overlap_m2 > 0 ? conflict_m2 / overlap_m2 : 0.0;

  double none_right = 1.0;
  for (const Witness* w : holding) none_right *= 1.0 - std::clamp(w->judgement.probability, 0.0, 0.98);
  const double agreement = support + against == 0 ? 1.0 : static_cast<double>(support) / static_cast<double>(support + against);
  verdict.probability = (1.0 - none_right) * agreement * (1.0 - std::min(1.0, verdict.second_best));
  for (const Witness* w : holding) verdict.witnesses.push_back(w->judgement.id);
  std::sort(verdict.witnesses.begin(), verdict.witnesses.end());
  verdict.witnesses.erase(std::unique(verdict.witnesses.begin(), verdict.witnesses.end()), verdict.witnesses.end());
  Alignment alignment;
  alignment.a_from_b.pose = spatial(a_from_b);
  const std::size_t independent = disjoint(holding);
  alignment.covariance = spatial(covariance_of(clique, b, std::min(independent, clique.size())));
  verdict.alignment = alignment;

  const bool sole = clique.size() == 1 && clique.front()->judgement.probability >= options.sole_witness_probability;
  if (verdict.second_best > options.max_rival) {
    verdict.decision = Decision::deferred, verdict.reason = Reason::ambiguous;
  } else if (agreement < 0.6 || verdict.conflict > options.max_conflict) {
    verdict.decision = Decision::refused, verdict.reason = Reason::contradiction;
  } else if (independent < static_cast<std::size_t>(options.min_witnesses) && !sole) {
    verdict.decision = Decision::deferred, verdict.reason = Reason::too_few_witnesses;
  } else {
    verdict.decision = Decision::accepted, verdict.reason = Reason::none;
    for (const Witness* w : holding) result.witnesses.push_back(*w);
  }
  return result;
}

}  // namespace mapweave::fusion
