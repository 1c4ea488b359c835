#include "bent_grid.h"
#include "grid_conflicts.h"

#include <mapweave/core/format.h>
#include <mapweave/fusion/grid_map.h>
#include <mapweave/fusion/grid_pair.h>
#include <mapweave/maps/alignment.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

namespace mapweave::fusion {
namespace {

using matching::PlanarSimilarity;
using matching::WallPoint;

constexpr double kFit_m = 0.3;                       // two grids' walls that are one: a few cells
constexpr double kFitCosine = 0.7;                   // between their normals
constexpr double kConflictDepth_m = 0.6;             // into free space: twice kFit_m
constexpr double kApart_m = 3.0, kApart_rad = 0.15;  // alignments nearer than this are one, found twice
// What a placement has to fit, as a share of the one that fits most and at least, to show how much conflict there need
// be: what little fits by chance has no conflict either.
constexpr double kSubstance = 0.4, kLeastFit_m = 5.0;
// Where the best placement has that share of conflict, a metre counts as one that fits; with less it counts more, in
// inverse proportion, up to the bound: grids of one maker on one day may have none at all.
constexpr double kUsualConflict = 0.15, kMostConflictWeight = 8.0;
constexpr double kLeastSigma_m = 0.04, kLeastSigma_rad = 0.008;  // no constraint is surer than this
// Where each part of the probability is one half, and how fast it rises: from there to nine in ten with a fifth more
// support, 4 % more that is unusual, a rival with 14 % less. Chosen on half of one site's pairs and drawn plans
// (DECISIONS.md, 60).
constexpr double kSupport_m = 16.8, kSupportSlope = 12.0;
constexpr double kUnusual = 0.15, kUnusualSlope = 60.0;
constexpr double kRival = 0.36, kRivalSlope = 16.0;
// Of what conflicts as a share of what fits. Little overlap leaves more places to chance: then less of it is no
// accident.
constexpr double kConflict = 0.2, kConflictOverlap = 0.3, kConflictSlope = 40.0;
constexpr double kOdds =
    4.75;  // odds that the product of the parts is multiplied by: calibrated, as merges of lasers are
constexpr double kLeastWall_m = 8.0;  // of a grid in which places can be distinguished

enum class Seen : std::uint8_t { nothing, fit, conflict };

struct Verified {
  GridVerification counts;
  BentGrid bend;
  std::vector<Seen> seen[2];  // of a's samples, then of b's
  bool is_image = false;
};

// One side's walls against the other grid.
struct SideCount {
  double fit = 0.0, conflict = 0.0, known = 0.0, worst_tile = 0.0;
  std::vector<Seen> seen;
  std::vector<WallPoint> in_conflict;  // in this side's grid
};

template <class Place>
SideCount count(const PreparedGrid& of, const PreparedGrid& against, const Place& placed) {
  SideCount result;
  std::vector<double> by_tile(of.tile_centres.size(), 0.0);
  const double fit_m = std::max(kFit_m, 1.5 * std::max(of.walls.cell_m, against.walls.cell_m));
  result.seen.reserve(of.samples.size());
  for (const auto& sample : of.samples) {
    const int tile = of.tile_at(sample.x, sample.y);
    const std::optional<WallPoint> face = placed(tile, sample);
    Seen& seen = result.seen.emplace_back(Seen::nothing);
    if (!face) continue;
    const double depth_m = against.walls.depth_at(face->x, face->y);
    if (against.index.nearest(*face, fit_m, kFitCosine)) {
      seen = Seen::fit;
      result.fit += of.sample_m;
      result.known += of.sample_m;
    } else if (depth_m > kConflictDepth_m) {
      seen = Seen::conflict;
      result.in_conflict.push_back(sample);
      result.conflict += of.sample_m;
      result.known += of.sample_m;
      if (tile >= 0) by_tile[static_cast<std::size_t>(tile)] += of.sample_m;
    } else if (depth_m > 0.0) {
      result.known += of.sample_m;
    }
  }
  for (const double length : by_tile) result.worst_tile = std::max(result.worst_tile, length);
  return result;
}

// Of both sides, in a's frame.
std::vector<PairHypothesis::ContradictedWall> conflicts_of(const PreparedGrid& a, const PreparedGrid& b,
                                                           const Verified& as, const SideCount& of_a,
                                                           const SideCount& of_b) {
  std::vector<WallPoint> walls = of_a.in_conflict;
  for (const WallPoint& face : of_b.in_conflict)
    if (const int tile = b.tile_at(face.x, face.y); tile >= 0) walls.push_back(in_a(b, as.bend, tile, face));
  return places_of(walls, std::max(a.sample_m, b.sample_m));
}

Verified verified(const PreparedGrid& a, const PreparedGrid& b, const PlanarSimilarity& proposal, double scale_range) {
  Verified result;
  result.counts.a_from_b = refined(a, b, proposal, scale_range);
  result.bend = bent(a, b, result.counts.a_from_b);
  result.counts.bend_chi2 = result.bend.chi2;
  SideCount of_b = count(b, a, [&](int tile, const WallPoint& face) {
    return tile < 0 ? std::nullopt : std::optional<WallPoint>(in_a(b, result.bend, tile, face));
  });
  SideCount of_a = count(a, b, [&](int, const WallPoint& face) { return in_b(b, result.bend, face); });
  const std::array<SideCount*, 2> sides{&of_a, &of_b};
  for (std::size_t side = 0; side < 2; ++side) {
    result.counts.fit_m[side] = sides[side]->fit;
    result.counts.conflict_m[side] = sides[side]->conflict;
    result.counts.contradiction_m[side] = sides[side]->worst_tile;
    result.seen[side] = std::move(sides[side]->seen);
  }
  result.counts.conflicts = conflicts_of(a, b, result, of_a, of_b);
  result.counts.overlap =
      std::min(1.0, std::max(of_a.known, of_b.known) / std::min(a.walls.wall_m(), b.walls.wall_m()));
  return result;
}

std::vector<Verified> verified_proposals(const PreparedGrid& a, const PreparedGrid& b, const GridPairOptions& options,
                                         int most) {
  matching::GridProposalOptions proposals = options.proposals;
  proposals.most = most;
  std::vector<Verified> result;
  for (const auto& proposal : matching::propose_alignments(a.walls, b.walls, proposals))
    result.push_back(verified(a, b, proposal.a_from_b, options.proposals.scale_range));
  return result;
}

// Where b's tiles that are held in a lie, and how much each counts.
Eigen::Vector3d held_middle(const PreparedGrid& b, const BentGrid& bend) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weight = 0.0;
  for (std::size_t i = 0; i < b.tile_centres.size(); ++i) {
    const double held = bend.information[i].topLeftCorner<2, 2>().trace();
    sum += held * b.tile_centres[i];
    weight += held;
  }
  return {sum.x() / weight, sum.y() / weight, weight};
}

// What two placements of b in a say of the middle of what the first holds.
bool apart(const PreparedGrid& b, const Verified& one, const Verified& other) {
  const Eigen::Vector3d middle = held_middle(b, one.bend);
  const matching::Point2f in_b{static_cast<float>(middle.x()), static_cast<float>(middle.y())};
  const auto here = transformed(one.counts.a_from_b, in_b), there = transformed(other.counts.a_from_b, in_b);
  return std::hypot(here.x - there.x, here.y - there.y) > kApart_m ||
         std::abs(wrap_angle(one.counts.a_from_b.pose.phi - other.counts.a_from_b.pose.phi)) > kApart_rad;
}

// Of one place of a grid against the same place of another.
Eigen::Matrix3d bend_covariance() {
  return 2.0 * Eigen::Vector3d(kGridBend_m, kGridBend_m, kGridBend_rad).cwiseAbs2().asDiagonal().toDenseMatrix();
}

// How much a metre in conflict counts against one that fits. Doors were closed, things moved: that much conflict the
// best placement has, and where some placement has little, more of it elsewhere is no accident.
double conflict_weight(const std::vector<Verified*>& all) {
  double most_m = 0.0, least_share = 1.0;
  for (const Verified* one : all) most_m = std::max(most_m, one->counts.mean_fit_m());
  for (const Verified* one : all) {
    const double fit_m = one->counts.mean_fit_m(), conflict_m = one->counts.mean_conflict_m();
    if (fit_m >= std::max(kSubstance * most_m, kLeastFit_m))
      least_share = std::min(least_share, (conflict_m + 0.5) / (fit_m + conflict_m + 0.5));
  }
  return std::clamp(kUsualConflict / least_share, 1.0, kMostConflictWeight);
}

// Walls that fit under most other placements as well (those of a corridor) say little: what fits counts by how unusual
// it is.
void weigh(const PreparedGrid& a, const PreparedGrid& b, const PreparedGrid& image, const std::vector<Verified*>& all) {
  const double per_conflict = conflict_weight(all);
  for (Verified* one : all) {
    std::vector<const Verified*> others;
    for (const Verified* other : all)
      if (other->is_image != one->is_image || apart(one->is_image ? image : b, *one, *other)) others.push_back(other);
    const double placements = static_cast<double>(others.size()) + 1.0;
    one->counts.support_m = -per_conflict * one->counts.mean_conflict_m();
    for (int side = 0; side < 2; ++side)
      for (std::size_t i = 0; i < one->seen[side].size(); ++i) {
        if (one->seen[side][i] != Seen::fit) continue;
        double usual = 0.5;
        for (const Verified* other : others) usual += other->seen[side][i] == Seen::fit;
        one->counts.support_m +=
            0.5 * (side == 0 ? a : b).sample_m * std::log(placements / usual) / std::log(placements / 0.5);
      }
  }
}

bool supported_better(const Verified& one, const Verified& other) {
  return one.counts.support_m > other.counts.support_m;
}

// The rigid transform that lies nearest to the bent mesh where it is held, with the covariance that bends leave it.
Alignment rigid(const PreparedGrid& b, const Verified& best) {
  const Eigen::Vector3d middle = held_middle(b, best.bend);
  Eigen::Vector2d middle_in_a = Eigen::Vector2d::Zero();
  double c = 0.0, s = 0.0;
  for (int pass = 0; pass < 2; ++pass)
    for (std::size_t i = 0; i < b.tile_centres.size(); ++i) {
      const double held = best.bend.information[i].topLeftCorner<2, 2>().trace() / middle.z();
      const Eigen::Vector2d in_a(best.bend.a_from_tile[i].x, best.bend.a_from_tile[i].y),
          from_middle = b.tile_centres[i] - middle.head<2>();
      if (pass == 0) {
        middle_in_a += held * in_a;
      } else {
        const Eigen::Vector2d there = in_a - middle_in_a;
        c += held * from_middle.dot(there) + 1e-9 * std::cos(best.counts.a_from_b.pose.phi);
        s += held * (from_middle.x() * there.y() - from_middle.y() * there.x()) +
             1e-9 * std::sin(best.counts.a_from_b.pose.phi);
      }
    }
  const double yaw = std::atan2(s, c);
  const Pose2 turned = compose(Pose2(0.0, 0.0, yaw), Pose2(-middle.x(), -middle.y(), 0.0));
  const Pose2 a_from_b(middle_in_a.x() + turned.x, middle_in_a.y() + turned.y, yaw);

  // Each tile constrains where b lies as well as its walls hold it and no better than grids bend.
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d bending = bend_covariance();
  for (std::size_t i = 0; i < b.tile_centres.size(); ++i) {
    const Eigen::Matrix3d tile_from_b = adjoint(Pose2(-b.tile_centres[i].x(), -b.tile_centres[i].y(), 0.0));
    const Eigen::Matrix3d& held = best.bend.information[i];
    information +=
        tile_from_b.transpose() * (held * (Eigen::Matrix3d::Identity() + bending * held).inverse()) * tile_from_b;
  }
  Alignment alignment;
  alignment.a_from_b.pose = spatial(a_from_b);
  const Eigen::Matrix3d covariance = information.ldlt().solve(Eigen::Matrix3d::Identity());
  alignment.covariance = spatial(Eigen::Matrix3d(0.5 * (covariance + covariance.transpose())));
  return alignment;
}

std::vector<GridConstraint> grid_constraints_of(const PreparedGrid& b, const BentGrid& bend) {
  std::vector<GridConstraint> grid_constraints;
  const Eigen::Matrix3d floor = Eigen::Vector3d(kLeastSigma_m, kLeastSigma_m, kLeastSigma_rad).cwiseAbs2().asDiagonal();
  for (std::size_t i = 0; i < b.tile_centres.size(); ++i) {
    const Eigen::Matrix3d& held = bend.information[i];
    if (held.topLeftCorner<2, 2>().trace() < 100.0) continue;  // hardly a wall
    const Eigen::Matrix3d bounded = held * (Eigen::Matrix3d::Identity() + floor * held).inverse();
    grid_constraints.push_back({b.tile_centres[i], bend.a_from_tile[i], 0.5 * (bounded + bounded.transpose())});
  }
  return grid_constraints;
}

Evidence evidence_of(const PreparedGrid& a, const PreparedGrid& b, const Verified& best, double rival_m) {
  const GridVerification& counts = best.counts;
  Evidence evidence;
  evidence.overlap = counts.overlap;
  evidence.inliers = 1.0;
  for (int side = 0; side < 2; ++side) {
    const double seen = counts.fit_m[side] + counts.conflict_m[side];
    evidence.inliers = std::min(evidence.inliers, counts.fit_m[side] / std::max(seen, 1e-9));
    evidence.conflict = std::max(evidence.conflict, counts.conflict_m[side] / std::max(seen, 1e-9));
    evidence.longest_contradiction_m[side] = counts.contradiction_m[side];
  }
  std::size_t shared = 0;
  const auto& walls = b.walls;
  for (int row = 0; row < walls.rows; row += 2)
    for (int column = 0; column < walls.columns; column += 2) {
      const double x = walls.origin_x_m + (column + 0.5) * walls.cell_m,
                   y = walls.origin_y_m + (row + 0.5) * walls.cell_m;
      if (walls.depth_at(x, y) <= 0.0F) continue;
      const int tile = b.tile_at(x, y);
      if (tile < 0) continue;
      const WallPoint there = in_a(b, best.bend, tile, {static_cast<float>(x), static_cast<float>(y), 1.0F, 0.0F});
      shared += a.walls.depth_at(there.x, there.y) > 0.0F;
    }
  evidence.overlap_m2 = static_cast<double>(shared) * 4.0 * walls.cell_m * walls.cell_m;
  evidence.second_best_ratio = std::clamp(rival_m / std::max(counts.support_m, 1e-9), 0.0, 1.0);
  Eigen::Matrix2d directions = Eigen::Matrix2d::Zero();
  for (const auto& information : best.bend.information) directions += information.topLeftCorner<2, 2>();
  const Eigen::Vector2d held = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(directions).eigenvalues();
  evidence.observability = {1.0, held[0] / std::max(held[1], 1e-9), 1.0};
  return evidence;
}

double logistic(double x) { return 1.0 / (1.0 + std::exp(-x)); }

double usual_conflict(const GridVerification& counts) { return kConflict + kConflictOverlap * counts.overlap; }
double conflict_of(const GridVerification& counts) {
  return counts.mean_conflict_m() / std::max(counts.mean_fit_m(), 1e-9);
}

// That much wall must speak for a place, of what fits not too little must be unusual, not too much may lie in free
// space, and no other placement may come near (DECISIONS.md, 60).
double probability_of(const GridVerification& best, double unusual, double rival) {
  const double product =
      logistic(kSupportSlope * std::log(best.support_m / kSupport_m)) * logistic(kUnusualSlope * (unusual - kUnusual)) *
      logistic(kConflictSlope * (usual_conflict(best) - conflict_of(best))) * logistic(kRivalSlope * (kRival - rival));
  return kOdds * product / (1.0 + (kOdds - 1.0) * product);
}

// From b's side of a pair that was judged from a's.
GridPairResult reversed(GridPairResult result) {
  const auto turn = [](GridVerification& counts) {
    const double scale = 1.0 / counts.a_from_b.scale;
    Pose2 pose = inverse(counts.a_from_b.pose);
    counts.a_from_b = {Pose2(pose.x * scale, pose.y * scale, pose.phi), scale};
    std::swap(counts.fit_m[0], counts.fit_m[1]);
    std::swap(counts.conflict_m[0], counts.conflict_m[1]);
    std::swap(counts.contradiction_m[0], counts.contradiction_m[1]);
    for (PairHypothesis::ContradictedWall& place : counts.conflicts) {
      const auto there =
          matching::transformed(counts.a_from_b, {static_cast<float>(place.x_m), static_cast<float>(place.y_m)});
      place.x_m = there.x;
      place.y_m = there.y;
    }
  };
  for (auto& counts : result.hypotheses) turn(counts);
  for (auto& counts : result.images) turn(counts);
  std::swap(result.evidence.longest_contradiction_m[0], result.evidence.longest_contradiction_m[1]);
  if (result.alignment) result.alignment = inverse(*result.alignment);
  for (auto& grid_constraint : result.grid_constraints) {
    const Pose2 place_from_a = inverse(grid_constraint.a_from_place);
    const Eigen::Vector2d place_in_a(grid_constraint.a_from_place.x, grid_constraint.a_from_place.y);
    const Eigen::Matrix3d turn_information = adjoint(Pose2(0.0, 0.0, place_from_a.phi));
    grid_constraint = {place_in_a,
                       Pose2(grid_constraint.place_in_b.x(), grid_constraint.place_in_b.y(), place_from_a.phi),
                       turn_information.transpose() * grid_constraint.information * turn_information};
  }
  return result;
}

// Which grid the other is laid on does not depend on their names.
bool goes_first(const matching::GridWalls& one, const matching::GridWalls& other) {
  if (one.faces.size() != other.faces.size()) return one.faces.size() > other.faces.size();
  const auto key = [](const WallPoint& p) { return std::make_tuple(p.x, p.y, p.normal_x, p.normal_y); };
  return std::lexicographical_compare(one.faces.begin(), one.faces.end(), other.faces.begin(), other.faces.end(),
                                      [&](const WallPoint& p, const WallPoint& q) { return key(p) < key(q); });
}

double unusual_share(const GridVerification& counts) { return counts.support_m / std::max(counts.mean_fit_m(), 1e-9); }

double probability_by_itself(const GridVerification& counts) {
  return counts.support_m > 0.0 ? probability_of(counts, unusual_share(counts), 0.0) : 0.0;
}

void decide(GridPairResult& result, const GridVerification& best, double rival, double merge_probability) {
  const double unusual = unusual_share(best);
  result.probability = probability_of(best, unusual, rival);
  if (result.probability >= merge_probability) return;
  if (rival > kRival) {
    result.reason = Reason::ambiguous;
    result.note = format(
        "another alignment, or one with the mirror image, has %.0f %% of the support of the best (%.0f m of wall)",
        100.0 * rival, best.support_m);
  } else if (conflict_of(best) > usual_conflict(best) - 2.0 / kConflictSlope) {
    result.reason = Reason::contradiction;
    result.note =
        format("under the best alignment %.0f m of wall coincide and %.0f m lie in free space of the other grid",
               best.mean_fit_m(), best.mean_conflict_m());
  } else if (unusual < kUnusual) {
    result.reason = Reason::unobservable;
    result.note = format("of %.0f m of wall that coincide only %.0f m do not do so elsewhere, too", best.mean_fit_m(),
                         best.support_m);
  } else {
    result.reason = Reason::little_overlap;
    result.note =
        format("only %.0f m of wall speak for the best alignment; about %.0f m are needed", best.support_m, kSupport_m);
  }
}

}  // namespace

std::shared_ptr<const PreparedGrid> prepare_grid(const OccupancyGrid& grid) {
  return std::make_shared<const PreparedGrid>(matching::walls_of(grid));
}

GridPairResult align_grids(const PreparedGrid& a, const PreparedGrid& b, const GridPairOptions& options,
                           double merge_probability) {
  if (goes_first(b.walls, a.walls)) return reversed(align_grids(b, a, options, merge_probability));
  GridPairResult result;
  const double wall_m = result.wall_m = std::min(a.walls.wall_m(), b.walls.wall_m());
  if (wall_m < kLeastWall_m) {
    result.reason = Reason::unobservable;
    result.note =
        format("one of the grids shows %.1f m of walls beside free space; %.0f m are needed", wall_m, kLeastWall_m);
    return result;
  }
  std::vector<Verified> found = verified_proposals(a, b, options, options.proposals.most);
  const PreparedGrid image(matching::mirrored(b.walls));
  std::vector<Verified> images = verified_proposals(a, image, options, options.mirrored);
  std::vector<Verified*> all;
  for (Verified& one : found) all.push_back(&one);
  for (Verified& one : images) {
    one.is_image = true;
    all.push_back(&one);
  }
  weigh(a, b, image, all);
  std::stable_sort(found.begin(), found.end(), supported_better);
  std::stable_sort(images.begin(), images.end(), supported_better);
  for (const Verified& one : found) {
    result.hypotheses.push_back(one.counts);
    result.hypotheses.back().probability = probability_by_itself(one.counts);
  }
  for (const Verified& one : images) result.images.push_back(one.counts);
  if (found.empty() || found.front().counts.support_m <= 0.0) {
    result.reason = Reason::contradiction;
    result.note = "under every alignment more walls lie in free space of the other grid than on its walls";
    return result;
  }
  const Verified& best = found.front();
  const double support_m = best.counts.support_m;
  const auto rival =
      std::find_if(found.begin() + 1, found.end(), [&](const Verified& other) { return apart(b, best, other); });
  double rival_m = rival == found.end() ? 0.0 : rival->counts.support_m;
  if (!result.images.empty()) rival_m = std::max(rival_m, result.images.front().support_m);
  result.evidence = evidence_of(a, b, best, rival_m);
  result.alignment = rigid(b, best);
  decide(result, best.counts, std::max(rival_m, 0.0) / support_m, merge_probability);
  if (result.reason == Reason::none) result.grid_constraints = grid_constraints_of(b, best.bend);
  return result;
}

GridPairResult align_grids(const OccupancyGrid& a, const OccupancyGrid& b, const GridPairOptions& options,
                           double merge_probability) {
  return align_grids(*prepare_grid(a), *prepare_grid(b), options, merge_probability);
}

GridVerification verify_alignment(const PreparedGrid& a, const PreparedGrid& b, const PlanarSimilarity& a_from_b,
                                  const GridPairOptions& options) {
  return verified(a, b, a_from_b, options.proposals.scale_range).counts;
}

std::vector<Constraint> constraints_of(const std::vector<GridConstraint>& grid_constraints, const Map& a, const Map& b,
                                       const Hash& because) {
  const auto tiles_a = unbent_tiles(a), tiles_b = unbent_tiles(b);
  const auto tile_at = [](const Map& map, const std::map<NodeId, Pose2>& tiles, double x_m, double y_m) {
    return std::find_if(tiles.begin(), tiles.end(), [&](const auto& tile) {
      const auto& payload = map.nodes.find(tile.first)->payload;
      const auto* grid = payload == nullptr ? nullptr : std::get_if<OccupancyGrid>(payload.get());
      if (grid == nullptr) return false;
      const double column = (x_m - tile.second.x) / grid->resolution_m,
                   row = (y_m - tile.second.y) / grid->resolution_m;
      return column >= 0.0 && row >= 0.0 && column < grid->columns && row < grid->rows;
    });
  };
  std::vector<Constraint> constraints;
  for (const auto& grid_constraint : grid_constraints) {
    const auto tile_a = tile_at(a, tiles_a, grid_constraint.a_from_place.x, grid_constraint.a_from_place.y);
    const auto tile_b = tile_at(b, tiles_b, grid_constraint.place_in_b.x(), grid_constraint.place_in_b.y());
    if (tile_a == tiles_a.end() || tile_b == tiles_b.end()) continue;
    const Pose2 place_from_tile =
        between(Pose2(grid_constraint.place_in_b.x(), grid_constraint.place_in_b.y(), 0.0), tile_b->second);
    const Eigen::Matrix3d carried = adjoint(place_from_tile);
    const auto same = [&](const Constraint& other) {
      return other.id.from == tile_a->first && other.id.to == tile_b->first;
    };
    const ConstraintId id{ConstraintKind::between_maps, tile_a->first, tile_b->first,
                          static_cast<std::uint32_t>(std::count_if(constraints.begin(), constraints.end(), same))};
    Constraint constraint =
        planar_constraint(id, between(tile_a->second, compose(grid_constraint.a_from_place, place_from_tile)),
                          carried.transpose() * grid_constraint.information * carried);
    constraint.because = because;
    constraints.push_back(constraint);
  }
  return constraints;
}

}  // namespace mapweave::fusion
