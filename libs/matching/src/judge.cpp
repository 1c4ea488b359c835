#include <mapweave/core/error.h>
#include <mapweave/maps/alignment.h>
#include <mapweave/matching/judge.h>
#include <mapweave/matching/scan_matcher.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace mapweave::matching {
namespace {

constexpr double kInverseSight = 1.0 / SubmapModel::kSightResolution;
// Of likelihoods from 0 to 255, as a wall's falls off (sigma of 7 cm): a wall is there within 0.12 m.
constexpr std::uint8_t kOnWall = 60;
// Of runs of contradicted walls: two cells of the sight, so that gaps between rays do not part a run.
constexpr double kRunCell_m = 0.2, kInverseRunCell = 5.0;
constexpr int kClearAround = 2;  // cells of the sight: grazing rays and half a cell of error prove nothing
// Of walls laid into the other submap: for a narrow window, then to centre a peak, then to refine. More take longer,
// and shift the best place by less than a cell; the search's sums hold 256.
constexpr std::size_t kNarrowPoints = 150, kCoarsePoints = 200, kFinePoints = 500;
constexpr double kNarrowStep_rad = 0.0175;                          // a degree
constexpr PriorWeight kNoPrior{10.0, 10.0}, kFaintPrior{1.0, 1.0};  // far wider than the windows: ties alone
// Around a peak of the search: two of its cells, two degrees, in steps that move a wall at 10 m by a cell.
constexpr SearchWindow kAroundPeak{0.2, 0.035, 0.005};
constexpr int kRefinements = 25;      // from that far, twice as many as between scans
constexpr double kPerConflict = 2.0;  // what is seen through counts twice as much as what fits: rivals are ranked by it
constexpr double kSame_m = 0.4, kSame_rad = 0.15;  // apart: less is the same place, found twice
// Points share the errors of the submaps they come from: fifty of them hold no more information than one does. The
// floor is that of the submaps' own drift: 1 cm and 0.1 degrees. What no wall holds gets 10 m and 3 rad.
constexpr double kPointsOfOne = 50.0;
constexpr double kFloor_m2 = 1e-4, kFloor_rad2 = 3e-6, kUnheld_per_m2 = 1e-2, kUnheld_per_rad2 = 1e-1;

struct OneDirection {
  std::size_t inliers = 0, contradicted = 0, unclear = 0;
  double longest_m = 0.0;
  Eigen::Matrix2d normals = Eigen::Matrix2d::Zero();  // sum over inliers, in a's frame
};

// Longest connected run of contradicted walls: cells that touch, times their length.
double longest_run(std::vector<std::pair<int, int>> cells) {
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
  std::vector<bool> done(cells.size(), false);
  std::size_t longest = 0;
  std::vector<std::size_t> stack;
  for (std::size_t start = 0; start < cells.size(); ++start) {
    if (done[start]) continue;
    std::size_t size = 0;
    stack.assign(1, start);
    done[start] = true;
    while (!stack.empty()) {
      const auto [y, x] = cells[stack.back()];
      stack.pop_back();
      ++size;
      for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) {
          const auto place = std::lower_bound(cells.begin(), cells.end(), std::make_pair(y + j, x + i));
          if (place == cells.end() || *place != std::make_pair(y + j, x + i)) continue;
          const auto index = static_cast<std::size_t>(place - cells.begin());
          if (done[index]) continue;
          done[index] = true;
          stack.push_back(index);
        }
    }
    longest = std::max(longest, size);
  }
  return kRunCell_m * static_cast<double>(longest);
}

// The walls of `from` seen by `to`.
OneDirection look(const SubmapModel& to, const SubmapModel& from, const Pose2& to_from_from, bool rotate_normals) {
  OneDirection result;
  std::vector<std::pair<int, int>> contradicted;
  const double c = std::cos(to_from_from.phi), s = std::sin(to_from_from.phi);
  const auto& sight = to.sight();
  for (const auto& wall : from.walls()) {
    const double x = c * wall.x - s * wall.y + to_from_from.x, y = s * wall.x + c * wall.y + to_from_from.y;
    const int cx = cell_of(x, kInverseSight), cy = cell_of(y, kInverseSight);
    const Sight here = sight.get(cx, cy);
    if (to.field().likelihood().get(cell_of(x, 1.0 / WallField::kResolution),
                                    cell_of(y, 1.0 / WallField::kResolution)) > kOnWall) {
      ++result.inliers;
      const double nx = rotate_normals ? c * wall.normal_x - s * wall.normal_y : wall.normal_x;
      const double ny = rotate_normals ? s * wall.normal_x + c * wall.normal_y : wall.normal_y;
      result.normals(0, 0) += nx * nx;
      result.normals(0, 1) += nx * ny;
      result.normals(1, 1) += ny * ny;
      continue;
    }
    if (here == Sight::unknown) continue;
    // Clearly seen through only where the cells around are free too.
    bool clear = here == Sight::free;
    for (int j = -kClearAround; j <= kClearAround && clear; ++j)
      for (int i = -kClearAround; i <= kClearAround && clear; ++i) clear = sight.get(cx + i, cy + j) == Sight::free;
    if (clear) {
      ++result.contradicted;
      contradicted.emplace_back(cell_of(y, kInverseRunCell), cell_of(x, kInverseRunCell));
    } else {
      ++result.unclear;
    }
  }
  result.normals(1, 0) = result.normals(0, 1);
  result.longest_m = longest_run(std::move(contradicted));
  return result;
}

double share(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

std::size_t common_cells(const SubmapModel& a, const SubmapModel& b, const Pose2& a_from_b) {
  const auto& from = b.sight();
  const double c = std::cos(a_from_b.phi), s = std::sin(a_from_b.phi);
  std::size_t common = 0;
  for (int y = from.first_y(); y < from.first_y() + from.height(); ++y)
    for (int x = from.first_x(); x < from.first_x() + from.width(); ++x) {
      if (from.at(x, y) == Sight::unknown) continue;
      const double px = (x + 0.5) * SubmapModel::kSightResolution, py = (y + 0.5) * SubmapModel::kSightResolution;
      common += a.sight().get(cell_of(c * px - s * py + a_from_b.x, kInverseSight),
                              cell_of(s * px + c * py + a_from_b.y, kInverseSight)) != Sight::unknown;
    }
  return common;
}

std::vector<WallPoint> some_of(const std::vector<WallPoint>& walls, std::size_t most) {
  std::vector<WallPoint> points;
  const std::size_t count = std::min(most, walls.size());
  points.reserve(count);
  for (std::size_t i = 0; i < count; ++i) points.push_back(walls[i * walls.size() / count]);
  return points;
}

// Walls of b that a looked at.
std::vector<WallPoint> known_walls(const SubmapModel& a, const SubmapModel& b, const Pose2& a_from_b) {
  const double c = std::cos(a_from_b.phi), s = std::sin(a_from_b.phi);
  std::vector<WallPoint> walls;
  for (const WallPoint& wall : b.walls())
    if (a.sight().get(cell_of(c * wall.x - s * wall.y + a_from_b.x, kInverseSight),
                      cell_of(s * wall.x + c * wall.y + a_from_b.y, kInverseSight)) != Sight::unknown)
      walls.push_back(wall);
  return walls;
}

double sigmoid(double v) { return 1.0 / (1.0 + std::exp(-v)); }

// Weights fitted by hand to pairs of real submaps with known poses: each unit of the sum is a factor e of the odds. A
// pair with 70 % of the walls, 4 % seen through, 0.8 m of them in a row, and 15 m2 in common has 2.0, or 88 %. The odds
// double with 5 % more walls, 3 % less seen through, half a metre less in a row, or a little more than twice the area,
// as whose power 0.9 they grow; they halve with each 7 % by which a rival comes nearer than 85 % of the best. Areas
// below 0.1 m2 are refused anyway (min_overlap_m2).
double probability_of(const Evidence& e) {
  const double contradiction = std::max(e.longest_contradiction_m[0], e.longest_contradiction_m[1]);
  const double logit = 2.0 + 14.0 * (e.inliers - 0.70) - 22.0 * (e.conflict - 0.04) - 1.4 * (contradiction - 0.8) +
                       0.9 * std::log(std::max(e.overlap_m2, 0.1) / 15.0) -
                       10.0 * std::max(0.0, e.second_best_ratio - 0.85);
  return sigmoid(logit);
}

Reason doubt_of(const Evidence& e, const JudgeOptions& options) {
  if (e.overlap_m2 < options.min_overlap_m2) return Reason::little_overlap;
  if (e.conflict > options.max_conflict ||
      std::max(e.longest_contradiction_m[0], e.longest_contradiction_m[1]) > options.max_contradiction_m)
    return Reason::contradiction;
  if (e.inliers < options.min_inliers) return Reason::contradiction;
  if (options.second_verifier && (e.verifier_inliers < options.min_verifier_inliers ||
                                  e.verifier_disagreement_m > options.max_verifier_disagreement_m))
    return Reason::inconsistent;
  if (e.second_best_ratio > options.max_second_best) return Reason::ambiguous;
  if (e.observability(1) < options.min_observability) return Reason::unobservable;
  return Reason::none;
}

// All walls of one side are laid into the other: those of a raster's tiles where the other side is of scans, which see
// far beyond them.
std::vector<Peak> peaks_of(const SubmapModel& a, const SubmapModel& b, const WideWindow& window,
                           const SearchOptions& options) {
  if (!a.is_raster() || b.is_raster()) return search_peaks(a, b, window, options);
  WideWindow turned = window;
  turned.a_from_b = inverse(window.a_from_b);
  std::vector<Peak> peaks = search_peaks(b, a, turned, options);
  for (Peak& peak : peaks) peak.a_from_b = inverse(peak.a_from_b);
  return peaks;
}

// The best place of some walls of b in a narrow window.
std::vector<Peak> peak_of(const Raster<std::uint8_t>& likelihood, const std::vector<WallPoint>& walls,
                          const WideWindow& window, const JudgeOptions& options) {
  constexpr std::size_t kFewest = 40;  // walls: of fewer, a share says nothing
  if (walls.size() < kFewest) return {};
  const auto best = correlate(likelihood, some_of(walls, kNarrowPoints), window.a_from_b,
                              {window.radius_m, window.yaw_rad, kNarrowStep_rad}, kNoPrior);
  if (!best || best->score < options.min_score) return {};
  return {{best->field_from_scan, best->score}};
}

}  // namespace

Evidence weigh(const SubmapModel& a, const SubmapModel& b, const Pose2& a_from_b) {
  Evidence evidence;
  const OneDirection b_in_a = look(a, b, a_from_b, true), a_in_b = look(b, a, inverse(a_from_b), false);
  const std::size_t common = common_cells(a, b, a_from_b);
  constexpr double kCell = SubmapModel::kSightResolution * SubmapModel::kSightResolution;
  evidence.overlap_m2 = static_cast<double>(common) * kCell;
  evidence.overlap = std::min(1.0, share(common, std::max<std::size_t>(1, std::min(a.known_cells(), b.known_cells()))));
  const auto inliers = [](const OneDirection& one) {
    return share(one.inliers, one.inliers + one.contradicted + one.unclear);
  };
  const auto conflict = [](const OneDirection& one) {
    return share(one.contradicted, one.inliers + one.contradicted + one.unclear);
  };
  evidence.inliers = std::min(inliers(b_in_a), inliers(a_in_b));
  evidence.conflict = std::max(conflict(b_in_a), conflict(a_in_b));
  evidence.longest_contradiction_m[0] = a_in_b.longest_m;
  evidence.longest_contradiction_m[1] = b_in_a.longest_m;
  const Eigen::Matrix2d normals = b_in_a.normals + a_in_b.normals;
  if (normals.trace() > 0) {
    const Eigen::Vector2d values =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(normals / normals.trace()).eigenvalues();
    evidence.observability = {values(1), std::max(0.0, values(0)), 1.0};
  }
  return evidence;
}

Hash judgement_id(const Hash& content_a, const Hash& content_b, const WideWindow& window, const JudgeOptions& options,
                  Field field) {
  Hasher hasher;
  hasher.add("submap judge 1").add(content_a).add(content_b);
  for (double v : {window.a_from_b.x, window.a_from_b.y, window.a_from_b.phi, window.radius_m, window.yaw_rad,
                   options.min_score, options.rival_ratio, options.min_overlap_m2, options.min_inliers,
                   options.max_conflict, options.max_contradiction_m, options.max_second_best,
                   options.min_observability, options.second_verifier ? 1.0 : 0.0, options.min_verifier_inliers,
                   options.max_verifier_disagreement_m, static_cast<double>(options.search_budget)})
    hasher.add(v);
  if (field == Field::b) hasher.add("field b");
  if (window.known_part) hasher.add("known part");
  return hasher.finish();
}

namespace {

Judgement judge_in_field_of_a(const SubmapView& a, const SubmapView& b, const WideWindow& window,
                              const JudgeOptions& options) {
  Judgement judgement;
  judgement.a = a.id;
  judgement.b = b.id;
  judgement.content_a = a.content;
  judgement.content_b = b.content;
  judgement.doubt = Reason::little_overlap;

  SearchOptions search;
  search.min_score = options.min_score;
  search.rival_ratio = options.rival_ratio;
  search.budget = static_cast<std::size_t>(options.search_budget);
  const std::vector<WallPoint> walls =
      window.known_part ? known_walls(*a.model, *b.model, window.a_from_b) : b.model->walls();
  std::optional<Raster<std::uint8_t>> kept;
  const auto likelihood = [&]() -> const Raster<std::uint8_t>& {
    return kept ? *kept : kept.emplace(a.model->field().likelihood().dense());
  };
  const auto peaks =
      window.known_part ? peak_of(likelihood(), walls, window, options) : peaks_of(*a.model, *b.model, window, search);
  if (peaks.empty()) return judgement;

  struct Hypothesis {
    ScanMatch match;
    Evidence evidence;
    double value;
  };
  std::vector<Hypothesis> hypotheses;
  const auto coarse = some_of(walls, kCoarsePoints), fine = some_of(walls, kFinePoints);
  for (const auto& peak : peaks) {
    const auto near = correlate(likelihood(), coarse, peak.a_from_b, kAroundPeak, kFaintPrior);
    Hypothesis hypothesis;
    hypothesis.match =
        refine(a.model->field(), fine, near ? near->field_from_scan : peak.a_from_b, {}, nullptr, kRefinements);
    hypothesis.evidence = weigh(*a.model, *b.model, hypothesis.match.field_from_scan);
    hypothesis.value = hypothesis.evidence.inliers - kPerConflict * hypothesis.evidence.conflict;
    hypotheses.push_back(hypothesis);
  }
  std::stable_sort(hypotheses.begin(), hypotheses.end(),
                   [](const Hypothesis& l, const Hypothesis& r) { return l.value > r.value; });
  // Refinement may lead two peaks to one place.
  std::vector<Hypothesis> distinct;
  for (const auto& hypothesis : hypotheses) {
    const bool known = std::any_of(distinct.begin(), distinct.end(), [&](const Hypothesis& other) {
      const Pose2 apart = between(other.match.field_from_scan, hypothesis.match.field_from_scan);
      return std::hypot(apart.x, apart.y) < kSame_m && std::abs(apart.phi) < kSame_rad;
    });
    if (!known) distinct.push_back(hypothesis);
  }
  Evidence& best = distinct.front().evidence;
  if (distinct.size() > 1 && best.inliers > 0)  // of what is worth nothing a rival is worth as much
    best.second_best_ratio =
        distinct[0].value > 0.0 ? std::clamp(distinct[1].value / distinct[0].value, 0.0, 1.0) : 1.0;
  if (options.second_verifier) {
    if (const auto verification = verify(*a.model, *b.model, distinct.front().match.field_from_scan)) {
      best.verifier_inliers = verification->inliers;
      best.verifier_disagreement_m = verification->disagreement_m;
    }
  }
  for (const auto& hypothesis : distinct) {
    Alignment alignment;
    alignment.a_from_b.pose = spatial(hypothesis.match.field_from_scan);
    Eigen::Matrix3d information = hypothesis.match.information / kPointsOfOne;
    information.diagonal() += Eigen::Vector3d(kUnheld_per_m2, kUnheld_per_m2, kUnheld_per_rad2);
    const Eigen::Matrix3d covariance =
        information.inverse() + Eigen::Vector3d(kFloor_m2, kFloor_m2, kFloor_rad2).asDiagonal().toDenseMatrix();
    alignment.covariance = spatial(Eigen::Matrix3d(0.5 * (covariance + covariance.transpose())));
    judgement.hypotheses.push_back(alignment);
    judgement.scores.push_back(hypothesis.match.score);
  }
  judgement.evidence = best;
  judgement.doubt = doubt_of(best, options);
  judgement.probability = probability_of(best);
  if (judgement.doubt != Reason::none) judgement.probability *= kProbabilityOfDoubt;
  return judgement;
}

// The same, seen from the other side.
Judgement inverse(Judgement judgement) {
  std::swap(judgement.a, judgement.b);
  std::swap(judgement.content_a, judgement.content_b);
  std::swap(judgement.evidence.longest_contradiction_m[0], judgement.evidence.longest_contradiction_m[1]);
  for (Alignment& alignment : judgement.hypotheses) alignment = mapweave::inverse(alignment);
  return judgement;
}

}  // namespace

Judgement judge(const SubmapView& a, const SubmapView& b, const WideWindow& window, const JudgeOptions& options,
                Field field) {
  MAPWEAVE_EXPECT(a.id < b.id, "a judgement names the lower submap first");
  WideWindow turned = window;
  turned.a_from_b = mapweave::inverse(window.a_from_b);
  Judgement judgement = field == Field::a ? judge_in_field_of_a(a, b, window, options)
                                          : inverse(judge_in_field_of_a(b, a, turned, options));
  judgement.id = judgement_id(a.content, b.content, window, options, field);
  return judgement;
}

}  // namespace mapweave::matching
