#include "patch.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

namespace mapweave::visual {

std::optional<Patch> cut_patch(const Pyramid& pyramid, const Eigen::Vector2d& pixel, int level) {
  const GreyImage& image = pyramid[level];
  const double x = at_level(pixel.x(), level), y = at_level(pixel.y(), level);
  const int ix = static_cast<int>(std::lround(x)), iy = static_cast<int>(std::lround(y));
  if (ix < kPatchHalf || iy < kPatchHalf || ix >= image.width - kPatchHalf || iy >= image.height - kPatchHalf)
    return std::nullopt;
  Patch patch;
  patch.level = level;
  patch.offset = {static_cast<float>(x - ix), static_cast<float>(y - iy)};
  for (int row = 0; row < kPatchSize; ++row)
    std::copy_n(image.row(iy - kPatchHalf + row) + ix - kPatchHalf, kPatchSize,
                patch.pixels.begin() + row * kPatchSize);
  return patch;
}

std::optional<WarpedPatch> warp_patch(const Patch& patch, const Eigen::Matrix2d& new_from_patch) {
  const double area = std::abs(new_from_patch.determinant());
  if (!(area > 1e-3 && area < 1e3)) return std::nullopt;
  // The level at which a pixel of the new view covers about as much as one of the patch.
  int level = patch.level;
  double covered = area;
  while (covered > 2.0 && level + 1 < kLevels) {
    covered /= 4.0;
    ++level;
  }
  while (covered < 0.5 && level > 0) {
    covered *= 4.0;
    --level;
  }
  const Eigen::Matrix2f step = (new_from_patch.inverse() * std::ldexp(1.0, level - patch.level)).cast<float>();
  WarpedPatch result;
  result.level = level;
  constexpr float kReach = kAlignHalf + 0.5F, kLimit = kPatchHalf - 1.01F;
  if ((step.cwiseAbs() * Eigen::Vector2f(kReach + 1, kReach + 1) + patch.offset.cwiseAbs()).maxCoeff() > kLimit)
    return std::nullopt;
  float* out = result.values.data();
  for (int y = 0; y < kAlignSize + 2; ++y) {
    for (int x = 0; x < kAlignSize + 2; ++x) {
      const Eigen::Vector2f from_middle =
          step * Eigen::Vector2f(static_cast<float>(x) - kReach, static_cast<float>(y) - kReach) + patch.offset;
      const float px = from_middle.x() + kPatchHalf, py = from_middle.y() + kPatchHalf;
      const int ix = static_cast<int>(px), iy = static_cast<int>(py);
      const float fx = px - static_cast<float>(ix), fy = py - static_cast<float>(iy);
      const std::uint8_t* p = patch.pixels.data() + iy * kPatchSize + ix;
      const std::uint8_t* q = p + kPatchSize;
      const float upper = static_cast<float>(p[0]) + fx * static_cast<float>(p[1] - p[0]);
      const float lower = static_cast<float>(q[0]) + fx * static_cast<float>(q[1] - q[0]);
      *out++ = upper + fy * (lower - upper);
    }
  }
  return result;
}

std::optional<PatchMatch> align_patch(const WarpedPatch& patch, const GreyImage& image, const Eigen::Vector2d& start,
                                      float reach) {
  constexpr int kStride = kAlignSize + 2, kCount = kAlignSize * kAlignSize;
  std::array<float, kCount> gx, gy, reference;
  Eigen::Matrix3f hessian = Eigen::Matrix3f::Zero();
  float mean = 0;
  for (int y = 0, i = 0; y < kAlignSize; ++y) {
    const float* p = patch.values.data() + (y + 1) * kStride + 1;
    for (int x = 0; x < kAlignSize; ++x, ++i) {
      const auto n = static_cast<std::size_t>(i);
      gx[n] = 0.5F * (p[x + 1] - p[x - 1]);
      gy[n] = 0.5F * (p[x + kStride] - p[x - kStride]);
      reference[n] = p[x];
      mean += p[x];
    }
  }
  mean /= kCount;
  float xx = 0, xy = 0, yy = 0, sx = 0, sy = 0, variance = 0;
  for (std::size_t i = 0; i < kCount; ++i) {
    xx += gx[i] * gx[i];
    xy += gx[i] * gy[i];
    yy += gy[i] * gy[i];
    sx += gx[i];
    sy += gy[i];
    variance += (reference[i] - mean) * (reference[i] - mean);
  }
  hessian << xx, xy, sx, xy, yy, sy, sx, sy, static_cast<float>(kCount);
  if (hessian.determinant() < 1e-3F || variance < 1.0F) return std::nullopt;
  const Eigen::Matrix3f inverse = hessian.inverse();

  const float start_x = static_cast<float>(at_level(start.x(), patch.level)),
              start_y = static_cast<float>(at_level(start.y(), patch.level));
  float x = start_x, y = start_y, bias = 0;
  std::array<float, kCount> current;
  constexpr int kMostSteps = 12;  // of Gauss-Newton: bounds time; it ends before once it settles
  bool at_rest = false;
  for (int step = 0; step < kMostSteps; ++step) {
    const float left = x - (kAlignHalf - 0.5F), top = y - (kAlignHalf - 0.5F);
    if (!(left >= 0 && top >= 0 && left + kAlignSize < static_cast<float>(image.width) &&
          top + kAlignSize < static_cast<float>(image.height)))
      return std::nullopt;
    const int ix = static_cast<int>(left), iy = static_cast<int>(top);
    const float fx = left - static_cast<float>(ix), fy = top - static_cast<float>(iy);
    const float w00 = (1 - fx) * (1 - fy), w01 = fx * (1 - fy), w10 = (1 - fx) * fy, w11 = fx * fy;
    float bx = 0, by = 0, b = 0;
    for (int row = 0, i = 0; row < kAlignSize; ++row) {
      const std::uint8_t* p = image.row(iy + row) + ix;
      const std::uint8_t* q = p + image.width;
      for (int column = 0; column < kAlignSize; ++column, ++i) {
        const auto n = static_cast<std::size_t>(i);
        current[n] = w00 * p[column] + w01 * p[column + 1] + w10 * q[column] + w11 * q[column + 1];
        const float residual = current[n] - reference[n] + bias;
        bx += residual * gx[n];
        by += residual * gy[n];
        b += residual;
      }
    }
    const Eigen::Vector3f change = inverse * Eigen::Vector3f(bx, by, b);
    if (at_rest) break;  // `current` is of the place of rest
    x -= change.x();
    y -= change.y();
    bias -= change.z();
    if (!(std::abs(x - start_x) <= reach && std::abs(y - start_y) <= reach)) return std::nullopt;
    at_rest = change.x() * change.x() + change.y() * change.y() < 0.0009F;
  }
  if (!at_rest) return std::nullopt;
  float current_mean = 0;
  for (float value : current) current_mean += value;
  current_mean /= kCount;
  float cross = 0, current_variance = 0;
  for (std::size_t i = 0; i < kCount; ++i) {
    cross += (reference[i] - mean) * (current[i] - current_mean);
    current_variance += (current[i] - current_mean) * (current[i] - current_mean);
  }
  if (current_variance < 1.0F) return std::nullopt;
  return PatchMatch{{from_level(static_cast<double>(x), patch.level), from_level(static_cast<double>(y), patch.level)},
                    cross / std::sqrt(variance * current_variance)};
}

WarpedPatch plain_patch(const Patch& patch) { return *warp_patch(patch, Eigen::Matrix2d::Identity()); }

std::optional<double> find_disparity(const Patch& patch, const Eigen::Vector2d& left, const Pyramid& right, double low,
                                     double high) {
  constexpr int kStride = kAlignSize + 2, kCount = kAlignSize * kAlignSize;
  const WarpedPatch plain = plain_patch(patch);
  const GreyImage& image = right[patch.level];
  std::array<float, kCount> reference;
  float mean = 0, variance = 0;
  for (int y = 0, i = 0; y < kAlignSize; ++y)
    for (int x = 0; x < kAlignSize; ++x, ++i)
      mean += reference[static_cast<std::size_t>(i)] =
          plain.values[static_cast<std::size_t>((y + 1) * kStride + x + 1)];
  mean /= kCount;
  for (float& value : reference) {
    value -= mean;
    variance += value * value;
  }
  if (variance < 1.0F) return std::nullopt;
  const double x = at_level(left.x(), patch.level), y = at_level(left.y(), patch.level);
  const int top = static_cast<int>(std::lround(y - (kAlignHalf - 0.5)));
  const double scale = 1.0 / (1 << patch.level);
  const int first = std::max(0, static_cast<int>(std::floor(x - high * scale - (kAlignHalf - 0.5))));
  const int last =
      std::min(image.width - kAlignSize - 1, static_cast<int>(std::ceil(x - low * scale - (kAlignHalf - 0.5))));
  if (top < 0 || top + kAlignSize > image.height || last < first) return std::nullopt;
  // All columns at once, row by row of the patch: sums, sums of squares, and products with the patch.
  const Eigen::Index count = last - first + 1, wide = count + kAlignSize - 1;
  Eigen::ArrayXf strip(wide), sum = Eigen::ArrayXf::Zero(count), squares = Eigen::ArrayXf::Zero(count),
                              cross = Eigen::ArrayXf::Zero(count);
  Eigen::ArrayXf column_sum = Eigen::ArrayXf::Zero(wide), column_squares = Eigen::ArrayXf::Zero(wide);
  for (int row = 0, i = 0; row < kAlignSize; ++row) {
    strip = Eigen::Map<const Eigen::Array<std::uint8_t, Eigen::Dynamic, 1>>(image.row(top + row) + first, wide)
                .cast<float>();
    column_sum += strip;
    column_squares += strip.square();
    for (int u = 0; u < kAlignSize; ++u, ++i) cross += reference[static_cast<std::size_t>(i)] * strip.segment(u, count);
  }
  for (int u = 0; u < kAlignSize; ++u) {
    sum += column_sum.segment(u, count);
    squares += column_squares.segment(u, count);
  }
  std::vector<float> scores;
  for (Eigen::Index i = 0; i < count; ++i) {
    const float here = squares[i] - sum[i] * sum[i] / kCount;
    scores.push_back(here < 1.0F ? -1.0F : cross[i] / std::sqrt(here * variance));
  }
  const auto best = static_cast<int>(std::max_element(scores.begin(), scores.end()) - scores.begin());
  if (scores[static_cast<std::size_t>(best)] < 0.7F) return std::nullopt;
  for (int i = 0; i < static_cast<int>(scores.size()); ++i)
    if (std::abs(i - best) > 3 && scores[static_cast<std::size_t>(i)] > 0.95F * scores[static_cast<std::size_t>(best)])
      return std::nullopt;
  const Eigen::Vector2d start(from_level(first + best + kAlignHalf - 0.5, patch.level), left.y());
  const auto match = align_patch(plain, image, start, 2.0F);
  if (!match || match->correlation < 0.8F || std::abs(match->pixel.y() - left.y()) > 1.5 * (1 << patch.level))
    return std::nullopt;
  const double disparity = left.x() - match->pixel.x();
  if (disparity < low || disparity > high) return std::nullopt;
  return disparity;
}

}  // namespace mapweave::visual
