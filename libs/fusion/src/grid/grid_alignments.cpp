#include "grid_alignments.h"

#include "early_end.h"

#include <mapweave/core/disjoint_sets.h>
#include <mapweave/fusion/grid_map.h>
#include <mapweave/maps/alignment.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

constexpr double kSameScale = 0.005;  // of grids that bend by more than that anyway
// Of grids of one place: walls of the one in free space of the other, as a share of those that coincide; and some that
// people moved.
constexpr double kMostConflict = 0.35, kMoved_m = 4.0;

Hash pair_id(const Map& a, const Map& b, const GridPairOptions& options) {
  Hasher hasher;
  hasher.add("grid pair 1").add(content_hash(a)).add(content_hash(b));
  hasher.add(options.proposals.scale_range).add(options.proposals.scale_step);
  for (const int value : {options.proposals.rotations, options.proposals.most, options.mirrored})
    hasher.add(static_cast<std::int64_t>(value));
  return hasher.finish();
}

Judgement judgement_of(const Map& a, const Map& b, const GridPairResult& result, const Hash& id) {
  Judgement judgement;
  judgement.id = id;
  judgement.a = a.submaps.begin()->first;
  judgement.b = b.submaps.begin()->first;
  judgement.content_a = content_hash(a);
  judgement.content_b = content_hash(b);
  if (result.alignment) {
    judgement.hypotheses = {*result.alignment};
    judgement.scores = {result.probability};
  }
  judgement.evidence = result.evidence;
  judgement.probability = result.probability;
  judgement.doubt = result.reason;
  return judgement;
}

GridPairResult nothing_found() {
  GridPairResult result;
  result.reason = Reason::too_few_witnesses;
  return result;
}

Pose2 submap_from(const Submap& submap, const NodeId& node) {
  const auto& members = submap.submap_from_node;
  const auto member = std::find_if(members.begin(), members.end(), [&](const auto& one) { return one.first == node; });
  return planar(member->second);
}

// Several measurements of where one submap lies in another, as one.
struct MatchSum {
  Pose2 first;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();

  void add(const Pose2& from_from_to, const Eigen::Matrix3d& of_it) {
    if (information.isZero()) first = from_from_to;
    const Pose2 apart = between(first, from_from_to);
    information += of_it;
    gradient += of_it * Eigen::Vector3d(apart.x, apart.y, apart.phi);
  }
  Pose2 mean() const {
    const Eigen::Vector3d step = information.ldlt().solve(gradient);
    return compose(first, Pose2(step[0], step[1], step[2]));
  }
};

}  // namespace

GridAlignments::GridAlignments(std::vector<const Map*> maps, const FusionInput& input, const FusionOptions& options,
                               WorkerPool& pool, const std::set<std::pair<std::size_t, std::size_t>>& excluded)
    : maps_(std::move(maps)), options_(options), grids_(maps_.size()), scales_(maps_.size(), 1.0) {
  align_all(input, excluded, pool);
  estimate_scales();
}

const GridAlignments::Pair* GridAlignments::pair(std::size_t a, std::size_t b) const {
  const auto known = pairs_.find({a, b});
  return known == pairs_.end() ? nullptr : &known->second;
}

void GridAlignments::align_all(const FusionInput& input, const std::set<std::pair<std::size_t, std::size_t>>& excluded,
                               WorkerPool& pool) {
  std::vector<std::size_t> numbers;
  for (std::size_t m = 0; m < maps_.size(); ++m)
    if (fusion::is_grid(*maps_[m])) numbers.push_back(m);
  if (numbers.size() < 2) return;
  for (const std::size_t m : numbers) {  // one at a time: a grid of 16,000 x 16,000 cells has 0.5 GB
    is_over(input);
    grids_[m] = prepare_grid(grid_of_map(*maps_[m]));
  }
  std::vector<std::pair<std::size_t, std::size_t>> names;
  for (std::size_t i = 0; i < numbers.size(); ++i)
    for (std::size_t j = i + 1; j < numbers.size(); ++j)
      if (excluded.count({numbers[i], numbers[j]}) == 0) names.emplace_back(numbers[i], numbers[j]);
  const auto results = pool.map(names.size(), [&](std::size_t i) {
    if (is_over(input)) return nothing_found();
    return align_grids(*grids_[names[i].first], *grids_[names[i].second], options_.grids, options_.merge_probability);
  });
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Map &a = *maps_[names[i].first], &b = *maps_[names[i].second];
    Pair pair{results[i], judgement_of(a, b, results[i], pair_id(a, b, options_.grids)), false, false};
    pair.is_vetoed = input.vetoed.count(pair.judgement.id) != 0;
    pair.is_sure = pair.result.reason == Reason::none && !pair.is_vetoed;
    pairs_.emplace(names[i], std::move(pair));
  }
}

// Least squares of the logarithms, by how much wall speaks for each pair.
void GridAlignments::estimate_scales() {
  DisjointSets groups(maps_.size());
  const auto count = static_cast<Eigen::Index>(maps_.size());
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(count, count);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(count);
  for (const auto& [names, pair] : pairs_) {
    if (!pair.is_sure) continue;
    groups.join(names.first, names.second);
    const GridVerification& best = pair.result.hypotheses.front();
    const auto a = static_cast<Eigen::Index>(names.first), b = static_cast<Eigen::Index>(names.second);
    const double step = std::log(best.a_from_b.scale), weight = best.support_m;
    normal(a, a) += weight;
    normal(b, b) += weight;
    normal(a, b) -= weight;
    normal(b, a) -= weight;
    right[a] -= weight * step;
    right[b] += weight * step;
  }
  for (Eigen::Index m = 0; m < count; ++m)
    if (groups.find(static_cast<std::size_t>(m)) == static_cast<std::size_t>(m))
      normal(m, m) += 1e9;  // the lowest of its group stays as it is
  if (count == 0) return;
  const Eigen::VectorXd logarithms = normal.ldlt().solve(right);
  for (std::size_t m = 0; m < maps_.size(); ++m) {
    const double scale = std::exp(logarithms[static_cast<Eigen::Index>(m)]);
    if (std::abs(scale - 1.0) < kSameScale) continue;
    scales_[m] = scale;
    rescaled_.emplace(m, rescaled_grid(*maps_[m], scale));
  }
}

Pose2 GridAlignments::a_from_b(std::size_t a, std::size_t b) const {
  const GridPairResult& result = pairs_.at({a, b}).result;
  // The middle of the constraints lies where they put it, whatever the scale.
  Eigen::Vector2d in_a = Eigen::Vector2d::Zero(), in_b = Eigen::Vector2d::Zero();
  for (const GridConstraint& grid_constraint : result.grid_constraints) {
    const Eigen::Vector2d place_in_a(grid_constraint.a_from_place.x, grid_constraint.a_from_place.y);
    in_a += scales_[a] * place_in_a / static_cast<double>(result.grid_constraints.size());
    in_b += scales_[b] * grid_constraint.place_in_b / static_cast<double>(result.grid_constraints.size());
  }
  const double yaw = planar(result.alignment->a_from_b.pose).phi;
  const Pose2 turned = compose(Pose2(0.0, 0.0, yaw), Pose2(in_b.x(), in_b.y(), 0.0));
  return {in_a.x() - turned.x, in_a.y() - turned.y, yaw};
}

std::vector<Constraint> GridAlignments::constraints(std::size_t a, std::size_t b) const {
  const Pair& pair = pairs_.at({a, b});
  std::vector<GridConstraint> grid_constraints = pair.result.grid_constraints;
  for (GridConstraint& grid_constraint : grid_constraints) {
    grid_constraint.place_in_b *= scales_[b];
    grid_constraint.a_from_place.x *= scales_[a];
    grid_constraint.a_from_place.y *= scales_[a];
  }
  return constraints_of(grid_constraints, rescaled(a), rescaled(b), pair.judgement.id);
}

std::vector<SubmapMatch> GridAlignments::matches(std::size_t a, std::size_t b, const std::vector<PreparedMap>& prepared,
                                                 const SubmapGraph& graph) const {
  const auto homes_a = homes_of(prepared[a]), homes_b = homes_of(prepared[b]);
  std::map<std::pair<std::size_t, std::size_t>, MatchSum> sums;
  for (const Constraint& constraint : constraints(a, b)) {
    const std::size_t from = homes_a.at(constraint.id.from), to = homes_b.at(constraint.id.to);
    const Pose2 tile_from_submap = inverse(submap_from(*prepared[b].submaps[to], constraint.id.to));
    const Pose2 submap_from_tile = submap_from(*prepared[a].submaps[from], constraint.id.from);
    const Pose2 from_from_to =
        compose(compose(submap_from_tile, planar(constraint.from_from_to.pose)), tile_from_submap);
    const Eigen::Matrix3d carry = adjoint(tile_from_submap);
    sums[{from, to}].add(from_from_to, carry.transpose() * planar(constraint.information) * carry);
  }
  const Pair& pair = pairs_.at({a, b});
  std::vector<SubmapMatch> matches;
  for (const auto& [names, sum] : sums)
    matches.push_back({graph.number(a, names.first), graph.number(b, names.second), sum.mean(), sum.information,
                       pair.result.probability, pair.judgement.id, true});
  return matches;
}

bool GridAlignments::may_lie(std::size_t a, std::size_t b, const Pose2& a_from_b) const {
  const Pose2 in_a(a_from_b.x / scales_[a], a_from_b.y / scales_[a], a_from_b.phi);
  const GridVerification counts =
      verify_alignment(*grids_[a], *grids_[b], {in_a, scales_[b] / scales_[a]}, options_.grids);
  return counts.mean_conflict_m() <= kMoved_m + kMostConflict * counts.mean_fit_m();
}

}  // namespace mapweave::fusion
