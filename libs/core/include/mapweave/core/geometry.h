#pragma once
// Poses as plain values, without caches: safe to share between threads. A pose is named target_from_source, and inner
// names meet when poses are composed. Metres, radians; frames as REP-103/105 (x forward, z up).

#include <mrpt/math/TPose2D.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

namespace mapweave {

using Pose2 = mrpt::math::TPose2D;  // x, y, phi

// Into [-pi, pi).
inline double wrap_angle(double angle_rad) {
  return angle_rad - 2.0 * M_PI * std::floor((angle_rad + M_PI) / (2.0 * M_PI));
}

// a_from_c = compose(a_from_b, b_from_c): MRPT's a + b, inline, with phi wrapped.
inline Pose2 compose(const Pose2& a_from_b, const Pose2& b_from_c) {
  const double c = std::cos(a_from_b.phi), s = std::sin(a_from_b.phi);
  return {a_from_b.x + c * b_from_c.x - s * b_from_c.y, a_from_b.y + s * b_from_c.x + c * b_from_c.y,
          wrap_angle(a_from_b.phi + b_from_c.phi)};
}
inline Pose2 inverse(const Pose2& a_from_b) {
  const double c = std::cos(a_from_b.phi), s = std::sin(a_from_b.phi);
  return {-c * a_from_b.x - s * a_from_b.y, s * a_from_b.x - c * a_from_b.y, wrap_angle(-a_from_b.phi)};
}
// b_from_c, of a_from_b and a_from_c: where c is seen from b.
inline Pose2 between(const Pose2& a_from_b, const Pose2& a_from_c) { return compose(inverse(a_from_b), a_from_c); }

struct Pose3 {
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();  // unit
};
inline Pose3 compose(const Pose3& a_from_b, const Pose3& b_from_c) {
  return {a_from_b.t + a_from_b.q * b_from_c.t, (a_from_b.q * b_from_c.q).normalized()};
}
inline Pose3 inverse(const Pose3& a_from_b) {
  const Eigen::Quaterniond q = a_from_b.q.conjugate();
  return {-(q * a_from_b.t), q};
}
inline Pose3 between(const Pose3& a_from_b, const Pose3& a_from_c) { return compose(inverse(a_from_b), a_from_c); }
inline Eigen::Vector3d transformed(const Eigen::Vector3d& point_in_b, const Pose3& a_from_b) {
  return a_from_b.q * point_in_b + a_from_b.t;
}

// Similarity: point_in_a = scale * (q * point_in_b) + t.
struct Sim3 {
  Pose3 pose;
  double scale = 1.0;
};
inline Eigen::Vector3d transformed(const Eigen::Vector3d& point_in_b, const Sim3& a_from_b) {
  return a_from_b.scale * (a_from_b.pose.q * point_in_b) + a_from_b.pose.t;
}
inline Sim3 compose(const Sim3& a_from_b, const Sim3& b_from_c) {
  return {{transformed(b_from_c.pose.t, a_from_b), (a_from_b.pose.q * b_from_c.pose.q).normalized()},
          a_from_b.scale * b_from_c.scale};
}
inline Sim3 inverse(const Sim3& a_from_b) {
  const double scale = 1.0 / a_from_b.scale;
  const Eigen::Quaterniond q = a_from_b.pose.q.conjugate();
  return {{-scale * (q * a_from_b.pose.t), q}, scale};
}
// A pose of frame b in frame a: the position is scaled, turned and moved, the orientation turned.
inline Pose3 transformed(const Pose3& b_from_c, const Sim3& a_from_b) {
  return {transformed(b_from_c.t, a_from_b), (a_from_b.pose.q * b_from_c.q).normalized()};
}

// Planar poses in space, and what a pose in space shows when looked at from above (yaw of the x axis).
Pose3 spatial(const Pose2&);
Pose2 planar(const Pose3&);
// The same for 6 x 6 covariances and informations in order (x, y, z, roll, pitch, yaw): rows and columns of x, y and
// yaw, all others zero.
inline constexpr int kPlanarAxes[3] = {0, 1, 5};
Eigen::Matrix<double, 6, 6> spatial(const Eigen::Matrix3d&);
Eigen::Matrix3d planar(const Eigen::Matrix<double, 6, 6>&);
bool is_planar(const Pose3&);  // at height 0, turned about z alone
bool is_finite(const Pose2&);
bool is_finite(const Pose3&);

}  // namespace mapweave
