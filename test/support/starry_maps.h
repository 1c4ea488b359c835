#pragma once
// Maps of keyframes in rooms whose walls carry landmarks, at poses of our choice: what clients would publish, without
// clients.

#include <mapweave/maps/map.h>

#include <algorithm>
#include <map>
#include <random>
#include <vector>

namespace mapweave::test {

struct StarryOptions {
  double pixel_noise = 0.3;
  double inverse_depth_noise = 0.002;
  double drift_rad_per_keyframe = 0.0;  // in yaw: the map bends
  bool depth =
      true;  // false: one camera, whose path and landmarks have `scale` times their size; where it sits it knows
  double scale = 1.0;
  const char* sensor = "camera";
  Eigen::Vector3d camera_m{0.1, 0.0, 0.6};  // on the robot
};

// Rooms of 8 x 8 x 3 m, 12 m from one centre to the next along x. look: rooms of one look cannot be distinguished.
class StarryBuilding {
 public:
  explicit StarryBuilding(const std::vector<int>& looks, int landmarks_per_room = 1200) {
    for (std::size_t room = 0; room < looks.size(); ++room) {
      std::mt19937_64 random(static_cast<std::uint64_t>(looks[room]) + 17);
      const auto uniform = [&](double low, double high) {
        return low + (high - low) * static_cast<double>(random() >> 11) * 0x1.0p-53;
      };
      for (int i = 0; i < landmarks_per_room; ++i) {
        Eigen::Vector3d point(uniform(-4, 4), uniform(-4, 4), uniform(0, 3));
        point[i % 2] = i % 4 < 2 ? 4.0 : -4.0;
        point.x() += 12.0 * static_cast<double>(room);
        points_.push_back(point);
        descriptors_.push_back({random(), random(), random(), random()});
      }
    }
  }

  // x, y, yaw of the robot in the building. The map's frame is the first one's; noise is the name's.
  Map keyframe_map(const std::string& name, const std::vector<Pose2>& poses, const StarryOptions& options = {}) const {
    std::mt19937_64 random(std::hash<std::string>{}(name));
    const auto uniform = [&](double low, double high) {
      return low + (high - low) * static_cast<double>(random() >> 11) * 0x1.0p-53;
    };
    auto geometry = std::make_shared<CameraGeometry>();
    *geometry = {640, 480, 520.0, 520.0, 319.5, 239.5, 0.0, 1.2, {}};
    geometry->robot_from_camera.t = options.camera_m;
    geometry->robot_from_camera.q = Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5);  // z ahead, x to the right
    Map map;
    map.id = MapId(name);
    const SessionId session{{RobotId(name), SensorId(options.sensor)}, 1'000'000'000};
    std::map<std::size_t, Landmark> seen;
    Pose2 believed;
    for (std::uint32_t k = 0; k < poses.size(); ++k) {
      if (k > 0) {
        Pose2 step = between(poses[k - 1], poses[k]);
        step.phi += options.drift_rad_per_keyframe;
        believed = compose(believed, step);
      }
      const NodeId id{session, k};
      Pose3 map_from_node = spatial(believed);
      const Eigen::Vector3d swung_m = map_from_node.q * geometry->robot_from_camera.t - geometry->robot_from_camera.t;
      map_from_node.t += (options.scale - 1.0) * (map_from_node.t + swung_m);
      const Pose3 building_from_camera = compose(spatial(poses[k]), geometry->robot_from_camera),
                  camera_from_building = inverse(building_from_camera);
      KeyframeFeatures features;
      features.geometry = geometry;
      for (std::size_t i = 0; i < points_.size(); ++i) {
        const Eigen::Vector3d p = transformed(points_[i], camera_from_building);
        if (p.z() < 0.3 || p.z() > 9.0 || uniform(0, 1) < 0.1) continue;
        const double u = geometry->fx * p.x() / p.z() + geometry->cx + options.pixel_noise * uniform(-1, 1),
                     v = geometry->fy * p.y() / p.z() + geometry->cy + options.pixel_noise * uniform(-1, 1);
        if (!(u > 0 && v > 0 && u < 639 && v < 479)) continue;
        BinaryDescriptor descriptor = descriptors_[i];
        for (int bit = 0; bit < 8; ++bit) descriptor[random() % 4] ^= std::uint64_t{1} << (random() % 64);
        const double inverse_depth = 1.0 / p.z() + options.inverse_depth_noise * uniform(-1, 1);
        KeyframePoint point{pixel_units(u), pixel_units(v),
                            options.depth ? inverse_depth_units(1.0 / inverse_depth) : std::uint16_t{0}, 0, 0};
        features.points.push_back(point);
        features.descriptors.push_back(descriptor);
        auto [landmark, is_new] = seen.try_emplace(i);
        if (is_new) {
          landmark->second.id = {session, static_cast<std::uint32_t>(seen.size() - 1)};
          landmark->second.anchor = id;
          const Eigen::Vector3d in_camera = (options.depth ? 1.0 / inverse_depth : p.z()) / p.z() * p;
          landmark->second.point_units =
              landmark_units(options.scale * transformed(in_camera, geometry->robot_from_camera) +
                             (1.0 - options.scale) * geometry->robot_from_camera.t);
        }
        landmark->second.seen.push_back({id, point.u, point.v, point.inverse_depth, 0});
      }
      map.nodes.set(id, {id,
                         {session.run + std::int64_t{k} * 100'000'000},
                         map_from_node,
                         std::make_shared<const Payload>(std::move(features))});
    }
    std::map<LandmarkId, Landmark> by_id;
    for (auto& [number, landmark] : seen)
      if (landmark.seen.size() > 1) by_id.emplace(landmark.id, std::move(landmark));
    for (auto& [id, landmark] : by_id) map.landmarks.set(id, std::move(landmark));
    return map;
  }
  // Where landmarks are, in the building, by numbers.
  const Eigen::Vector3d& point(std::size_t number) const { return points_[number]; }
  std::size_t nearest(const Eigen::Vector3d& to) const {
    const auto nearer = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
      return (a - to).squaredNorm() < (b - to).squaredNorm();
    };
    return static_cast<std::size_t>(std::min_element(points_.begin(), points_.end(), nearer) - points_.begin());
  }

 private:
  std::vector<Eigen::Vector3d> points_;
  std::vector<BinaryDescriptor> descriptors_;
};

// A turn on the spot and a path along x.
inline std::vector<Pose2> look_around(double x, double y, double first_yaw, double last_yaw, int count) {
  std::vector<Pose2> poses;
  for (int i = 0; i < count; ++i) {
    const double share = static_cast<double>(i) / std::max(1, count - 1);
    poses.push_back({x + 0.8 * share, y, wrap_angle(first_yaw + share * (last_yaw - first_yaw))});
  }
  return poses;
}

}  // namespace mapweave::test
