#include "two_views.h"

#include "geometry/bundle_sighting.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>

namespace mapweave::visual {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix9 = Eigen::Matrix<double, 9, 9>;
using Vector9 = Eigen::Matrix<double, 9, 1>;

struct RayPair {
  Vector3d first, second;  // z = 1
  double sigma = 0.0;      // on the plane z = 1
};

struct Model {
  Matrix3d matrix = Matrix3d::Zero();
  double score = -1.0;
};

Vector9 least_vector(const Matrix9& moments) {
  return Eigen::SelfAdjointEigenSolver<Matrix9>(moments).eigenvectors().col(0);
}
Matrix3d by_rows(const Vector9& v) { return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(v.data()); }

// Moves and scales points on z = 1 to their middle and to a spread of sqrt(2) (Hartley, PAMI 19(6), 1997).
Matrix3d levelling(const std::vector<RayPair>& pairs, const std::vector<std::size_t>& chosen, Vector3d RayPair::*side) {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (std::size_t i : chosen) middle += (pairs[i].*side).head<2>();
  middle /= static_cast<double>(chosen.size());
  double spread = 0.0;
  for (std::size_t i : chosen) spread += ((pairs[i].*side).head<2>() - middle).norm();
  const double scale = M_SQRT2 * static_cast<double>(chosen.size()) / std::max(spread, 1e-9);
  Matrix3d result;
  result << scale, 0, -scale * middle.x(), 0, scale, -scale * middle.y(), 0, 0, 1;
  return result;
}

Matrix3d essential_of(const std::vector<RayPair>& pairs, const std::vector<std::size_t>& chosen) {
  const Matrix3d a = levelling(pairs, chosen, &RayPair::first), b = levelling(pairs, chosen, &RayPair::second);
  Matrix9 moments = Matrix9::Zero();
  for (std::size_t i : chosen) {
    const Vector3d x = a * pairs[i].first, y = b * pairs[i].second;
    Vector9 row;
    row << y.x() * x, y.y() * x, y.z() * x;
    moments += row * row.transpose();
  }
  const Eigen::JacobiSVD<Matrix3d> svd(b.transpose() * by_rows(least_vector(moments)) * a,
                                       Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * Vector3d(1, 1, 0).asDiagonal() * svd.matrixV().transpose();
}

Matrix3d homography_of(const std::vector<RayPair>& pairs, const std::vector<std::size_t>& chosen) {
  const Matrix3d a = levelling(pairs, chosen, &RayPair::first), b = levelling(pairs, chosen, &RayPair::second);
  Matrix9 moments = Matrix9::Zero();
  for (std::size_t i : chosen) {
    const Vector3d x = a * pairs[i].first, y = b * pairs[i].second;
    Vector9 u, v;
    u << x, Vector3d::Zero(), -y.x() * x;
    v << Vector3d::Zero(), x, -y.y() * x;
    moments += u * u.transpose() + v * v.transpose();
  }
  return b.inverse() * by_rows(least_vector(moments)) * a;
}

// Squared distance of each to where the model says the other shows it, in sigmas: to a line, or to a point.
double essential_error(const Matrix3d& e, const RayPair& pair) {
  const Vector3d line = e * pair.first, back = e.transpose() * pair.second;
  const double product = pair.second.dot(line);
  return product * product / (line.head<2>().squaredNorm() + back.head<2>().squaredNorm()) / (pair.sigma * pair.sigma);
}
double homography_error(const Matrix3d& h, const Matrix3d& back, const RayPair& pair) {
  const Vector3d there = h * pair.first, here = back * pair.second;
  if (!(std::abs(there.z()) > 1e-9 && std::abs(here.z()) > 1e-9)) return 1e9;
  const double forth = (there.head<2>() / there.z() - pair.second.head<2>()).squaredNorm();
  return std::max(forth, (here.head<2>() / here.z() - pair.first.head<2>()).squaredNorm()) /
         (2.0 * pair.sigma * pair.sigma);
}

template <class Fit, class Error>
Model best_model(const std::vector<RayPair>& pairs, std::size_t sample_size, const TwoViewOptions& options, Fit&& fit,
                 Error&& error) {
  std::mt19937_64 random(options.seed);
  const double gate = options.gate_sigmas * options.gate_sigmas;
  Model best;
  const auto judge = [&](const std::vector<std::size_t>& sample) {
    const Matrix3d matrix = fit(pairs, sample);
    if (!matrix.allFinite()) return;
    const auto error_of = error(matrix);
    double score = 0.0;
    for (const RayPair& pair : pairs) score += std::max(0.0, gate - error_of(pair));
    if (score > best.score) best = {matrix, score};
  };
  std::vector<std::size_t> order(pairs.size()), sample(sample_size);
  std::iota(order.begin(), order.end(), std::size_t{0});
  for (int iteration = 0; iteration < options.iterations; ++iteration) {
    for (std::size_t i = 0; i < sample_size; ++i) std::swap(order[i], order[i + random() % (order.size() - i)]);
    std::copy_n(order.begin(), sample_size, sample.begin());
    judge(sample);
  }
  for (int round = 0; round < 3; ++round) {  // of all that agree
    const auto error_of = error(best.matrix);
    std::vector<std::size_t> agreeing;
    for (std::size_t i = 0; i < pairs.size(); ++i)
      if (error_of(pairs[i]) < gate) agreeing.push_back(i);
    if (agreeing.size() >= sample_size) judge(agreeing);
  }
  return best;
}

// Where the rays meet, if that is what both pictures show.
std::optional<Vector3d> agreed_point(const RayPair& pair, const View& motion, double gate_sigmas) {
  const auto point = meet(pair.first, pair.second, motion);
  if (!point) return std::nullopt;
  const Vector3d there = motion * *point;
  const double error = std::max((there.head<2>() / there.z() - pair.second.head<2>()).squaredNorm(),
                                (point->head<2>() / point->z() - pair.first.head<2>()).squaredNorm());
  if (!(error < gate_sigmas * gate_sigmas * pair.sigma * pair.sigma)) return std::nullopt;
  return point;
}

// Points from the pairs, then both made better together.
TwoViews settled(const std::vector<PixelPair>& pairs, const std::vector<RayPair>& rays, const Pinhole& camera,
                 View motion, const TwoViewOptions& options) {
  TwoViews result;
  for (double wider : {4.0, 1.5}) {
    graph::Bundle bundle;
    bundle.cameras.push_back(camera);
    bundle.views = {{View(), 0, true}, {motion, 0, false}};
    std::vector<std::size_t> pair_of_point;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const auto point = agreed_point(rays[i], motion, wider * options.gate_sigmas);
      if (!point) continue;
      const std::array<Eigen::Vector2d, 2> pixels{pairs[i].first, pairs[i].second};
      for (int side = 0; side < 2; ++side) {
        Sighting seen;
        seen.pixel = pixels[static_cast<std::size_t>(side)];
        seen.sigma_px = pairs[i].sigma_px;
        bundle.sightings.push_back(bundle_sighting(side, bundle.points.size(), seen));
      }
      bundle.points.push_back(*point);
      pair_of_point.push_back(i);
    }
    graph::BundleOptions adjusting = bundle_options(10);
    adjusting.gate_sigmas = options.gate_sigmas;
    graph::adjust(bundle, adjusting);
    const double length = bundle.views[1].view.translation.norm();
    if (!(length > 1e-9)) break;
    motion = bundle.views[1].view;
    motion.translation /= length;
    result = TwoViews();
    result.second_from_first = motion;
    result.points.assign(pairs.size(), Vector3d::Zero()), result.fits.assign(pairs.size(), 0);
    std::vector<double> angles;
    const Vector3d centre = motion.centre();
    for (std::size_t p = 0; p < bundle.points.size(); ++p) {
      const Vector3d point = bundle.points[p] / length;
      if (!bundle.sightings[2 * p].fits || !bundle.sightings[2 * p + 1].fits) continue;
      result.points[pair_of_point[p]] = point, result.fits[pair_of_point[p]] = 1;
      ++result.count;
      angles.push_back(std::atan2(point.cross(point - centre).norm(), point.dot(point - centre)));
    }
    if (angles.empty()) break;
    const auto middle = angles.begin() + static_cast<std::ptrdiff_t>(angles.size() / 2);
    std::nth_element(angles.begin(), middle, angles.end());
    result.parallax_rad = *middle;
  }
  return result;
}

int count_in_front(const std::vector<RayPair>& rays, const View& motion, const TwoViewOptions& options) {
  return static_cast<int>(std::count_if(rays.begin(), rays.end(), [&](const RayPair& pair) {
    return agreed_point(pair, motion, options.gate_sigmas).has_value();
  }));
}

bool is_alike(const View& a, const View& b) {
  constexpr double kTurn_rad = 0.03, kDirection = 0.97;  // within which two motions are one
  return Eigen::AngleAxisd(a.rotation.transpose() * b.rotation).angle() < kTurn_rad &&
         a.translation.dot(b.translation) > kDirection;
}

}  // namespace

std::optional<Vector3d> meet(const Vector3d& ray_in_first, const Vector3d& ray_in_second,
                             const View& second_from_first) {
  const Vector3d a = ray_in_second.cross(second_from_first.rotation * ray_in_first),
                 b = ray_in_second.cross(second_from_first.translation);
  // a + inverse_depth * b = 0: well determined by both ends only where neither is near to nothing.
  const double inverse_depth = -a.dot(b) / b.squaredNorm();
  if (!(inverse_depth > 1e-6 && std::isfinite(inverse_depth))) return std::nullopt;
  const Vector3d point = ray_in_first / (inverse_depth * ray_in_first.z());
  if (!((second_from_first * point).z() > 0.0)) return std::nullopt;
  return point;
}

std::vector<View> motions_of_essential(const Matrix3d& essential) {
  const Eigen::JacobiSVD<Matrix3d> svd(essential, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3d u = svd.matrixU(), v = svd.matrixV(), w;
  if (u.determinant() < 0) u = -u;
  if (v.determinant() < 0) v = -v;
  w << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  const Matrix3d one = u * w * v.transpose(), other = u * w.transpose() * v.transpose();
  const Vector3d t = u.col(2);
  return {{one, t}, {one, -t}, {other, t}, {other, -t}};
}

std::vector<View> motions_of_homography(const Matrix3d& homography) {
  const Eigen::SelfAdjointEigenSolver<Matrix3d> raw(homography.transpose() * homography);
  const double middle = std::sqrt(std::max(raw.eigenvalues()[1], 1e-30));
  const Matrix3d h = homography / (homography.determinant() < 0 ? -middle : middle);
  const double greatest = raw.eigenvalues()[2] / (middle * middle), least = raw.eigenvalues()[0] / (middle * middle);
  constexpr double kRotationAlone = 1e-8;  // between squared singular values: they are equal, so nothing moved
  if (greatest - least < kRotationAlone || greatest < 1.0 || least > 1.0) return {};
  Vector3d v1 = raw.eigenvectors().col(2), v2 = raw.eigenvectors().col(1), v3 = raw.eigenvectors().col(0);
  if (v1.cross(v2).dot(v3) < 0) v3 = -v3;
  std::vector<View> result;
  for (double sign : {1.0, -1.0}) {
    const Vector3d in_plane =
        (std::sqrt(1.0 - least) * v1 + sign * std::sqrt(greatest - 1.0) * v3) / std::sqrt(greatest - least);
    Matrix3d before, after;
    const Vector3d normal = v2.cross(in_plane);
    before << v2, in_plane, normal;
    after << h * v2, h * in_plane, (h * v2).cross(h * in_plane);
    const Matrix3d rotation = after * before.transpose();
    const Vector3d t = (h - rotation) * normal;
    if (!(t.norm() > 1e-9)) continue;
    result.push_back({rotation, t.normalized()});
    result.push_back({rotation, -t.normalized()});
  }
  return result;
}

namespace {

std::vector<RayPair> rays_of(const std::vector<PixelPair>& pairs, const Pinhole& camera) {
  std::vector<RayPair> rays;
  for (const PixelPair& pair : pairs)
    rays.push_back({camera.ray(pair.first), camera.ray(pair.second), pair.sigma_px / std::sqrt(camera.fx * camera.fy)});
  return rays;
}

}  // namespace

std::vector<View> propose_motions(const std::vector<PixelPair>& pairs, const Pinhole& camera,
                                  const TwoViewOptions& options) {
  constexpr std::size_t kEssential = 8, kHomography = 4;
  if (pairs.size() < kEssential) return {};
  const std::vector<RayPair> rays = rays_of(pairs, camera);
  const Model essential = best_model(rays, kEssential, options, essential_of, [](const Matrix3d& e) {
    return [e](const RayPair& pair) { return essential_error(e, pair); };
  });
  const Model homography = best_model(rays, kHomography, options, homography_of, [](const Matrix3d& h) {
    return [h, back = Matrix3d(h.inverse())](const RayPair& pair) { return homography_error(h, back, pair); };
  });
  std::vector<View> proposed;
  if (essential.score > 0.0) proposed = motions_of_essential(essential.matrix);
  if (homography.score > 0.0)
    for (const View& motion : motions_of_homography(homography.matrix)) proposed.push_back(motion);
  return proposed;
}

std::optional<TwoViews> best_motion(const std::vector<PixelPair>& pairs, const Pinhole& camera,
                                    const std::vector<View>& proposed, const TwoViewOptions& options) {
  const std::vector<RayPair> rays = rays_of(pairs, camera);
  std::vector<int> counts;
  for (const View& motion : proposed) counts.push_back(count_in_front(rays, motion, options));

  // A poor start may lead to a good end: half as good as the best is good enough to be tried.
  const int most = counts.empty() ? 0 : *std::max_element(counts.begin(), counts.end());
  std::vector<TwoViews> ends;
  for (std::size_t i = 0; i < proposed.size(); ++i)
    if (2 * counts[i] >= most && counts[i] > 0) ends.push_back(settled(pairs, rays, camera, proposed[i], options));
  const auto best = std::max_element(ends.begin(), ends.end(),
                                     [](const TwoViews& a, const TwoViews& b) { return a.count < b.count; });
  if (best == ends.end() || best->count < options.least_pairs ||
      best->count < options.least_share * static_cast<double>(pairs.size()) ||
      best->parallax_rad < options.least_parallax_rad)
    return std::nullopt;
  for (const TwoViews& other : ends)
    if (other.count > options.distinct * best->count && !is_alike(other.second_from_first, best->second_from_first))
      return std::nullopt;
  return std::move(*best);
}

std::optional<TwoViews> relate_views(const std::vector<PixelPair>& pairs, const Pinhole& camera,
                                     const TwoViewOptions& options) {
  if (pairs.size() < static_cast<std::size_t>(options.least_pairs)) return std::nullopt;
  return best_motion(pairs, camera, propose_motions(pairs, camera, options), options);
}

}  // namespace mapweave::visual
