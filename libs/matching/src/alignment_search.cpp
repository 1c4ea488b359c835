#include "counted_random.h"

#include <mapweave/core/error.h>
#include <mapweave/matching/alignment_search.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace mapweave::matching {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix7 = Eigen::Matrix<double, 7, 7>;
using Vector7 = Eigen::Matrix<double, 7, 1>;

constexpr double kGate = 5.991;         // 95 % of chi square with two degrees of freedom
constexpr double kNearest = 1e-3;       // of depths, in the unit of the side
constexpr std::size_t kSampleSize = 3;  // for both solvers

Matrix3d cross_matrix(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

struct CameraInSide {
  Pinhole pinhole;
  Matrix3d rotation;  // camera_from_side
  Vector3d translation;
  explicit CameraInSide(const CameraPlace& place) : pinhole(place.pinhole) {
    const Pose3 camera_from_side = inverse(place.side_from_camera);
    rotation = camera_from_side.q.toRotationMatrix();
    translation = camera_from_side.t;
  }
};

std::vector<CameraInSide> prepared(const std::vector<CameraPlace>& places) {
  std::vector<CameraInSide> cameras;
  for (const CameraPlace& place : places) cameras.emplace_back(place);
  return cameras;
}

// Squared error in sigmas of a point of one side in a picture of the other; infinite behind the camera. With `slope`,
// the derivative of the error by the point in the frame of the picture's side.
double sighting_error(const CameraInSide& camera, const Vector3d& point_in_side, const Vector2d& pixel, double sigma_px,
                      Vector2d* error, Eigen::Matrix<double, 2, 3>* slope) {
  const Vector3d p = camera.rotation * point_in_side + camera.translation;
  if (!(p.z() > kNearest)) return std::numeric_limits<double>::infinity();
  const Vector2d difference = (camera.pinhole.project(p) - pixel) / sigma_px;
  if (error != nullptr) *error = difference;
  if (slope != nullptr) {
    const double x = camera.pinhole.fx / p.z() / sigma_px, y = camera.pinhole.fy / p.z() / sigma_px;
    Eigen::Matrix<double, 2, 3> by_point;
    by_point << x, 0.0, -x * p.x() / p.z(), 0.0, y, -y * p.y() / p.z();
    *slope = by_point * camera.rotation;
  }
  return difference.squaredNorm();
}

class Search {
 public:
  Search(const AlignmentProblem& problem, const AlignmentOptions& options)
      : problem_(problem),
        options_(options),
        cameras_a_(prepared(problem.cameras_a)),
        cameras_b_(prepared(problem.cameras_b)) {
    for (const FeaturePair& pair : problem.pairs) {
      MAPWEAVE_EXPECT(pair.camera_a < cameras_a_.size() && pair.camera_b < cameras_b_.size(),
                      "a pair names cameras of the problem");
      MAPWEAVE_EXPECT(pair.sigma_a_px > 0.0 && pair.sigma_b_px > 0.0, "a pixel has a deviation");
      MAPWEAVE_EXPECT(pair.point_in_a || pair.point_in_b, "a pair knows a point");
    }
  }

  std::optional<AlignmentFit> by_sampling() const;
  std::optional<AlignmentFit> refined(const Sim3& guess) const;

 private:
  // Truncated squared errors, 0 .. 1024 a pair; integers, so that sums have no order.
  struct Support {
    std::int64_t score = 0;
    std::vector<std::uint32_t> inliers;
  };
  double worst_error(const FeaturePair& pair, const Sim3& a_from_b, const Sim3& b_from_a) const {
    double worst = 0.0;
    if (pair.point_in_b)
      worst = sighting_error(cameras_a_[pair.camera_a], transformed(*pair.point_in_b, a_from_b), pair.pixel_a,
                             pair.sigma_a_px, nullptr, nullptr);
    if (pair.point_in_a && worst < kGate)
      worst = std::max(worst, sighting_error(cameras_b_[pair.camera_b], transformed(*pair.point_in_a, b_from_a),
                                             pair.pixel_b, pair.sigma_b_px, nullptr, nullptr));
    return worst;
  }
  Support support_of(const Sim3& a_from_b) const {
    const Sim3 b_from_a = inverse(a_from_b);
    Support support;
    for (std::size_t i = 0; i < problem_.pairs.size(); ++i) {
      const double error = worst_error(problem_.pairs[i], a_from_b, b_from_a);
      if (!(error < kGate)) continue;
      support.score += 256 + static_cast<std::int64_t>(768.0 * (1.0 - error / kGate));
      support.inliers.push_back(static_cast<std::uint32_t>(i));
    }
    return support;
  }

  // What samples are drawn from, and how a sample becomes poses.
  enum class Solver { points, rays_of_b, rays_of_a };  // rays_of_b: points of a in a picture of b
  struct Sampling {
    Solver solver = Solver::points;
    std::vector<std::uint32_t> from;
  };
  Sampling sampling() const;
  void solve(const Sampling& sampling, const std::array<std::uint32_t, kSampleSize>& sample,
             std::vector<Sim3>& poses) const;
  void solve_rays(Solver solver, const std::array<std::uint32_t, kSampleSize>& sample, std::vector<Sim3>& poses) const;

  struct Normal {
    Matrix7 information = Matrix7::Zero();
    Vector7 gradient = Vector7::Zero();
    double cost = 0.0, square = 0.0;  // robust; plain, of those within the gate
    std::size_t sightings = 0;        // within the gate
  };
  Normal normal_at(const Sim3& a_from_b, const std::vector<std::uint32_t>& chosen) const;
  double cost_at(const Sim3& a_from_b, const std::vector<std::uint32_t>& chosen) const;
  Sim3 descended(Sim3 a_from_b, const std::vector<std::uint32_t>& chosen, int steps) const;
  int freedom() const { return problem_.freedom == Freedom::rigid ? 6 : 7; }

  const AlignmentProblem& problem_;
  const AlignmentOptions& options_;
  std::vector<CameraInSide> cameras_a_, cameras_b_;
};

// Geman-McClure: errors far beyond the gate have no pull.
constexpr double kKernel = 2.0 * kGate;
double robust_cost(double square) { return std::isfinite(square) ? kKernel * square / (kKernel + square) : kKernel; }
double robust_weight(double square) { return (kKernel / (kKernel + square)) * (kKernel / (kKernel + square)); }

Sim3 moved(const Sim3& a_from_b, const Vector7& motion) {
  const double angle = motion.segment<3>(3).norm();
  Pose3 b_from_moved;
  b_from_moved.t = motion.head<3>();
  if (angle > 0.0) b_from_moved.q = Eigen::AngleAxisd(angle, motion.segment<3>(3) / angle);
  return compose(a_from_b, Sim3{b_from_moved, std::exp(motion(6))});
}

Search::Sampling Search::sampling() const {
  Sampling both, of_a, of_b;
  for (std::uint32_t i = 0; i < problem_.pairs.size(); ++i) {
    const FeaturePair& pair = problem_.pairs[i];
    if (pair.point_in_a && pair.point_in_b) both.from.push_back(i);
    if (pair.point_in_a && pair.camera_b == 0) of_a.from.push_back(i);
    if (pair.point_in_b && pair.camera_a == 0) of_b.from.push_back(i);
  }
  if (problem_.freedom == Freedom::similarity) return both;
  of_a.solver = Solver::rays_of_b;
  of_b.solver = Solver::rays_of_a;
  // Rays do not suffer from the depths of the sampled side.
  const Sampling& rays = of_a.from.size() >= of_b.from.size() ? of_a : of_b;
  return rays.from.size() > kSampleSize ? rays : both;
}

void Search::solve_rays(Solver solver, const std::array<std::uint32_t, kSampleSize>& sample,
                        std::vector<Sim3>& poses) const {
  const bool seen_by_b = solver == Solver::rays_of_b;
  const CameraPlace& place = seen_by_b ? problem_.cameras_b[0] : problem_.cameras_a[0];
  std::array<Vector3d, 3> rays, points;
  for (std::size_t i = 0; i < kSampleSize; ++i) {
    const FeaturePair& pair = problem_.pairs[sample[i]];
    rays[i] = place.pinhole.ray(seen_by_b ? pair.pixel_b : pair.pixel_a).normalized();
    points[i] = seen_by_b ? *pair.point_in_a : *pair.point_in_b;
  }
  for (const Pose3& camera_from_other : poses_from_three_points(rays, points)) {
    const Pose3 side_from_other = compose(place.side_from_camera, camera_from_other);
    poses.push_back({seen_by_b ? mapweave::inverse(side_from_other) : side_from_other, 1.0});
  }
}

void Search::solve(const Sampling& sampling, const std::array<std::uint32_t, kSampleSize>& sample,
                   std::vector<Sim3>& poses) const {
  poses.clear();
  if (sampling.solver != Solver::points) return solve_rays(sampling.solver, sample, poses);
  std::vector<PointPair> pairs;
  for (const std::uint32_t i : sample)
    pairs.push_back({*problem_.pairs[i].point_in_a, *problem_.pairs[i].point_in_b, 1.0});
  if (const auto aligned = align_points(pairs, problem_.freedom)) poses.push_back(*aligned);
}

std::optional<AlignmentFit> Search::by_sampling() const {
  const Sampling from = sampling();
  const auto least = static_cast<std::size_t>(options_.least_inliers);
  if (from.from.size() < kSampleSize || problem_.pairs.size() < least) return std::nullopt;
  Support best;
  Sim3 best_pose;
  std::vector<Sim3> poses;
  int needed = options_.iterations, iteration = 0;
  for (; iteration < needed; ++iteration) {
    CountedRandom random(options_.seed, static_cast<std::uint64_t>(iteration));
    std::array<std::uint32_t, kSampleSize> sample{};
    for (std::size_t i = 0; i < kSampleSize; ++i) {
      do sample[i] = from.from[random.below(from.from.size())];
      while (std::find(sample.begin(), sample.begin() + static_cast<std::ptrdiff_t>(i), sample[i]) !=
             sample.begin() + static_cast<std::ptrdiff_t>(i));
    }
    solve(from, sample, poses);
    for (const Sim3& pose : poses) {
      Support support = support_of(pose);
      if (support.score <= best.score) continue;
      // Three noisy points make a crude pose: improved by those that agree with it (Chum, Matas, Kittler: Locally
      // optimized RANSAC, 2003).
      best = std::move(support);
      best_pose = pose;
      if (best.inliers.size() >= 2 * kSampleSize) {
        const Sim3 better = descended(pose, best.inliers, 3);
        Support improved = support_of(better);
        if (improved.score > best.score) {
          best = std::move(improved);
          best_pose = better;
        }
      }
      const double share = static_cast<double>(best.inliers.size()) / static_cast<double>(problem_.pairs.size());
      const double clean = std::pow(share, static_cast<double>(kSampleSize));
      if (clean >= 1.0) needed = std::min(needed, iteration + 1);
      if (clean > 0.0 && clean < 1.0)
        needed = std::min(
            needed,
            std::max(iteration + 1, static_cast<int>(std::min(
                                        1e9, std::ceil(std::log(1.0 - options_.confidence) / std::log(1.0 - clean))))));
    }
  }
  if (best.inliers.size() < least) return std::nullopt;
  auto fit = refined(best_pose);
  if (fit) fit->iterations = iteration;
  return fit;
}

Search::Normal Search::normal_at(const Sim3& a_from_b, const std::vector<std::uint32_t>& chosen) const {
  Normal normal;
  const Sim3 b_from_a = inverse(a_from_b);
  const Matrix3d turn = a_from_b.scale * a_from_b.pose.q.toRotationMatrix();
  const auto take = [&](double square, const Vector2d& error, const Eigen::Matrix<double, 2, 7>& slope) {
    normal.cost += robust_cost(square);
    if (!std::isfinite(square)) return;
    if (square < kGate) {
      normal.square += square;
      ++normal.sightings;
    }
    const Eigen::Matrix<double, 2, 7> weighted = robust_weight(square) * slope;
    normal.information.noalias() += weighted.transpose().lazyProduct(slope);
    normal.gradient.noalias() += weighted.transpose().lazyProduct(error);
  };
  for (const std::uint32_t i : chosen) {
    const FeaturePair& pair = problem_.pairs[i];
    Vector2d error = Vector2d::Zero();
    Eigen::Matrix<double, 2, 3> by_point = Eigen::Matrix<double, 2, 3>::Zero();
    Eigen::Matrix<double, 3, 7> by_motion;  // of a point of b, in b
    by_motion.leftCols<3>().setIdentity();
    if (pair.point_in_b) {
      const Vector3d& p = *pair.point_in_b;
      by_motion.middleCols<3>(3) = -cross_matrix(p);
      by_motion.col(6) = p;
      const double square = sighting_error(cameras_a_[pair.camera_a], transformed(p, a_from_b), pair.pixel_a,
                                           pair.sigma_a_px, &error, &by_point);
      take(square, error, by_point * turn * by_motion);
    }
    if (pair.point_in_a) {
      const Vector3d p = transformed(*pair.point_in_a, b_from_a);
      by_motion.middleCols<3>(3) = -cross_matrix(p);
      by_motion.col(6) = p;
      const double square =
          sighting_error(cameras_b_[pair.camera_b], p, pair.pixel_b, pair.sigma_b_px, &error, &by_point);
      take(square, error, -by_point * by_motion);
    }
  }
  return normal;
}

double Search::cost_at(const Sim3& a_from_b, const std::vector<std::uint32_t>& chosen) const {
  const Sim3 b_from_a = inverse(a_from_b);
  double cost = 0.0;
  for (const std::uint32_t i : chosen) {
    const FeaturePair& pair = problem_.pairs[i];
    if (pair.point_in_b)
      cost += robust_cost(sighting_error(cameras_a_[pair.camera_a], transformed(*pair.point_in_b, a_from_b),
                                         pair.pixel_a, pair.sigma_a_px, nullptr, nullptr));
    if (pair.point_in_a)
      cost += robust_cost(sighting_error(cameras_b_[pair.camera_b], transformed(*pair.point_in_a, b_from_a),
                                         pair.pixel_b, pair.sigma_b_px, nullptr, nullptr));
  }
  return cost;
}

// Gauss-Newton, damped (Levenberg-Marquardt) where a step does not help.
Sim3 Search::descended(Sim3 a_from_b, const std::vector<std::uint32_t>& chosen, int steps) const {
  constexpr double kSettled = 1e-5;  // of the cost: what another step would gain at most
  double damping = 1e-6;
  for (int step = 0; step < steps; ++step) {
    const Normal normal = normal_at(a_from_b, chosen);
    double cost = normal.cost;
    bool better = false;
    for (int attempt = 0; attempt < 5 && !better; ++attempt) {
      Matrix7 damped = normal.information;
      damped.diagonal() += damping * (normal.information.diagonal() + Vector7::Constant(1e-9));
      Vector7 motion = Vector7::Zero();
      motion.head(freedom()) =
          -damped.topLeftCorner(freedom(), freedom()).ldlt().solve(normal.gradient.head(freedom()));
      if (!motion.allFinite() || std::abs(motion(6)) > 1.0) motion.setZero();
      const Sim3 next = moved(a_from_b, motion);
      cost = cost_at(next, chosen);
      better = cost < normal.cost;
      if (better) {
        a_from_b = next;
        damping = std::max(1e-9, damping * 0.1);
      } else {
        damping = std::max(1e-4, damping * 30.0);
      }
    }
    if (!better || normal.cost - cost < kSettled * normal.cost) break;
  }
  return a_from_b;
}

std::optional<AlignmentFit> Search::refined(const Sim3& guess) const {
  const auto least = static_cast<std::size_t>(options_.least_inliers);
  AlignmentFit fit;
  fit.a_from_b = guess;
  fit.inliers = support_of(guess).inliers;
  constexpr int kRounds = 4;  // each fit is made of the inliers of the one before
  for (int round = 0; round < kRounds && fit.inliers.size() >= least; ++round) {
    fit.a_from_b = descended(fit.a_from_b, fit.inliers, options_.refinements);
    std::vector<std::uint32_t> inliers = support_of(fit.a_from_b).inliers;
    const bool settled = inliers == fit.inliers;
    fit.inliers = std::move(inliers);
    if (settled) break;
  }
  if (fit.inliers.size() < least) return std::nullopt;
  const Normal normal = normal_at(fit.a_from_b, fit.inliers);
  const double freedoms = std::max(1.0, 2.0 * static_cast<double>(normal.sightings) - freedom());
  const Eigen::MatrixXd information = normal.information.topLeftCorner(freedom(), freedom());
  // Whether a direction is open must not depend on units: on the matrix with ones along its diagonal.
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  if (!scale.allFinite()) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scale.asDiagonal() * information * scale.asDiagonal());
  constexpr double kOpen = 1e-8;  // of the information: nothing holds that direction
  if (!(solver.eigenvalues()(0) > kOpen)) return std::nullopt;
  fit.rms_sigma = std::sqrt(normal.square / std::max(1.0, 2.0 * static_cast<double>(normal.sightings)));
  const Eigen::MatrixXd inverse_scaled =
      solver.eigenvectors() * solver.eigenvalues().cwiseInverse().asDiagonal() * solver.eigenvectors().transpose();
  fit.covariance.topLeftCorner(freedom(), freedom()) =
      std::max(1.0, normal.square / freedoms) * (scale.asDiagonal() * inverse_scaled * scale.asDiagonal()).eval();
  return fit;
}

}  // namespace

std::optional<AlignmentFit> search_alignment(const AlignmentProblem& problem, const AlignmentOptions& options) {
  return Search(problem, options).by_sampling();
}

std::optional<AlignmentFit> refine_alignment(const AlignmentProblem& problem, const Sim3& a_from_b,
                                             const AlignmentOptions& options) {
  return Search(problem, options).refined(a_from_b);
}

}  // namespace mapweave::matching
