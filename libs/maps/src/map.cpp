#include <mapweave/core/error.h>
#include <mapweave/maps/map.h>

#include "bulk.h"
#include "submap_content.h"

namespace mapweave {
namespace {

void add_pose(Hasher& hasher, const Pose3& pose) {
  hasher.add(pose.t.x()).add(pose.t.y()).add(pose.t.z());
  hasher.add(pose.q.x()).add(pose.q.y()).add(pose.q.z()).add(pose.q.w());
}

void add_session(Hasher& hasher, const SessionId& session) {
  hasher.add(session.client.robot.str()).add(session.client.sensor.str()).add(session.run);
}

void add_payload(Hasher& hasher, const PackedScan& scan) {
  const ScanGeometry& geometry = *scan.geometry;
  hasher.add("scan").add(geometry.first_angle_rad).add(geometry.angle_step_rad).add(std::int64_t{geometry.ray_count});
  hasher.add(geometry.max_range_m).add(geometry.range_unit_m);
  add_pose(hasher, geometry.robot_from_laser);
  hasher.add(packed(scan.ranges));
  // What has no sweep has the hash that it had before sweeps were known.
  if (geometry.has_sweep()) {
    hasher.add("sweep").add(geometry.first_ray_s).add(geometry.ray_step_s);
    hasher.add(std::int64_t{scan.motion.x_mm_s})
        .add(std::int64_t{scan.motion.y_mm_s})
        .add(std::int64_t{scan.motion.yaw_mrad_s});
  }
}

void add_payload(Hasher& hasher, const OccupancyGrid& grid) {
  hasher.add("grid").add(grid.resolution_m).add(grid.origin_x_m).add(grid.origin_y_m);
  hasher.add(std::int64_t{grid.columns}).add(std::int64_t{grid.rows}).add(packed(grid.log_odds));
}

void add_payload(Hasher& hasher, const KeyframeFeatures& keyframe) {
  const CameraGeometry& camera = *keyframe.geometry;
  hasher.add("keyframe").add(std::int64_t{camera.width}).add(std::int64_t{camera.height});
  hasher.add(camera.fx).add(camera.fy).add(camera.cx).add(camera.cy).add(camera.baseline_m).add(camera.level_scale);
  add_pose(hasher, camera.robot_from_camera);
  hasher.add(packed(keyframe.points)).add(packed(keyframe.descriptors));
}

void add_payload(Hasher& hasher, const std::shared_ptr<const Payload>& payload) {
  if (payload)
    std::visit([&](const auto& content) { add_payload(hasher, content); }, *payload);
  else
    hasher.add("none");
}

}  // namespace

bool operator==(const CameraGeometry& a, const CameraGeometry& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy &&
         a.baseline_m == b.baseline_m && a.level_scale == b.level_scale &&
         a.robot_from_camera.t == b.robot_from_camera.t &&
         a.robot_from_camera.q.coeffs() == b.robot_from_camera.q.coeffs();
}

std::string to_string(const LandmarkId& id) { return to_string(id.session) + "/landmark " + std::to_string(id.index); }

Constraint planar_constraint(ConstraintId id, const Pose2& from_from_to, const Eigen::Matrix3d& information) {
  Constraint constraint;
  constraint.id = std::move(id);
  constraint.from_from_to.pose = spatial(from_from_to);
  constraint.information = spatial(information);
  return constraint;
}

std::vector<SessionId> Map::sessions() const {
  std::vector<SessionId> sessions;  // nodes come in id order, so equal sessions come together
  for (const auto& entry : nodes)
    if (sessions.empty() || sessions.back() != entry.first.session) sessions.push_back(entry.first.session);
  return sessions;
}

std::vector<RobotId> Map::robots() const {
  std::vector<RobotId> robots;
  for (const SessionId& session : sessions())
    if (robots.empty() || robots.back() != session.client.robot) robots.push_back(session.client.robot);
  return robots;
}

bool holds(const Map& map, const SubmapId& id) {
  if (map.submaps.contains(id)) return true;
  const Node* node = map.nodes.find({id.session, id.index});
  return node != nullptr && keyframe_of(*node) != nullptr;
}

Hash content_hash(const Map& map) {
  Hasher hasher;
  hasher.add("map").add(static_cast<std::int64_t>(map.nodes.size()));
  for (const auto& [id, node] : map.nodes) {
    add_session(hasher, id.session);
    hasher.add(std::int64_t{id.index}).add(node.stamp.ns);
    add_payload(hasher, node.payload);
  }
  for (const auto& [id, submap] : map.submaps) {
    if (!submap.frozen) continue;
    add_session(hasher, id.session);
    hasher.add(std::int64_t{id.index}).add(submap.content);
  }
  return hasher.finish();
}

Hash content_hash(const Submap& submap, const NodeLookup& find) {
  Hasher hasher;
  hasher.add("submap").add(static_cast<std::int64_t>(submap.submap_from_node.size()));
  for (const auto& [id, submap_from_node] : submap.submap_from_node) {
    const Node* node = find(id);
    MAPWEAVE_EXPECT(node != nullptr && node->payload != nullptr,
                    "a submap holds nodes with payloads: " + to_string(id));
    add_session(hasher, id.session);
    hasher.add(std::int64_t{id.index});
    add_pose(hasher, submap_from_node);
    add_payload(hasher, node->payload);
  }
  return hasher.finish();
}

Hash content_hash(const Submap& submap, const Table<NodeId, Node>& nodes) {
  return content_hash(submap, [&](const NodeId& id) { return nodes.find(id); });
}

}  // namespace mapweave
