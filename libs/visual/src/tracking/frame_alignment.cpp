#include "frame_alignment.h"

#include <Eigen/Cholesky>
#include <cmath>

namespace mapweave::visual {
namespace {

constexpr float kSoft = 8.0F;  // grey values
constexpr int kCoarsest = 4;   // level
constexpr int kSide = 4, kPixels = kSide * kSide, kMostSteps = 10;
using Vector8f = Eigen::Matrix<float, 8, 1>;

struct Kept {
  Eigen::Vector3d point;
  std::array<float, kPixels> values;
  std::array<Vector8f, kPixels> jacobian;  // of the picture by (motion of the camera, gain, bias)
  Eigen::Matrix<float, 8, 8> hessian;      // of all its pixels
};

std::vector<Kept> keep(const GreyImage& image, int level, const ShownPoints& shown, const Pinhole& camera) {
  std::vector<Kept> result;
  result.reserve(shown.points.size());
  const double scale = 1.0 / (1 << level);
  for (std::size_t i = 0; i < shown.points.size(); ++i) {
    const float x = static_cast<float>(at_level(shown.pixels[i].x(), level)) - (kSide / 2 - 0.5F);
    const float y = static_cast<float>(at_level(shown.pixels[i].y(), level)) - (kSide / 2 - 0.5F);
    if (!(x >= 1 && y >= 1 && x + kSide + 1 < static_cast<float>(image.width) &&
          y + kSide + 1 < static_cast<float>(image.height)))
      continue;
    const Eigen::Vector3d& p = shown.points[i];
    const double z = 1.0 / p.z(), z2 = z * z, fx = camera.fx * scale, fy = camera.fy * scale;
    Eigen::Matrix<float, 2, 6> by_motion;
    by_motion << static_cast<float>(fx * z), 0, static_cast<float>(-fx * p.x() * z2),
        static_cast<float>(-fx * p.x() * p.y() * z2), static_cast<float>(fx * (1 + p.x() * p.x() * z2)),
        static_cast<float>(-fx * p.y() * z), 0, static_cast<float>(fy * z), static_cast<float>(-fy * p.y() * z2),
        static_cast<float>(-fy * (1 + p.y() * p.y() * z2)), static_cast<float>(fy * p.x() * p.y() * z2),
        static_cast<float>(fy * p.x() * z);
    Kept kept;
    kept.point = p;
    std::array<float, (kSide + 2) * (kSide + 2)> around;
    for (int v = 0; v < kSide + 2; ++v)
      for (int u = 0; u < kSide + 2; ++u)
        around[static_cast<std::size_t>(v * (kSide + 2) + u)] =
            sample(image, x + static_cast<float>(u - 1), y + static_cast<float>(v - 1));
    for (int v = 0; v < kSide; ++v)
      for (int u = 0; u < kSide; ++u) {
        const auto n = static_cast<std::size_t>(v * kSide + u),
                   m = static_cast<std::size_t>((v + 1) * (kSide + 2) + u + 1);
        const float gx = 0.5F * (around[m + 1] - around[m - 1]),
                    gy = 0.5F * (around[m + kSide + 2] - around[m - kSide - 2]);
        kept.values[n] = around[m];
        kept.jacobian[n].head<6>() = gx * by_motion.row(0).transpose() + gy * by_motion.row(1).transpose();
        kept.jacobian[n][6] = (kept.values[n] - 128.0F) / 64.0F;
        kept.jacobian[n][7] = 1.0F;
      }
    kept.hessian.setZero();
    for (const Vector8f& j : kept.jacobian) kept.hessian.noalias() += j * j.transpose();
    result.push_back(kept);
  }
  return result;
}

}  // namespace

FrameAlignment align_frames(const Pyramid& from, const ShownPoints& shown, const Pyramid& to, const Pinhole& camera,
                            const View& guess, int finest) {
  FrameAlignment result;
  result.to_from_from = guess;
  float gain = 0, bias = 0;  // to = from + gain * (from - 128) / 64 + bias
  for (int level = kCoarsest; level >= finest; --level) {
    const GreyImage& image = to[level];
    const std::vector<Kept> kept = keep(from[level], level, shown, camera);
    View best = result.to_from_from;
    float best_error = std::numeric_limits<float>::max();
    View view = result.to_from_from;
    for (int step = 0; step < kMostSteps; ++step) {
      Eigen::Matrix<float, 8, 8> hessian = Eigen::Matrix<float, 8, 8>::Zero();
      Vector8f gradient = Vector8f::Zero();
      float error = 0, weights = 0;
      int used = 0;
      for (const Kept& k : kept) {
        const Eigen::Vector3d p = view * k.point;
        if (p.z() < kNearestAligned_m) continue;
        const Eigen::Vector2d pixel = camera.project(p);
        const float x = static_cast<float>(at_level(pixel.x(), level)) - (kSide / 2 - 0.5F);
        const float y = static_cast<float>(at_level(pixel.y(), level)) - (kSide / 2 - 0.5F);
        if (!(x >= 0 && y >= 0 && x + kSide < static_cast<float>(image.width) &&
              y + kSide < static_cast<float>(image.height)))
          continue;
        ++used;
        const int ix = static_cast<int>(x), iy = static_cast<int>(y);
        const float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
        const float w00 = (1 - fx) * (1 - fy), w01 = fx * (1 - fy), w10 = (1 - fx) * fy, w11 = fx * fy;
        std::array<float, kPixels> residuals;
        float square = 0;
        for (int v = 0, i = 0; v < kSide; ++v) {
          const std::uint8_t* a = image.row(iy + v) + ix;
          const std::uint8_t* b = a + image.width;
          for (int u = 0; u < kSide; ++u, ++i) {
            const auto n = static_cast<std::size_t>(i);
            const float now = w00 * a[u] + w01 * a[u + 1] + w10 * b[u] + w11 * b[u + 1];
            residuals[n] = now - k.values[n] - gain * k.jacobian[n][6] - bias;
            square += residuals[n] * residuals[n];
          }
        }
        // One weight for the patch: what covers or glares does so together.
        const float size = std::sqrt(square / kPixels);
        const float weight = size < kSoft ? 1.0F : kSoft / size;
        Vector8f sum = Vector8f::Zero();
        for (std::size_t n = 0; n < kPixels; ++n) sum += residuals[n] * k.jacobian[n];
        gradient += weight * sum;
        hessian += weight * k.hessian;
        error += weight * square;
        weights += static_cast<float>(kPixels);
      }
      if (used < 8) break;
      error /= weights;
      if (error > best_error) break;  // the step before made it worse
      best_error = error;
      best = view;
      result.points = used;
      result.residual = std::sqrt(error);
      // The gradient is of the reference: the picture moves against it; gain and bias were subtracted.
      Eigen::Matrix<float, 8, 8> full = hessian;
      full.diagonal() *= 1.0F + 1e-4F;
      full.diagonal().array() += 1e-3F;
      const Vector8f change = full.ldlt().solve(gradient);
      if (!change.allFinite()) break;
      // Inverse compositional: to_from_from <- to_from_from * exp(-motion).
      Eigen::Matrix<double, 6, 1> motion = -change.head<6>().cast<double>();
      const View small = moved(View(), motion);
      view = view * small;
      gain += change[6];
      bias += change[7];
      if (motion.head<3>().norm() < 1e-4 && motion.tail<3>().norm() < 1e-4) {
        best = view;
        break;
      }
    }
    result.to_from_from = best;
  }
  return result;
}

}  // namespace mapweave::visual
