#include "camera_noise.h"

#include "normal_table.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace mapweave::simulation {
namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;

constexpr int kMostBlurSamples = 16;
constexpr float kLeastBlur = 0.4f;  // pixels: less is not seen

const NormalTable& normal_table() {
  static const NormalTable table;
  return table;
}

struct Motion {  // of normalised points: other = rotation p + translation / z
  Matrix3f rotation;
  Vector3f translation;
  Motion(const Pose3& other_from_camera)
      : rotation(other_from_camera.q.toRotationMatrix().cast<float>()), translation(other_from_camera.t.cast<float>()) {}
};

}  // namespace

void blur(View& view, const CameraModel& camera, const Pose3& world_from_first, const Pose3& world_from_middle,
          const Pose3& world_from_last, std::vector<float>& blurred) {
  // No pixel moves by more than its turn and its shift could, at the nearest depth, in a picture of up to 1 rad beside its axis.
  const Pose3 way = between(world_from_first, world_from_last);
  const float nearest = *std::max_element(view.inverse_depth.begin(), view.inverse_depth.end());
  const double most = camera.intrinsics().fx * (4.0 * way.q.vec().norm() + 2.0 * way.t.norm() * static_cast<double>(nearest));
  if (most < static_cast<double>(kLeastBlur)) return;
  const Motion first(between(world_from_first, world_from_middle)), last(between(world_from_last, world_from_middle));
  const float fx = static_cast<float>(camera.intrinsics().fx), fy = static_cast<float>(camera.intrinsics().fy);
  blurred.resize(view.values.size());
  for (int row = 0; row < view.height; ++row) {
    const std::size_t line = view.at(row, 0);
    for (int column = 0; column < view.width; ++column) {
      const std::size_t at = line + static_cast<std::size_t>(column);
      const Vector3f p(camera.x(row)[column], camera.y(row)[column], 1.0f);
      const float inverse_depth = view.inverse_depth[at];
      const Vector3f a = first.rotation * p + first.translation * inverse_depth, b = last.rotation * p + last.translation * inverse_depth;
      const float du = fx * (b.x() / b.z() - a.x() / a.z()), dv = fy * (b.y() / b.z() - a.y() / a.z());
      const float length = std::sqrt(du * du + dv * dv);
      float* out = blurred.data() + at * static_cast<std::size_t>(view.channels);
      const float* in = view.values.data();
      if (!(length >= kLeastBlur)) {
        std::copy_n(in + at * static_cast<std::size_t>(view.channels), view.channels, out);
        continue;
      }
      const int samples = std::clamp(static_cast<int>(length + 1.5f), 2, kMostBlurSamples);
      std::array<float, 3> sum{};
      for (int i = 0; i < samples; ++i) {
        const float t = (static_cast<float>(i) + 0.5f) / static_cast<float>(samples) - 0.5f;
        const float u = std::clamp(static_cast<float>(column) + t * du, 0.0f, static_cast<float>(view.width - 1) - 0.001f);
        const float v = std::clamp(static_cast<float>(row) + t * dv, 0.0f, static_cast<float>(view.height - 1) - 0.001f);
        const int u0 = static_cast<int>(u), v0 = static_cast<int>(v);
        const float fu = u - static_cast<float>(u0), fv = v - static_cast<float>(v0);
        const float* above = in + view.at(v0, u0) * static_cast<std::size_t>(view.channels);
        const float* below = above + static_cast<std::size_t>(view.stride) * static_cast<std::size_t>(view.channels);
        for (int c = 0; c < view.channels; ++c) {
          const float top = above[c] + fu * (above[c + view.channels] - above[c]);
          const float bottom = below[c] + fu * (below[c + view.channels] - below[c]);
          sum[static_cast<std::size_t>(c)] += top + fv * (bottom - top);
        }
      }
      for (int c = 0; c < view.channels; ++c) out[c] = sum[static_cast<std::size_t>(c)] / static_cast<float>(samples);
    }
  }
  view.values.swap(blurred);
}

std::vector<float> vignette(const CameraIntrinsics& camera, double vignetting) {
  std::vector<float> shares;
  const double cx = 0.5 * (camera.width - 1), cy = 0.5 * (camera.height - 1), corner = cx * cx + cy * cy;
  for (int row = 0; row < camera.height; ++row) {
    for (int column = 0; column < camera.width; ++column) {
      const double square = (column - cx) * (column - cx) + (row - cy) * (row - cy);
      shares.push_back(static_cast<float>(1.0 - vignetting * square / corner));
    }
  }
  return shares;
}

void expose(const View& view, const std::vector<float>& vignette, double gain, double noise, const RandomStream& numbers,
            std::uint64_t frame, Picture& picture) {
  picture.width = view.width;
  picture.height = view.height;
  picture.channels = view.channels;
  const int count = view.width * view.channels;
  picture.values.resize(static_cast<std::size_t>(count) * static_cast<std::size_t>(view.height));
  std::vector<float> grain(static_cast<std::size_t>(count));
  const float factor = static_cast<float>(gain), sigma = static_cast<float>(noise);
  for (int row = 0; row < view.height; ++row) {
    const float* in = view.values.data() + view.at(row, 0) * static_cast<std::size_t>(view.channels);
    const float* share = vignette.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(view.width);
    std::uint8_t* out = picture.values.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(count);
    if (sigma > 0.0f) normal_table().fill(numbers.at(frame * 8192 + static_cast<std::uint64_t>(row)), grain.data(), count);
    for (int i = 0; i < count; ++i) {
      const float value = in[i] * share[i / view.channels] * factor + grain[static_cast<std::size_t>(i)] * sigma;
      out[i] = static_cast<std::uint8_t>(std::clamp(value, 0.0f, 255.0f) + 0.5f);
    }
  }
}

void measure_depth(const View& view, const CameraModel& camera, const DepthNoiseOptions& options, const RandomStream& numbers,
                   std::uint64_t frame, std::vector<std::uint16_t>& depth) {
  const std::size_t width = static_cast<std::size_t>(view.width);
  depth.assign(width * static_cast<std::size_t>(view.height), 0);
  const float a = static_cast<float>(options.noise_m), b = static_cast<float>(options.noise_per_m2),
              step = static_cast<float>(options.step_per_m2);
  const float nearest = static_cast<float>(options.min_range_m), farthest = static_cast<float>(options.max_range_m);
  const float shadow = static_cast<float>(camera.intrinsics().fx * options.shadow_m);
  const float least_cosine = static_cast<float>(std::cos(options.grazing_deg * (M_PI / 180.0)));
  const std::uint64_t least_luck = static_cast<std::uint64_t>(options.dropouts * 65536.0);

  // Rows of white noise, of which 3 x 3 are averaged.
  std::array<std::vector<float>, 3> white;
  for (auto& row : white) row.resize(width + 2);
  const auto draw_row = [&](int row) {
    normal_table().fill(numbers.at(frame * 8192 + static_cast<std::uint64_t>(row + 1)), white[static_cast<std::size_t>(row + 1) % 3].data(),
                        view.width + 2);
  };
  std::vector<float> sums(width + 2);
  draw_row(-1);
  draw_row(0);
  for (int row = 0; row < view.height; ++row) {
    draw_row(row + 1);
    for (std::size_t i = 0; i < width + 2; ++i) sums[i] = white[0][i] + white[1][i] + white[2][i];
    RandomNumbers luck = numbers.at(frame * 8192 + 4096 + static_cast<std::uint64_t>(row));
    std::uint64_t bits = 0;
    const float* inverse = view.inverse_depth.data() + view.at(row, 0);
    const std::int32_t* shown = view.surface.data() + view.at(row, 0);
    std::uint16_t* out = depth.data() + static_cast<std::size_t>(row) * width;
    float lit_from = std::numeric_limits<float>::infinity();  // the projector's column of what is lit, from right to left
    for (int column = view.width - 1; column >= 0; --column) {
      if (column % 4 == 3 || column == view.width - 1) bits = luck.bits();
      const std::uint64_t draw = bits & 65535;
      bits >>= 16;
      if (shown[column] < 0) continue;
      const float projected = static_cast<float>(column) - shadow * inverse[column];
      const bool is_lit = projected <= lit_from + 0.5f;
      lit_from = std::min(lit_from, projected);
      if (!is_lit || draw < least_luck) continue;
      const Vector3f p(camera.x(row)[column], camera.y(row)[column], 1.0f);
      const Vector3f& plane = view.surfaces[static_cast<std::size_t>(shown[column])].inverse_depth;
      const float cosine = inverse[column] / std::sqrt(plane.squaredNorm() * p.squaredNorm());
      if (cosine < least_cosine) continue;
      const float true_z = 1.0f / inverse[column];
      const std::size_t i = static_cast<std::size_t>(column);
      float z = true_z + (a + b * true_z * true_z) * (sums[i] + sums[i + 1] + sums[i + 2]) * (1.0f / 3.0f);
      if (!(z >= nearest && z <= farthest)) continue;
      if (step > 0.0f) z = 1.0f / (step * static_cast<float>(std::max(1, static_cast<int>(1.0f / (step * z) + 0.5f))));
      out[column] = static_cast<std::uint16_t>(std::min(z * static_cast<float>(1.0 / kDepthUnit) + 0.5f, 65535.0f));
    }
  }
}

}  // namespace mapweave::simulation
