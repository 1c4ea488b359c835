#include "camera_noise.h"

#include "normal_table.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace mapweave::simulation {
namespace {

constexpr int kMostBlurSamples = 16;
constexpr float kLeastBlur = 0.4f;  // pixels: less is not seen

const NormalTable& normal_table() {
  static const NormalTable table;
  return table;
}

// Of normalised points: where p = (x, y) at depth z is seen from another pose.
class Motion {
 public:
  explicit Motion(const Pose3& other_from_camera) {
    const Eigen::Matrix3d rotation = other_from_camera.q.toRotationMatrix();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) r_[row][column] = static_cast<float>(rotation(row, column));
      t_[row] = static_cast<float>(other_from_camera.t[row]);
    }
  }
  void operator()(float x, float y, float inverse_depth, float& other_x, float& other_y) const {
    const float scale = 1.0f / (r_[2][0] * x + r_[2][1] * y + r_[2][2] + t_[2] * inverse_depth);
    other_x = (r_[0][0] * x + r_[0][1] * y + r_[0][2] + t_[0] * inverse_depth) * scale;
    other_y = (r_[1][0] * x + r_[1][1] * y + r_[1][2] + t_[1] * inverse_depth) * scale;
  }

 private:
  float r_[3][3], t_[3];
};

}  // namespace

void blur(RenderedView& view, const CameraModel& camera, const Pose3& world_from_first, const Pose3& world_from_middle,
          const Pose3& world_from_last, std::vector<float>& blurred) {
  // No pixel moves by more than its turn and its shift could, at the nearest depth, in a picture of up to 1 rad beside
  // its axis.
  const Pose3 motion = between(world_from_first, world_from_last);
  const float nearest = *std::max_element(view.inverse_depth.begin(), view.inverse_depth.end());
  const double most =
      camera.intrinsics().fx * (4.0 * motion.q.vec().norm() + 2.0 * motion.t.norm() * static_cast<double>(nearest));
  if (most < static_cast<double>(kLeastBlur)) return;
  const Motion first(between(world_from_first, world_from_middle)), last(between(world_from_last, world_from_middle));
  const float fx = static_cast<float>(camera.intrinsics().fx), fy = static_cast<float>(camera.intrinsics().fy);
  blurred.resize(view.values.size());
  const float last_u = static_cast<float>(view.width - 1), last_v = static_cast<float>(view.height - 1);
  const std::size_t channels = static_cast<std::size_t>(view.channels);
  std::vector<float> du(static_cast<std::size_t>(view.width)), dv(du);
  for (int row = 0; row < view.height; ++row) {
    const float* x = camera.x(row);
    const float* y = camera.y(row);
    const float* inverse_depth = view.inverse_depth.data() + view.at(row, 0);
    for (int column = 0; column < view.width; ++column) {
      float ax, ay, bx, by;
      first(x[column], y[column], inverse_depth[column], ax, ay);
      last(x[column], y[column], inverse_depth[column], bx, by);
      du[static_cast<std::size_t>(column)] = fx * (bx - ax);
      dv[static_cast<std::size_t>(column)] = fy * (by - ay);
    }
    for (int column = 0; column < view.width; ++column) {
      const float motion_u = du[static_cast<std::size_t>(column)], motion_v = dv[static_cast<std::size_t>(column)];
      const float length = std::sqrt(motion_u * motion_u + motion_v * motion_v);
      const float* in = view.values.data() + view.at(row, column) * channels;
      float* out = blurred.data() + view.at(row, column) * channels;
      if (!(length >= kLeastBlur)) {
        std::copy_n(in, channels, out);
        continue;
      }
      // Between two columns and two rows where the path is short; the nearest pixels are as good along a longer one.
      const int samples = std::clamp(static_cast<int>(length + 1.5f), 2, kMostBlurSamples);
      const float step = 1.0f / static_cast<float>(samples);
      float sum[3] = {0.0f, 0.0f, 0.0f};
      for (int i = 0; i < samples; ++i) {
        const float t = (static_cast<float>(i) + 0.5f) * step - 0.5f;
        const float u = std::clamp(static_cast<float>(column) + t * motion_u, 0.0f, last_u - 0.001f);
        const float v = std::clamp(static_cast<float>(row) + t * motion_v, 0.0f, last_v - 0.001f);
        if (samples > 4) {
          const float* pixel =
              view.values.data() + view.at(static_cast<int>(v + 0.5f), static_cast<int>(u + 0.5f)) * channels;
          for (std::size_t c = 0; c < channels; ++c) sum[c] += pixel[c];
          continue;
        }
        const int u0 = static_cast<int>(u), v0 = static_cast<int>(v);
        const float fu = u - static_cast<float>(u0), fv = v - static_cast<float>(v0);
        const float* above = view.values.data() + view.at(v0, u0) * channels;
        const float* below = above + static_cast<std::size_t>(view.stride) * channels;
        for (std::size_t c = 0; c < channels; ++c) {
          const float top = above[c] + fu * (above[c + channels] - above[c]);
          const float bottom = below[c] + fu * (below[c + channels] - below[c]);
          sum[c] += top + fv * (bottom - top);
        }
      }
      for (std::size_t c = 0; c < channels; ++c) out[c] = sum[c] * step;
    }
  }
  view.values.swap(blurred);
}

void light_up(RenderedView& view, const CameraModel& camera, const Pose3& world_from_camera,
              const LightOptions& light) {
  if (light.lamps <= 0.0) return;
  const Eigen::Matrix3d rotation = world_from_camera.q.toRotationMatrix();
  const std::size_t channels = static_cast<std::size_t>(view.channels);
  for (int row = 0; row < view.height; ++row) {
    for (int column = 0; column < view.width; ++column) {
      const std::size_t at = view.at(row, column);
      if (view.surface[at] < 0) continue;
      const Eigen::Vector3d ray(camera.x(row)[column], camera.y(row)[column], 1.0);
      const Eigen::Vector3d point = world_from_camera.t + rotation * ray * view.depth(row, column);
      const auto share = static_cast<float>(light.share_at(point));
      for (std::size_t c = 0; c < channels; ++c) view.values[at * channels + c] *= share;
    }
  }
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

Picture expose(const RenderedView& view, const std::vector<float>& vignette, double gain, double noise,
               const RandomStream& numbers, std::uint64_t frame) {
  Picture picture;
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
    if (sigma > 0.0f)
      normal_table().fill(numbers.at(frame * 8192 + static_cast<std::uint64_t>(row)), grain.data(), count);
    for (int i = 0; i < count; ++i) {
      const float value = in[i] * share[i / view.channels] * factor + grain[static_cast<std::size_t>(i)] * sigma;
      out[i] = static_cast<std::uint8_t>(std::clamp(value, 0.0f, 255.0f) + 0.5f);
    }
  }
  return picture;
}

void measure_depth(const RenderedView& view, const CameraModel& camera, const DepthNoiseOptions& options,
                   const RandomStream& numbers, std::uint64_t frame, std::vector<std::uint16_t>& depth) {
  const std::size_t width = static_cast<std::size_t>(view.width);
  depth.assign(width * static_cast<std::size_t>(view.height), 0);
  const float a = static_cast<float>(options.noise_m), b = static_cast<float>(options.noise_per_m2),
              step = static_cast<float>(options.step_per_m2);
  const float nearest = static_cast<float>(options.min_range_m), farthest = static_cast<float>(options.max_range_m);
  const float shadow = static_cast<float>(camera.intrinsics().fx * options.shadow_m);
  const float least_cosine = static_cast<float>(std::cos(options.grazing_deg * (M_PI / 180.0)));
  const std::uint64_t least_luck = static_cast<std::uint64_t>(options.dropouts * 65536.0);

  std::vector<float> inverse_steepness;  // of each surface: 1 / |inverse depth's gradient|
  for (const RenderedView::Shown& surface : view.surfaces)
    inverse_steepness.push_back(1.0f / surface.inverse_depth.norm());

  // Rows of white noise, of which 3 x 3 are averaged.
  std::array<std::vector<float>, 3> white;
  for (auto& row : white) row.resize(width + 2);
  const auto draw_row = [&](int row) {
    normal_table().fill(numbers.at(frame * 8192 + static_cast<std::uint64_t>(row + 1)),
                        white[static_cast<std::size_t>(row + 1) % 3].data(), view.width + 2);
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
    float lit_from =
        std::numeric_limits<float>::infinity();  // the projector's column of what is lit, from right to left
    for (int column = view.width - 1; column >= 0; --column) {
      if (column % 4 == 3 || column == view.width - 1) bits = luck.bits();
      const std::uint64_t draw = bits & 65535;
      bits >>= 16;
      if (shown[column] < 0) continue;
      const float projected = static_cast<float>(column) - shadow * inverse[column];
      const bool is_lit = projected <= lit_from + 0.5f;
      lit_from = std::min(lit_from, projected);
      if (!is_lit || draw < least_luck) continue;
      const float x = camera.x(row)[column], y = camera.y(row)[column];
      const float cosine = inverse[column] * inverse_steepness[static_cast<std::size_t>(shown[column])] /
                           std::sqrt(x * x + y * y + 1.0f);
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
