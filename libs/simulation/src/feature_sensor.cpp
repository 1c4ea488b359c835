#include <mapweave/simulation/feature_sensor.h>

#include <mapweave/core/error.h>
#include <mapweave/core/options.h>

#include <algorithm>
#include <cmath>

namespace mapweave::simulation {
namespace {

using Eigen::Vector3d;

constexpr double kCell = 1.0;             // metres
constexpr double kLeastPixels = 7.0;      // of a landmark on the lowest level
constexpr double kBeforeSurface = 0.015;  // lines of sight end here: pictures hang before walls
constexpr double kLeastCosine = 0.15;     // between a landmark's normal and its ray

// Upright surfaces as walls with heights: the line of sight may pass over or under.
std::vector<Wall> obstacles(const Scene& scene) {
  std::vector<Wall> walls;
  for (const Surface& surface : scene.surfaces()) {
    if (surface.corners.size() != 4 || std::abs(surface.normal.z()) > 0.5) continue;
    const Vector3d &a = surface.corners[0], &b = surface.corners[1], &c = surface.corners[2];
    walls.push_back({{a.x(), a.y()}, {b.x(), b.y()}, -1, -1, std::min(a.z(), c.z()), std::max(a.z(), c.z())});
  }
  return walls;
}

bool is_within(const Surface& surface, const Vector3d& point) {
  int side = 0;
  for (std::size_t i = 0; i < surface.corners.size(); ++i) {
    const Vector3d &a = surface.corners[i], &b = surface.corners[(i + 1) % surface.corners.size()];
    const double across = (b - a).cross(point - a).dot(surface.normal);
    const int sign = across > 0.0 ? 1 : -1;
    if (side != 0 && sign != side) return false;
    side = sign;
  }
  return true;
}

}  // namespace

Descriptor descriptor_of(const SimulatedLandmark& landmark) {
  RandomNumbers numbers(landmark.look);
  Descriptor descriptor;
  for (std::uint64_t& word : descriptor) word = numbers.bits();
  return descriptor;
}

// Landmarks belong to places on textures, so that what looks the same has the same ones.
LandmarkField::LandmarkField(const Scene& scene, const FloorPlan& plan, const FeatureOptions& options)
    : walls_(obstacles(scene)) {
  const Box box = bounds(plan);
  const RandomStream numbers(0, "landmarks");
  for (const Surface& surface : scene.surfaces()) {
    const SurfaceTexture& look = surface.look;
    const Texture& texture = scene.texture(look.texture);
    const bool is_plane = surface.corners.empty();
    const double per_m2 = is_plane ? 0.1 * options.landmarks_per_m2 : options.landmarks_per_m2,
                 side_m = 1.0 / std::sqrt(per_m2);
    const double cell_u = side_m * look.u.norm(), cell_v = side_m * look.v.norm();  // texels
    double low_u = 1e18, high_u = -1e18, low_v = 1e18, high_v = -1e18;
    const auto include = [&](const Vector3d& p) {
      const double u = look.u.dot(p) + look.first_u, v = look.v.dot(p) + look.first_v;
      low_u = std::min(low_u, u);
      high_u = std::max(high_u, u);
      low_v = std::min(low_v, v);
      high_v = std::max(high_v, v);
    };
    for (const Vector3d& corner : surface.corners) include(corner);
    if (is_plane) {
      for (const double x : {box.low_x, box.high_x}) {
        for (const double y : {box.low_y, box.high_y}) include({x, y, surface.point.z()});
      }
    }
    // Whole cells in a texture, so that they repeat as it does.
    const int columns = std::max(1, static_cast<int>(std::lround(texture.width() / cell_u))),
              rows = std::max(1, static_cast<int>(std::lround(texture.height() / cell_v)));
    const double step_u = static_cast<double>(texture.width()) / columns,
                 step_v = static_cast<double>(texture.height()) / rows;
    const auto folded = [](std::int64_t index, int count) {
      return static_cast<std::uint64_t>(((index % count) + count) % count);
    };
    for (auto row = static_cast<std::int64_t>(std::floor(low_v / step_v));
         row <= static_cast<std::int64_t>(std::floor(high_v / step_v)); ++row) {
      for (auto column = static_cast<std::int64_t>(std::floor(low_u / step_u));
           column <= static_cast<std::int64_t>(std::floor(high_u / step_u)); ++column) {
        const std::uint64_t key =
            (static_cast<std::uint64_t>(look.texture) << 40) ^ (folded(row, rows) << 20) ^ folded(column, columns);
        RandomNumbers of_cell = numbers.at(key);
        const double u = (static_cast<double>(column) + of_cell.uniform()) * step_u,
                     v = (static_cast<double>(row) + of_cell.uniform()) * step_v;
        const double size = options.least_size_m *
                            std::pow(std::max(1.0, options.greatest_size_m / options.least_size_m), of_cell.uniform());
        const std::uint64_t bits = of_cell.bits();
        // The point of the plane with these texel coordinates: both axes are perpendicular to each other and to the
        // normal.
        const double origin_u = look.u.dot(surface.point) + look.first_u,
                     origin_v = look.v.dot(surface.point) + look.first_v;
        const Vector3d point = surface.point + look.u * ((u - origin_u) / look.u.squaredNorm()) +
                               look.v * ((v - origin_v) / look.v.squaredNorm());
        if (is_plane ? !box.contains({point.x(), point.y()}) : !is_within(surface, point)) continue;
        landmarks_.push_back({point, surface.normal, size, bits});
      }
    }
  }

  low_x_ = box.low_x - kCell;
  low_y_ = box.low_y - kCell;
  columns_ = static_cast<int>(box.width() / kCell) + 3;
  rows_ = static_cast<int>(box.height() / kCell) + 3;
  std::vector<std::vector<std::uint32_t>> cells(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  for (std::size_t i = 0; i < landmarks_.size(); ++i) {
    const Vector3d& p = landmarks_[i].point_in_world;
    const int column = std::clamp(static_cast<int>((p.x() - low_x_) / kCell), 0, columns_ - 1),
              row = std::clamp(static_cast<int>((p.y() - low_y_) / kCell), 0, rows_ - 1);
    cells[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column)]
        .push_back(static_cast<std::uint32_t>(i));
  }
  for (const auto& cell : cells) {
    first_.push_back(static_cast<std::uint32_t>(members_.size()));
    members_.insert(members_.end(), cell.begin(), cell.end());
  }
  first_.push_back(static_cast<std::uint32_t>(members_.size()));
}

bool LandmarkField::is_in_sight(const Vector3d& eye, const SimulatedLandmark& landmark) const {
  const Vector3d ray = landmark.point_in_world - eye;
  const double length = ray.norm();
  return length <= kBeforeSurface || walls_.is_in_sight(eye, eye + ray * (1.0 - kBeforeSurface / length));
}

template <class Visit>
void LandmarkField::for_each_in(const Box& box, Visit&& visit) const {
  const auto index = [](double metres, double low, int count) {
    return std::clamp(static_cast<int>(std::floor((metres - low) / kCell)), 0, count - 1);
  };
  for (int row = index(box.low_y, low_y_, rows_); row <= index(box.high_y, low_y_, rows_); ++row) {
    for (int column = index(box.low_x, low_x_, columns_); column <= index(box.high_x, low_x_, columns_); ++column) {
      const std::size_t cell =
          static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
      for (std::uint32_t i = first_[cell]; i < first_[cell + 1]; ++i) visit(members_[i]);
    }
  }
}

namespace {

// A landmark in view.
struct Candidate {
  std::uint64_t luck;  // of this landmark in this frame
  std::uint32_t landmark;
  int octave;
  double u, v, z;
};

// The view's shadow on the floor: the eye and the corners at the farthest distance.
Box shadow_of(const CameraModel::Bounds& view, const Pose3& world_from_camera, double farthest_m) {
  const Vector3d eye = world_from_camera.t;
  Box box{eye.x(), eye.y(), eye.x(), eye.y()};
  for (const float x : {view.low_x, view.high_x}) {
    for (const float y : {view.low_y, view.high_y}) {
      const Vector3d corner = transformed(Vector3d(x, y, 1.0) * farthest_m, world_from_camera);
      box = {std::min(box.low_x, corner.x()), std::min(box.low_y, corner.y()), std::max(box.high_x, corner.x()),
             std::max(box.high_y, corner.y())};
    }
  }
  return box;
}

// Large enough to be found, and not missed by chance, which `salt` decides. The strongest ones first; how strong is up
// to the landmark, so that the same ones are found again and again.
std::vector<Candidate> candidates_in(const LandmarkField& field, const CameraModel& model,
                                     const FeatureOptions& options, const Pose3& world_from_camera,
                                     std::uint64_t salt) {
  const Vector3d eye = world_from_camera.t;
  const Eigen::Matrix3d camera_from_world = world_from_camera.q.conjugate().toRotationMatrix();
  const double focal = model.intrinsics().fx, octave_log = std::log(options.octave_factor),
               most_pixels = kLeastPixels * std::pow(options.octave_factor, options.octaves);
  const CameraModel::Bounds& view = model.bounds();
  const std::uint64_t missed = static_cast<std::uint64_t>(options.missed * 0x1p32);
  std::vector<Candidate> candidates;
  field.for_each_in(shadow_of(view, world_from_camera, options.farthest_m), [&](std::uint32_t i) {
    const SimulatedLandmark& landmark = field.landmarks()[i];
    const Vector3d ray = landmark.point_in_world - eye, p = camera_from_world * ray;
    if (p.z() < 0.05 || p.z() > options.farthest_m) return;
    const double x = p.x() / p.z(), y = p.y() / p.z();
    if (x < view.low_x || x > view.high_x || y < view.low_y || y > view.high_y) return;
    const double pixels = focal * landmark.size_m / p.z();
    if (pixels < kLeastPixels || pixels >= most_pixels) return;
    const double facing = landmark.normal.dot(ray);
    if (facing * facing < kLeastCosine * kLeastCosine * ray.squaredNorm()) return;
    const std::uint64_t luck = mixed(salt ^ mixed(i));
    if ((luck >> 32) < missed) return;
    const auto pixel = model.project(p);
    const int octave = std::min(options.octaves - 1, static_cast<int>(std::log(pixels / kLeastPixels) / octave_log));
    if (pixel) candidates.push_back({landmark.look, i, octave, pixel->x(), pixel->y(), p.z()});
  });
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return a.luck != b.luck ? a.luck < b.luck : a.landmark < b.landmark;
  });
  return candidates;
}

bool is_behind_body(const std::vector<Body>& bodies, const Vector3d& eye, const Vector3d& point) {
  if (bodies.empty()) return false;
  const double dx = point.x() - eye.x(), dy = point.y() - eye.y(), length = std::hypot(dx, dy);
  return length > 0.0 && std::any_of(bodies.begin(), bodies.end(), [&](const Body& body) {
           const double distance = distance_along_ray({eye.x(), eye.y()}, dx / length, dy / length,
                                                      {body.world_from_body.x, body.world_from_body.y}, body.radius_m);
           return distance < length && eye.z() + (point.z() - eye.z()) * distance / length < body.height_m;
         });
}

// What a camera and its detector make of a landmark, with their errors.
class FeatureMaker {
 public:
  // All outlive it.
  FeatureMaker(const FeatureOptions& options, const CameraOptions& camera, RandomNumbers& numbers)
      : options_(options), camera_(camera), numbers_(numbers) {}

  Feature feature(double u, double v, double z, int octave, const Descriptor& descriptor, std::uint32_t landmark) {
    Feature feature{};
    const double noise = options_.pixel_noise * std::pow(options_.octave_factor, octave);
    feature.u = static_cast<float>(u + noise * numbers_.normal());
    feature.v = static_cast<float>(v + noise * numbers_.normal());
    feature.octave = octave;
    feature.right_u = -1.0f;
    if (camera_.kind == SimulatedCameraKind::rgbd) {
      feature.depth_m = depth(z);
    } else if (camera_.kind == SimulatedCameraKind::stereo) {
      const double right = u - camera_.fx * camera_.baseline_m / z + noise * numbers_.normal();
      feature.right_u = right >= 0.0 ? static_cast<float>(right) : -1.0f;
    }
    feature.descriptor = descriptor;
    flip_bits(feature.descriptor);
    feature.landmark = landmark;
    return feature;
  }

  Feature outlier() {
    Descriptor descriptor;
    for (std::uint64_t& word : descriptor) word = numbers_.bits();
    const int octave = numbers_.integer(0, options_.octaves - 1);
    const double z = numbers_.uniform(0.5, 5.0);
    const double v = numbers_.uniform(0.0, camera_.height - 1.0), u = numbers_.uniform(0.0, camera_.width - 1.0);
    return feature(u, v, z, octave, descriptor, kNoLandmark);
  }

 private:
  float depth(double z) {
    const DepthNoiseOptions& depth = camera_.depth;
    const double measured =
        z + (depth.noise_m + std::hypot(depth.noise_per_m2, depth.step_per_m2 / std::sqrt(12.0)) * z * z) *
                numbers_.normal();
    return measured >= depth.min_range_m && measured <= depth.max_range_m ? static_cast<float>(measured) : 0.0f;
  }

  // From one wrong bit to the next.
  void flip_bits(Descriptor& descriptor) {
    if (options_.flipped_bits <= 0.0) return;
    const double log_kept = std::log1p(-std::min(options_.flipped_bits, 0.999));
    for (double bit = std::floor(std::log(1.0 - numbers_.uniform()) / log_kept); bit < 256.0;
         bit += 1.0 + std::floor(std::log(1.0 - numbers_.uniform()) / log_kept)) {
      const auto at = static_cast<std::size_t>(bit);
      descriptor[at / 64] ^= std::uint64_t{1} << (at % 64);
    }
  }

  const FeatureOptions& options_;
  const CameraOptions& camera_;
  RandomNumbers& numbers_;
};

}  // namespace

FeatureRecording::FeatureRecording(const World& world, const LandmarkField& field, const FeatureOptions& options,
                                   std::size_t robot, std::size_t camera)
    : world_(&world),
      field_(&field),
      options_(options),
      robot_(robot),
      camera_(world.cameras(robot).at(camera)),
      model_(camera_.intrinsics()),
      robot_from_camera_(camera_.robot_from_camera()),
      frame_count_(static_cast<std::size_t>(world.trajectory(robot).duration_s() * camera_.frames_per_second) + 1),
      numbers_(static_cast<std::uint64_t>(world.options().seed), "features",
               world.robot_id(robot).str() + "/" + camera_.id) {
  check(options);
}

SimulatedFeatureFrame FeatureRecording::frame(std::size_t number) const {
  MAPWEAVE_EXPECT(number < frame_count_, "a frame of the recording");
  const double seconds = std::round(static_cast<double>(number) * 1e6 / camera_.frames_per_second) * 1e-6;
  SimulatedFeatureFrame frame;
  frame.stamp = Stamp{world_->first_stamp(robot_).ns + std::llround(seconds * 1e6) * 1000};
  frame.world_from_camera = compose(world_->world_from_robot(robot_, seconds), robot_from_camera_);
  if (world_->is_carried(robot_, seconds) || camera_.is_dark(seconds)) return frame;
  const Vector3d eye = frame.world_from_camera.t;
  const std::vector<Candidate> candidates =
      candidates_in(*field_, model_, options_, frame.world_from_camera, numbers_.at(2 * number).bits());
  std::vector<Body> bodies;
  for (const Body& body : world_->bodies_around(robot_, seconds)) {
    if (std::hypot(body.world_from_body.x - eye.x(), body.world_from_body.y - eye.y()) < options_.farthest_m)
      bodies.push_back(body);
  }
  RandomNumbers numbers = numbers_.at(2 * number + 1);
  FeatureMaker maker(options_, camera_, numbers);
  const int outliers = static_cast<int>(options_.outliers * std::min(static_cast<double>(options_.most_features),
                                                                     static_cast<double>(candidates.size())));
  const std::size_t most = static_cast<std::size_t>(std::max(0, options_.most_features - outliers));
  for (const Candidate& candidate : candidates) {
    if (frame.features.size() >= most) break;
    const SimulatedLandmark& landmark = field_->landmarks()[candidate.landmark];
    if (is_behind_body(bodies, eye, landmark.point_in_world) || !field_->is_in_sight(eye, landmark)) continue;
    frame.features.push_back(maker.feature(candidate.u, candidate.v, candidate.z, candidate.octave,
                                           descriptor_of(landmark), candidate.landmark));
  }
  for (int i = 0; i < outliers; ++i) frame.features.push_back(maker.outlier());
  return frame;
}

}  // namespace mapweave::simulation
