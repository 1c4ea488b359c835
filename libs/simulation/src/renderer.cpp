#include <mapweave/simulation/renderer.h>

#include <mapweave/core/error.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace mapweave::simulation {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kNear = 0.02;      // metres: nothing is seen nearer
constexpr double kEdgeOn = 1e-4;    // metres: a surface whose plane passes so near to the camera has no width
constexpr float kRim = 1e-6f;       // normalised: neighbours overlap by this, so that no gap shows between them
constexpr float kFarthest = 60.0f;  // metres: texture coordinates are held here, within what samples can tell
constexpr int kRun = 16;            // pixels that share a texture level
constexpr int kTileWidth = CameraModel::kTileWidth, kTileHeight = CameraModel::kTileHeight;
constexpr float kAhead = 16384.0f;  // added to texel coordinates: a multiple of all sizes that keeps them positive

// A surface in the camera's frame, for p = (x, y, 1): inside where all edges . p >= -kRim; 1/z = inverse_depth . p;
// texel coordinates u . p / (inverse_depth . p) + first_u.
struct Prepared {
  std::int32_t number;
  int edge_count = 0;
  std::array<Vector3f, kMostCorners> edges;
  Vector3f inverse_depth, u, v;
  float first_u, first_v, first_detail_u, first_detail_v,
      detail_scale;  // the last: detail texels in one of the texture
  float nearest;     // greatest 1/z
  CameraModel::Bounds bounds;
  const SurfaceTexture* look;
};

float wrapped(double texels, int size) { return static_cast<float>(texels - size * std::floor(texels / size)); }

class Rasteriser {
 public:
  Rasteriser(const Scene& scene, const CameraModel& camera, const Pose3& world_from_camera)
      : scene_(scene),
        camera_(camera),
        eye_(world_from_camera.t),
        camera_from_world_(world_from_camera.q.conjugate()) {}

  void add(const Surface& surface, std::int32_t number) {
    const double distance = surface.normal.dot(surface.point - eye_);
    if (std::abs(distance) < kEdgeOn) return;
    Prepared prepared;
    prepared.inverse_depth = (camera_from_world_ * surface.normal / distance).cast<float>();
    if (!cut_out(surface, prepared)) return;
    const CameraModel::Bounds& view = camera_.bounds();
    if (prepared.bounds.low_x > view.high_x || prepared.bounds.high_x < view.low_x ||
        prepared.bounds.low_y > view.high_y || prepared.bounds.high_y < view.low_y)
      return;
    prepared.number = number;
    prepared.look = &surface.look;
    const Texture& texture = scene_.texture(surface.look.texture);
    prepared.u = (camera_from_world_ * surface.look.u).cast<float>();
    prepared.v = (camera_from_world_ * surface.look.v).cast<float>();
    const double first_u = surface.look.u.dot(eye_) + surface.look.first_u,
                 first_v = surface.look.v.dot(eye_) + surface.look.first_v;
    prepared.first_u = kAhead + wrapped(first_u, texture.width());
    prepared.first_v = kAhead + wrapped(first_v, texture.height());
    const double detail_scale = 1.0 / (Scene::kDetailTexel * surface.look.u.norm());
    prepared.detail_scale = static_cast<float>(detail_scale);
    prepared.first_detail_u = kAhead + wrapped(first_u * detail_scale, scene_.detail().width());
    prepared.first_detail_v = kAhead + wrapped(first_v * detail_scale, scene_.detail().height());
    surfaces_.push_back(prepared);
  }

  void sort() {  // the nearest first, so that the rest is mostly hidden
    std::sort(surfaces_.begin(), surfaces_.end(), [](const Prepared& a, const Prepared& b) {
      return a.nearest != b.nearest ? a.nearest > b.nearest : a.number < b.number;
    });
  }

  void draw(RenderedView& view) const {
    const int columns = camera_.stride() / kTileWidth, rows = camera_.padded_rows() / kTileHeight;
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column)
        draw_tile(row, column, camera_.tiles()[static_cast<std::size_t>(row * columns + column)], view);
    }
    view.surfaces.clear();
    for (const Prepared& surface : surfaces_) view.surfaces.push_back({surface.number, surface.inverse_depth});
  }

  const std::vector<Prepared>& surfaces() const { return surfaces_; }

 private:
  // Edges, bounds and nearest point; false where nothing of it is before the camera.
  bool cut_out(const Surface& surface, Prepared& prepared) const {
    const float infinite = std::numeric_limits<float>::infinity();
    if (surface.corners.empty()) {
      prepared.bounds = {-infinite, infinite, -infinite, infinite};
      prepared.nearest = -1.0f;  // after all others; the tiles see how near it comes
      return true;
    }
    const std::size_t count = surface.corners.size();
    std::array<Vector3d, kMostCorners> corners;
    Vector3d middle = Vector3d::Zero();
    for (std::size_t i = 0; i < count; ++i) {
      corners[i] = camera_from_world_ * (surface.corners[i] - eye_);
      middle += corners[i];
    }
    prepared.bounds = {infinite, -infinite, infinite, -infinite};
    double nearest = 0.0;
    const auto include = [&](const Vector3d& p) {
      const float x = static_cast<float>(p.x() / p.z()), y = static_cast<float>(p.y() / p.z());
      CameraModel::Bounds& b = prepared.bounds;
      b = {std::min(b.low_x, x), std::max(b.high_x, x), std::min(b.low_y, y), std::max(b.high_y, y)};
      nearest = std::max(nearest, 1.0 / p.z());
    };
    for (std::size_t i = 0; i < count; ++i) {  // what is before the plane z = kNear
      const Vector3d &a = corners[i], &b = corners[(i + 1) % count];
      if (a.z() >= kNear) include(a);
      if ((a.z() >= kNear) != (b.z() >= kNear)) include(a + (kNear - a.z()) / (b.z() - a.z()) * (b - a));
    }
    if (nearest == 0.0) return false;
    prepared.nearest = static_cast<float>(nearest);
    prepared.edge_count = static_cast<int>(count);
    for (std::size_t i = 0; i < count; ++i) {
      Vector3d edge = corners[i].cross(corners[(i + 1) % count]);
      const double length = edge.norm();
      edge = length > 1e-12 ? Vector3d(edge / length) : Vector3d::Zero();
      prepared.edges[i] = (edge.dot(middle) < 0.0 ? Vector3d(-edge) : edge).cast<float>();
    }
    return true;
  }

  void draw_tile(int tile_row, int tile_column, const CameraModel::Bounds& tile, RenderedView& view) const {
    alignas(64) float nearest[kTileHeight][kTileWidth] = {};
    alignas(64) std::int32_t shown[kTileHeight][kTileWidth];
    for (auto& row : shown) std::fill(std::begin(row), std::end(row), -1);
    float farthest = 0.0f;  // least 1/z in the tile
    for (std::size_t i = 0; i < surfaces_.size(); ++i) {
      const Prepared& s = surfaces_[i];
      if (s.bounds.low_x > tile.high_x || s.bounds.high_x < tile.low_x || s.bounds.low_y > tile.high_y ||
          s.bounds.high_y < tile.low_y)
        continue;
      if (s.edge_count > 0 && s.nearest <= farthest) continue;
      bool is_out = false;  // all of the tile beyond one edge
      for (int e = 0; e < s.edge_count && !is_out; ++e) {
        const Vector3f& edge = s.edges[static_cast<std::size_t>(e)];
        const float x = edge.x() > 0.0f ? tile.high_x : tile.low_x, y = edge.y() > 0.0f ? tile.high_y : tile.low_y;
        is_out = edge.x() * x + edge.y() * y + edge.z() < -kRim;
      }
      if (is_out) continue;
      draw_in_tile(s, static_cast<std::int32_t>(i), tile_row * kTileHeight, tile_column * kTileWidth, nearest, shown);
      farthest = nearest[0][0];
      for (const auto& row : nearest) {
        for (const float value : row) farthest = std::min(farthest, value);
      }
    }
    for (int row = 0; row < kTileHeight; ++row) {
      const std::size_t at = view.at(tile_row * kTileHeight + row, tile_column * kTileWidth);
      std::copy(std::begin(nearest[row]), std::end(nearest[row]),
                view.inverse_depth.begin() + static_cast<std::ptrdiff_t>(at));
      std::copy(std::begin(shown[row]), std::end(shown[row]), view.surface.begin() + static_cast<std::ptrdiff_t>(at));
    }
  }

  void draw_in_tile(const Prepared& s, std::int32_t number, int top, int left,
                    float (&nearest)[kTileHeight][kTileWidth], std::int32_t (&shown)[kTileHeight][kTileWidth]) const {
    for (int row = 0; row < kTileHeight; ++row) {
      const float* x = camera_.x(top + row) + left;
      const float* y = camera_.y(top + row) + left;
      alignas(64) float inside[kTileWidth];
      std::fill(std::begin(inside), std::end(inside), 0.0f);
      for (int e = 0; e < s.edge_count; ++e) {
        const Vector3f& edge = s.edges[static_cast<std::size_t>(e)];
        const float a = edge.x(), b = edge.y(), c = edge.z();
        for (int i = 0; i < kTileWidth; ++i) inside[i] = std::min(inside[i], a * x[i] + b * y[i] + c);
      }
      const float a = s.inverse_depth.x(), b = s.inverse_depth.y(), c = s.inverse_depth.z();
      for (int i = 0; i < kTileWidth; ++i) {
        const float inverse_depth = a * x[i] + b * y[i] + c;
        const bool is_shown = (inside[i] >= -kRim) & (inverse_depth > nearest[row][i]);
        nearest[row][i] = is_shown ? inverse_depth : nearest[row][i];
        shown[row][i] = is_shown ? number : shown[row][i];
      }
    }
  }

  const Scene& scene_;
  const CameraModel& camera_;
  Vector3d eye_;
  Matrix3d camera_from_world_;
  std::vector<Prepared> surfaces_;
};

// How a surface is sampled about a pixel, with everything at hand.
class Sampler {
 public:
  Sampler(const Scene& scene, const Prepared& s, float x, float y, float pixel_x, float pixel_y)
      : inverse_depth_(s.inverse_depth), u_(s.u), v_(s.v), first_u_(s.first_u), first_v_(s.first_v) {
    const float z = depth(x, y);
    const float u = (u_.x() * x + u_.y() * y + u_.z()) * z, v = (v_.x() * x + v_.y() * y + v_.z()) * z;
    const float ux = (u_.x() - u * inverse_depth_.x()) * z * pixel_x,
                vx = (v_.x() - v * inverse_depth_.x()) * z * pixel_x;
    const float uy = (u_.y() - u * inverse_depth_.y()) * z * pixel_y,
                vy = (v_.y() - v * inverse_depth_.y()) * z * pixel_y;
    const float across = std::sqrt(ux * ux + vx * vx), down = std::sqrt(uy * uy + vy * vy);
    const bool is_across_longer = across > down;
    const float longer = std::max({across, down, 1e-3f}), shorter = std::max(std::min(across, down), 1e-3f);
    samples_ = std::clamp(static_cast<int>(longer / shorter + 0.4f), 1, 4);
    share_ = 1.0f / (256.0f * static_cast<float>(samples_));
    step_u_ = (is_across_longer ? ux : uy) / static_cast<float>(samples_);
    step_v_ = (is_across_longer ? vx : vy) / static_cast<float>(samples_);
    first_u_ -= 0.5f * static_cast<float>(samples_ - 1) * step_u_;
    first_v_ -= 0.5f * static_cast<float>(samples_ - 1) * step_v_;

    const Texture& texture = scene.texture(s.look->texture);
    const int last = texture.levels() - 1;
    const float wanted = std::log2(std::max({shorter, longer / static_cast<float>(samples_), 1.0f}));
    const float level = std::min(wanted, static_cast<float>(last));
    const int whole = static_cast<int>(level);
    level_ = texture.level(whole);
    next_level_ = texture.level(std::min(whole + 1, last));
    mixture_ = static_cast<int>((level - static_cast<float>(whole)) * 256.0f);
    if (mixture_ < kLeastMixture) mixture_ = 0;
    if (mixture_ > 256 - kLeastMixture) {
      level_ = next_level_;
      mixture_ = 0;
    }
    if (!s.look->has_detail) return;
    detail_scale_ = s.detail_scale;
    first_detail_u_ = s.first_detail_u;
    first_detail_v_ = s.first_detail_v;
    const float detail_level = std::log2(std::max(1.0f, longer * s.detail_scale));
    detail_weight_ = std::clamp(0.5f * (3.0f - detail_level), 0.0f, 1.0f) * (1.0f / 256.0f);
    detail_ = scene.detail().level(static_cast<int>(std::min(detail_level, 3.0f)));
  }

  // 0 to 255: where between its two colours the surface is.
  float operator()(float x, float y) const {
    const float z = depth(x, y);
    const float from_u = (u_.x() * x + u_.y() * y + u_.z()) * z, from_v = (v_.x() * x + v_.y() * y + v_.z()) * z;
    float u = from_u + first_u_, v = from_v + first_v_;
    int sum = 0;
    for (int i = 0; i < samples_; ++i, u += step_u_, v += step_v_) {
      const int sample = level_.sample(u, v);
      sum += mixture_ == 0 ? sample : sample + (((next_level_.sample(u, v) - sample) * mixture_) >> 8);
    }
    float value = static_cast<float>(sum) * share_;
    if (detail_weight_ > 0.0f) {
      const int sample =
          detail_.sample(from_u * detail_scale_ + first_detail_u_, from_v * detail_scale_ + first_detail_v_);
      value += detail_weight_ * static_cast<float>(sample - 128 * 256);
    }
    return std::clamp(value, 0.0f, 255.0f);
  }

 private:
  static constexpr int kLeastMixture = 24;  // of 256: less than a tenth of a level does not show
  float depth(float x, float y) const {
    return std::min(1.0f / (inverse_depth_.x() * x + inverse_depth_.y() * y + inverse_depth_.z()), kFarthest);
  }
  Vector3f inverse_depth_, u_, v_;
  float first_u_, first_v_, step_u_, step_v_, share_;
  int samples_, mixture_;
  Texture::Level level_, next_level_, detail_{};
  float detail_scale_ = 0.0f, first_detail_u_ = 0.0f, first_detail_v_ = 0.0f;
  float detail_weight_ = 0.0f;  // fades where a pixel covers 2 mm to 8 mm
};

class Shader {
 public:
  Shader(const Scene& scene, const CameraModel& camera, const std::vector<Prepared>& surfaces)
      : scene_(scene),
        surfaces_(surfaces),
        pixel_x_(static_cast<float>(1.0 / camera.intrinsics().fx)),
        pixel_y_(static_cast<float>(1.0 / camera.intrinsics().fy)) {}

  void shade(const CameraModel& camera, RenderedView& view) const {
    for (int row = 0; row < view.height; ++row) {
      const float* x = camera.x(row);
      const float* y = camera.y(row);
      const std::int32_t* shown = view.surface.data() + view.at(row, 0);
      float* out = view.values.data() + view.at(row, 0) * static_cast<std::size_t>(view.channels);
      for (int from = 0; from < view.width;) {
        int to = from + 1;
        const int most = std::min(view.width, (from / kRun + 1) * kRun);
        while (to < most && shown[to] == shown[from]) ++to;
        if (shown[from] < 0) {
          std::fill(out + from * view.channels, out + to * view.channels, 0.0f);
        } else {
          const Prepared& s = surfaces_[static_cast<std::size_t>(shown[from])];
          const Mixer mix(*s.look, view.channels);
          const int middle = (from + to) / 2;
          const Sampler sample(scene_, s, x[middle], y[middle], pixel_x_, pixel_y_);
          for (int i = from; i < to; ++i) mix(sample(x[i], y[i]), out + i * view.channels);
        }
        from = to;
      }
    }
  }

  // Four samples where a pixel's neighbours show something else.
  void smooth_rims(const CameraModel& camera, RenderedView& view) const {
    for (int row = 0; row < view.height; ++row) {
      const std::int32_t* here = view.surface.data() + view.at(row, 0);
      const std::int32_t* above = view.surface.data() + view.at(std::max(0, row - 1), 0);
      const std::int32_t* below = view.surface.data() + view.at(std::min(view.height - 1, row + 1), 0);
      for (int column = 0; column < view.width; ++column) {
        const int left = std::max(0, column - 1), right = std::min(view.width - 1, column + 1);
        const std::int32_t number = here[column];
        if (number == here[left] && number == here[right] && number == above[column] && number == below[column])
          continue;
        std::array<std::int32_t, 9> around{above[left], above[column], above[right],  here[left],  number,
                                           here[right], below[left],   below[column], below[right]};
        std::sort(around.begin(), around.end());
        const auto end = std::unique(around.begin(), around.end());
        std::array<float, 3> sum{}, sample{};
        for (int i = 0; i < 4; ++i) {
          const float x = camera.x(row)[column] + (i % 2 == 0 ? -0.25f : 0.25f) * pixel_x_;
          const float y = camera.y(row)[column] + (i < 2 ? -0.25f : 0.25f) * pixel_y_;
          const Prepared* nearest = nullptr;
          float greatest = 0.0f;
          for (auto candidate = around.begin(); candidate != end; ++candidate) {
            if (*candidate < 0) continue;
            const Prepared& s = surfaces_[static_cast<std::size_t>(*candidate)];
            const float inverse = s.inverse_depth.x() * x + s.inverse_depth.y() * y + s.inverse_depth.z();
            if (inverse <= greatest) continue;
            bool is_inside = true;
            for (int e = 0; e < s.edge_count && is_inside; ++e) {
              const Vector3f& edge = s.edges[static_cast<std::size_t>(e)];
              is_inside = edge.x() * x + edge.y() * y + edge.z() >= -kRim;
            }
            if (!is_inside) continue;
            nearest = &s;
            greatest = inverse;
          }
          if (nearest == nullptr) continue;
          Mixer(*nearest->look, view.channels)(Sampler(scene_, *nearest, x, y, pixel_x_, pixel_y_)(x, y),
                                               sample.data());
          for (int channel = 0; channel < view.channels; ++channel)
            sum[static_cast<std::size_t>(channel)] += 0.25f * sample[static_cast<std::size_t>(channel)];
        }
        std::copy_n(sum.begin(), view.channels,
                    view.values.begin() +
                        static_cast<std::ptrdiff_t>(view.at(row, column) * static_cast<std::size_t>(view.channels)));
      }
    }
  }

 private:
  // From a value to channels. Grey is the luma of ITU-R BT.601, as OpenCV has it.
  class Mixer {
   public:
    Mixer(const SurfaceTexture& look, int channels) : channels_(channels) {
      const auto grey = [](const Colour& c) { return 0.299f * c.red + 0.587f * c.green + 0.114f * c.blue; };
      const auto set = [&](int channel, float dark, float light) {
        dark_[channel] = 255.0f * dark;
        slope_[channel] = light - dark;
      };
      if (channels == 1) {
        set(0, grey(look.dark), grey(look.light));
      } else {
        set(0, look.dark.red, look.light.red);
        set(1, look.dark.green, look.light.green);
        set(2, look.dark.blue, look.light.blue);
      }
    }
    void operator()(float value, float* out) const {
      for (int channel = 0; channel < channels_; ++channel) out[channel] = dark_[channel] + slope_[channel] * value;
    }

   private:
    int channels_;
    float dark_[3], slope_[3];
  };

  const Scene& scene_;
  const std::vector<Prepared>& surfaces_;
  float pixel_x_, pixel_y_;
};

}  // namespace

void render(const Scene& scene, const std::vector<Surface>& moving, const CameraModel& camera,
            const Pose3& world_from_camera, Channels channels, RenderedView& view) {
  view.width = camera.intrinsics().width;
  view.height = camera.intrinsics().height;
  view.stride = camera.stride();
  view.channels = channels == Channels::none ? 0 : channels == Channels::grey ? 1 : 3;
  const std::size_t pixels = static_cast<std::size_t>(view.stride) * static_cast<std::size_t>(camera.padded_rows());
  view.inverse_depth.resize(pixels);
  view.surface.resize(pixels);
  view.values.resize(pixels * static_cast<std::size_t>(view.channels));

  Rasteriser rasteriser(scene, camera, world_from_camera);
  std::int32_t number = 0;
  for (const Surface& surface : scene.surfaces()) rasteriser.add(surface, number++);
  for (const Surface& surface : moving) rasteriser.add(surface, number++);
  rasteriser.sort();
  rasteriser.draw(view);
  if (channels == Channels::none) return;
  const Shader shader(scene, camera, rasteriser.surfaces());
  shader.shade(camera, view);
  shader.smooth_rims(camera, view);
}

}  // namespace mapweave::simulation
