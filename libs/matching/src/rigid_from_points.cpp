#include <mapweave/matching/rigid_from_points.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace mapweave::matching {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// A real root of c3 x^3 + c2 x^2 + c1 x + c0; nullopt where there is none, or no polynomial.
std::optional<double> real_root(double c3, double c2, double c1, double c0) {
  const double size = std::max({std::abs(c3), std::abs(c2), std::abs(c1), std::abs(c0)});
  if (!(size > 0.0) || !std::isfinite(size)) return std::nullopt;
  if (std::abs(c3) < 1e-14 * size) {
    if (std::abs(c2) < 1e-14 * size)
      return std::abs(c1) < 1e-14 * size ? std::nullopt : std::optional<double>(-c0 / c1);
    const double discriminant = c1 * c1 - 4.0 * c2 * c0;
    if (discriminant < 0.0) return std::nullopt;
    return (-c1 + (c1 < 0.0 ? 1.0 : -1.0) * std::sqrt(discriminant)) / (2.0 * c2);
  }
  const double b = c2 / c3, c = c1 / c3, d = c0 / c3;
  const double p = c - b * b / 3.0, q = b * (2.0 * b * b / 27.0 - c / 3.0) + d;
  const double discriminant = q * q / 4.0 + p * p * p / 27.0;
  double root;
  if (discriminant >= 0.0) {
    const double s = -q / 2.0 - std::copysign(std::sqrt(discriminant), q), u = std::cbrt(s);
    root = (u == 0.0 ? 0.0 : u - p / (3.0 * u)) - b / 3.0;
  } else {
    // Of three the one farthest from the others, which is the best conditioned: largest in size before the shift.
    const double angle = std::acos(std::clamp(std::abs(q) / 2.0 / std::sqrt(-p * p * p / 27.0), 0.0, 1.0));
    root = -std::copysign(2.0 * std::sqrt(-p / 3.0) * std::cos(angle / 3.0), q) - b / 3.0;
  }
  for (int i = 0; i < 4; ++i) {
    const double slope = (3.0 * root + 2.0 * b) * root + c;
    if (slope == 0.0) break;
    root -= (((root + b) * root + c) * root + d) / slope;
  }
  return std::isfinite(root) ? std::optional<double>(root) : std::nullopt;
}

Matrix3d adjugate(const Matrix3d& m) {
  Matrix3d result;
  result.row(0) = m.col(1).cross(m.col(2));
  result.row(1) = m.col(2).cross(m.col(0));
  result.row(2) = m.col(0).cross(m.col(1));
  return result;
}

// Distances along the rays, improved by Newton on the three laws of cosines. False where they do not settle.
bool polish(Vector3d& along, const Vector3d& cosine, const Vector3d& side) {
  const auto error = [&](const Vector3d& l) {
    return Vector3d(l(0) * l(0) + l(1) * l(1) - 2.0 * cosine(0) * l(0) * l(1) - side(0),
                    l(0) * l(0) + l(2) * l(2) - 2.0 * cosine(1) * l(0) * l(2) - side(1),
                    l(1) * l(1) + l(2) * l(2) - 2.0 * cosine(2) * l(1) * l(2) - side(2));
  };
  for (int i = 0; i < 5; ++i) {
    Matrix3d slope = Matrix3d::Zero();
    slope(0, 0) = 2.0 * (along(0) - cosine(0) * along(1));
    slope(0, 1) = 2.0 * (along(1) - cosine(0) * along(0));
    slope(1, 0) = 2.0 * (along(0) - cosine(1) * along(2));
    slope(1, 2) = 2.0 * (along(2) - cosine(1) * along(0));
    slope(2, 1) = 2.0 * (along(1) - cosine(2) * along(2));
    slope(2, 2) = 2.0 * (along(2) - cosine(2) * along(1));
    const Vector3d moved = along - slope.partialPivLu().solve(error(along));
    if (!moved.allFinite() || error(moved).squaredNorm() >= error(along).squaredNorm()) break;
    along = moved;
  }
  return along.allFinite() && along.minCoeff() > 0.0 && error(along).cwiseAbs().maxCoeff() < 1e-8 * side.maxCoeff();
}

}  // namespace

std::optional<Sim3> align_points(const std::vector<PointPair>& pairs, Freedom freedom) {
  if (pairs.size() < 3) return std::nullopt;
  double total = 0.0;
  Vector3d mean_a = Vector3d::Zero(), mean_b = Vector3d::Zero();
  for (const PointPair& pair : pairs) {
    total += pair.weight;
    mean_a += pair.weight * pair.in_a;
    mean_b += pair.weight * pair.in_b;
  }
  mean_a /= total;
  mean_b /= total;
  Matrix3d m = Matrix3d::Zero();  // sum of b a^T
  double square_a = 0.0, square_b = 0.0;
  for (const PointPair& pair : pairs) {
    const Vector3d a = pair.in_a - mean_a, b = pair.in_b - mean_b;
    m += pair.weight * b * a.transpose();
    square_a += pair.weight * a.squaredNorm();
    square_b += pair.weight * b.squaredNorm();
  }
  if (!m.allFinite() || !(square_a > 0.0) || !(square_b > 0.0)) return std::nullopt;
  Eigen::Matrix4d n;
  n << m(0, 0) + m(1, 1) + m(2, 2), m(1, 2) - m(2, 1), m(2, 0) - m(0, 2), m(0, 1) - m(1, 0),  //
      m(1, 2) - m(2, 1), m(0, 0) - m(1, 1) - m(2, 2), m(0, 1) + m(1, 0), m(2, 0) + m(0, 2),   //
      m(2, 0) - m(0, 2), m(0, 1) + m(1, 0), m(1, 1) - m(0, 0) - m(2, 2), m(1, 2) + m(2, 1),   //
      m(0, 1) - m(1, 0), m(2, 0) + m(0, 2), m(1, 2) + m(2, 1), m(2, 2) - m(0, 0) - m(1, 1);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(n);
  // Points in a line can turn about it: then the two largest eigenvalues are one.
  constexpr double kLeastGap = 1e-6;
  if (solver.eigenvalues()(3) - solver.eigenvalues()(2) < kLeastGap * std::sqrt(square_a * square_b))
    return std::nullopt;
  const Eigen::Vector4d q = solver.eigenvectors().col(3);
  Sim3 a_from_b;
  a_from_b.pose.q = Eigen::Quaterniond(q(0), q(1), q(2), q(3)).normalized();
  if (freedom == Freedom::similarity) a_from_b.scale = std::sqrt(square_a / square_b);
  a_from_b.pose.t = mean_a - a_from_b.scale * (a_from_b.pose.q * mean_b);
  return a_from_b;
}

std::vector<Pose3> poses_from_three_points(const std::array<Vector3d, 3>& rays, const std::array<Vector3d, 3>& points) {
  std::vector<Pose3> poses;
  const Vector3d p01 = points[0] - points[1], p02 = points[0] - points[2], p12 = points[1] - points[2];
  const Vector3d side(p01.squaredNorm(), p02.squaredNorm(), p12.squaredNorm());  // of 01, 02, 12
  const Vector3d cosine(rays[0].dot(rays[1]), rays[0].dot(rays[2]), rays[1].dot(rays[2]));
  const Vector3d normal = p01.cross(p12);
  constexpr double kFlat = 1e-6;  // of the longest side: three points in a line
  if (!(normal.norm() > kFlat * side.maxCoeff()) || !(cosine.maxCoeff() < 1.0 - 1e-12)) return poses;

  // With l the distances along the rays: l^T M_ij l = side_ij. Two combinations have 0 on the right.
  Matrix3d m01 = Matrix3d::Zero(), m02 = Matrix3d::Zero(), m12 = Matrix3d::Zero();
  m01(0, 0) = m01(1, 1) = 1.0;
  m01(0, 1) = m01(1, 0) = -cosine(0);
  m02(0, 0) = m02(2, 2) = 1.0;
  m02(0, 2) = m02(2, 0) = -cosine(1);
  m12(1, 1) = m12(2, 2) = 1.0;
  m12(1, 2) = m12(2, 1) = -cosine(2);
  const double size = side.maxCoeff();
  const Matrix3d d1 = (m01 * side(2) - m12 * side(0)) / size, d2 = (m02 * side(2) - m12 * side(1)) / size;
  // A combination of the two that is no full conic: two planes through the origin.
  const auto gamma =
      real_root(d2.determinant(), (adjugate(d2) * d1).trace(), (adjugate(d1) * d2).trace(), d1.determinant());
  if (!gamma) return poses;
  const Eigen::SelfAdjointEigenSolver<Matrix3d> planes(Matrix3d(d1 + *gamma * d2));
  const double high = planes.eigenvalues()(2), low = planes.eigenvalues()(0);
  if (!(high > 0.0) || !(low < 0.0)) return poses;
  const double ratio = std::sqrt(-low / high);
  Matrix3d world;
  world << p01, p12, normal;
  const Matrix3d inverse_world = world.inverse();
  for (const double sign : {1.0, -1.0}) {
    // normal_of_plane . l = 0
    const Vector3d plane = planes.eigenvectors().col(2) - sign * ratio * planes.eigenvectors().col(0);
    if (std::abs(plane(0)) < 1e-12) continue;
    const double w1 = -plane(1) / plane(0), w2 = -plane(2) / plane(0);  // l0 = w1 l1 + w2 l2
    const double a = side(2) * (w2 * w2 + 1.0 - 2.0 * cosine(1) * w2) - side(1);
    const double b = 2.0 * side(2) * (w1 * w2 - cosine(1) * w1) + 2.0 * side(1) * cosine(2);
    const double c = side(2) * w1 * w1 - side(1);
    const double discriminant = b * b - 4.0 * a * c;
    if (!(discriminant >= 0.0)) continue;
    const double sum = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));
    for (const double tau : {sum / a, c / sum}) {  // l2 / l1
      if (!std::isfinite(tau) || !(tau > 0.0)) continue;
      const double square = side(2) / (1.0 + tau * (tau - 2.0 * cosine(2)));
      if (!(square > 0.0)) continue;
      Vector3d along(0.0, std::sqrt(square), tau * std::sqrt(square));
      along(0) = w1 * along(1) + w2 * along(2);
      if (!(along(0) > 0.0) || !polish(along, cosine, side)) continue;
      const Vector3d y0 = along(0) * rays[0], y1 = along(1) * rays[1], y2 = along(2) * rays[2];
      Matrix3d camera;
      camera << y0 - y1, y1 - y2, (y0 - y1).cross(y1 - y2);
      Pose3 pose;
      pose.q = Eigen::Quaterniond(Matrix3d(camera * inverse_world)).normalized();
      pose.t = y0 - pose.q * points[0];
      poses.push_back(pose);
    }
  }
  return poses;
}

}  // namespace mapweave::matching
