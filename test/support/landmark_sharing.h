#pragma once
// A world of points with descriptors, and what a server that knows a map shares of it.

#include <mapweave/matching/landmark_description.h>
#include <mapweave/matching/rigid_from_points.h>
#include <mapweave/visual/visual_client.h>
#include <support/painted_room.h>

#include <random>

namespace mapweave::test {

inline const Pose3 kRobotFromCamera{{0.1, 0.0, 0.4}, Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5)};
inline visual::ClientPlace place_of(const char* robot) {
  return {{RobotId(robot), SensorId("front")}, kRobotFromCamera};
}
inline Stamp at(int frame) { return stamp_from_seconds(100.0 + frame / 15.0); }

// A corridor along z of the world (optical axes: x right, y down), whose walls carry landmarks; or one that closes on
// itself around y.
class StarryCorridor {
 public:
  static constexpr double kLength_m = 28.0;
  static constexpr double kRadius_m = 5.5;  // of a ring's middle
  Pinhole camera{320, 240, 260.0, 260.0, 159.5, 119.5};

  explicit StarryCorridor(std::uint64_t noise_seed, bool ring = false) {
    std::mt19937_64 world(5);
    const auto draw = [&](double low, double high) {
      return low + (high - low) * static_cast<double>(world() >> 11) * 0x1.0p-53;
    };
    for (int i = 0; i < 3500; ++i) {
      Eigen::Vector3d point(draw(-1.5, 1.5), draw(-1.2, 1.2),
                            ring ? draw(0.0, 2.0 * M_PI * kRadius_m) : draw(-2, kLength_m + 4));
      if (i % 3 < 2) point.x() = i % 3 == 0 ? -1.5 : 1.5;
      if (i % 3 == 2) point.y() = i % 2 == 0 ? -1.2 : 1.2;
      points_.push_back(ring ? transformed({point.x(), point.y(), 0.0}, along_ring(point.z())) : point);
      descriptors_.push_back({world(), world(), world(), world()});
    }
    random_.seed(noise_seed);
  }
  // world_from_camera of one that looks along the ring, after so much of its middle.
  static Pose3 along_ring(double path_m) {
    const double angle = path_m / kRadius_m;
    return {{kRadius_m * std::cos(angle), 0.0, kRadius_m * std::sin(angle)},
            Eigen::Quaterniond(Eigen::AngleAxisd(-angle, Eigen::Vector3d::UnitY()))};
  }
  // Errors: uniform within so many pixels, and inverse metres; inverse depths wrong by `offset` besides.
  visual::FeatureFrame frame(Stamp stamp, const Pose3& world_from_camera, double pixels, double inverse_depth,
                             double offset = 0.0) {
    visual::FeatureFrame result;
    result.stamp = stamp;
    const Pose3 camera_from_world = inverse(world_from_camera);
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3d p = transformed(points_[i], camera_from_world);
      if (p.z() < 0.5 || p.z() > 6.0 || uniform(1) < -0.8) continue;
      const Eigen::Vector2d pixel = camera.project(p);
      if (!(pixel.x() > 0 && pixel.y() > 0 && pixel.x() < camera.width && pixel.y() < camera.height)) continue;
      matching::OrbDescriptor descriptor = descriptors_[i];
      for (int bit = 0; bit < 10; ++bit) descriptor[random_() % 4] ^= std::uint64_t{1} << (random_() % 64);
      result.features.points.push_back(
          {static_cast<float>(pixel.x() + uniform(pixels)), static_cast<float>(pixel.y() + uniform(pixels)), 0, 0});
      result.features.descriptors.push_back(descriptor);
      result.inverse_depths.push_back(static_cast<float>(1.0 / p.z() + offset + uniform(inverse_depth)));
    }
    return result;
  }

 private:
  double uniform(double most) { return most * (2.0 * static_cast<double>(random_() >> 11) * 0x1.0p-53 - 1.0); }
  std::vector<Eigen::Vector3d> points_;
  std::vector<matching::OrbDescriptor> descriptors_;
  std::mt19937_64 random_;
};

// Knows one client's map, and where that lies in the world.
class SharingServer {
 public:
  // world_from_camera: of the client's first keyframe.
  void learn(visual::VisualClient& client, const visual::ClientPlace& place, const Pose3& world_from_camera) {
    for (const MapUpdate& update : client.take_updates(place, visual::PublishedDetail::exact))
      map = updated(std::move(map), decode_map_update(encode(update), "test"));
    world_from_map = compose(world_from_camera, inverse(place.robot_from_camera));
    const matching::LandmarkDescriber describer(map);
    for (const auto& [id, landmark] : map.landmarks)
      if (const auto known = describer.described(landmark)) index.set(*known);
  }
  // In the world's frame, under a camera there.
  std::vector<DescribedLandmark> under(const Pinhole& camera, const Pose3& world_from_camera) const {
    matching::Frustum frustum;
    frustum.pinhole = camera;
    frustum.map_from_camera = compose(inverse(world_from_map), world_from_camera);
    matching::RetrievalOptions options;
    options.margin_px = 40.0;
    auto found = index.retrieve(frustum, options);
    for (auto& one : found) one = matching::transformed(one, {world_from_map, 1.0});
    return found;
  }
  static std::vector<DescribedLandmark> in_map(std::vector<DescribedLandmark> in_world, const Pose3& world_from_map) {
    for (auto& one : in_world) one = matching::transformed(one, {inverse(world_from_map), 1.0});
    return in_world;
  }

  Map map;
  Pose3 world_from_map;
  matching::LandmarkIndex index;
};

// Root mean square distance of the trajectory from the truth, laid on it.
inline double error_of(const visual::VisualClient& client, const std::vector<Pose3>& truth, bool with_scale = false,
                       double* scale = nullptr) {
  std::vector<matching::PointPair> pairs;
  for (const visual::PlacedFrame& frame : client.trajectory())
    pairs.push_back({truth[static_cast<std::size_t>(std::lround((frame.stamp.seconds() - 100.0) * 15.0))].t,
                     frame.map_from_camera.t});
  const auto laid =
      matching::align_points(pairs, with_scale ? matching::Freedom::similarity : matching::Freedom::rigid);
  if (!laid) return std::numeric_limits<double>::infinity();
  if (scale != nullptr) *scale = laid->scale;
  double square = 0;
  for (const matching::PointPair& pair : pairs)
    square += (laid->scale * (laid->pose.q * pair.in_b) + laid->pose.t - pair.in_a).squaredNorm();
  return std::sqrt(square / static_cast<double>(pairs.size()));
}

}  // namespace mapweave::test
