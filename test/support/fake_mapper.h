#pragma once
// An engine that believes its odometry: every scan is a node with content, in one frozen submap. Fails on request.

#include <mapweave/core/error.h>
#include <mapweave/laser/laser_mapper.h>

#include <cmath>

namespace mapweave::test {

inline laser::ScanInput make_scan(double seconds, double range_m = 2.0, std::uint32_t rays = 60) {
  auto geometry = std::make_shared<ScanGeometry>();
  geometry->first_angle_rad = -M_PI / 2;
  geometry->angle_step_rad = M_PI / rays;
  geometry->ray_count = rays;
  geometry->max_range_m = 20.0;
  PackedScan scan{geometry, std::vector<std::uint16_t>(rays, static_cast<std::uint16_t>(range_m * 1000.0))};
  return {stamp_from_seconds(seconds), std::move(scan)};
}

inline laser::OdometryInput make_odometry(double seconds, double x, double y = 0.0, double yaw = 0.0) {
  return {stamp_from_seconds(seconds), spatial(Pose2(x, y, yaw))};
}

class FakeMapper : public laser::LaserMapper {
 public:
  explicit FakeMapper(RobotId robot, int fails_at_scan = -1) : fails_at_scan_(fails_at_scan) {
    map_.id = MapId(robot.str());
    session_.client = {robot, SensorId("laser")};
  }
  void add(const laser::LaserInput& input) override {
    if (const auto* odometry = std::get_if<laser::OdometryInput>(&input)) {
      map_from_robot_ = odometry->odometry_from_robot;
      return;
    }
    const auto& scan = std::get<laser::ScanInput>(input);
    if (static_cast<int>(map_.nodes.size()) == fails_at_scan_)
      throw Error(ErrorCode::kHelperFailed, "the helper was killed", "fake");
    if (map_.nodes.empty()) session_.run = scan.stamp.ns;
    const NodeId id{session_, static_cast<std::uint32_t>(map_.nodes.size())};
    map_.nodes.set(id, Node{id, scan.stamp, map_from_robot_, std::make_shared<const Payload>(scan.scan)});
  }
  void finish() override {
    if (map_.empty()) return;
    Submap submap;
    submap.id = {session_, 0};
    const Pose3 anchor = map_.nodes.front().second.map_from_node;
    for (const auto& [id, node] : map_.nodes)
      submap.submap_from_node.emplace_back(id, between(anchor, node.map_from_node));
    submap.frozen = true;
    submap.content = content_hash(submap, map_.nodes);
    map_.submaps.set(submap.id, submap);
  }
  Map snapshot() const override { return map_; }

 private:
  int fails_at_scan_;
  SessionId session_;
  Pose3 map_from_robot_;
  Map map_;
};

// A finished map of `scans` scans along x.
inline Map make_map(const std::string& robot, int scans, double start_s = 100.0, double first_range_m = 2.0) {
  FakeMapper mapper{RobotId(robot)};
  for (int i = 0; i < scans; ++i) {
    mapper.add(make_odometry(start_s + i, 0.5 * i));
    mapper.add(make_scan(start_s + i, first_range_m + 0.1 * i));
  }
  mapper.finish();
  return mapper.snapshot();
}

}  // namespace mapweave::test
