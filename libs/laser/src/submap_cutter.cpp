#include <mapweave/core/error.h>
#include <mapweave/laser/submap_cutter.h>

#include <algorithm>
#include <cmath>

namespace mapweave::laser {
namespace {

constexpr double kStillDeviation_m = 0.002, kStillDeviation_rad = 0.001;  // of a robot that did not move

Eigen::Matrix3d information_of(const Pose2& motion, const MotionNoiseOptions& noise) {
  const auto square = [](double x) { return x * x; };
  const double distance = std::hypot(motion.x, motion.y), turn = std::abs(wrap_angle(motion.phi));
  const double variance_m2 = square(kStillDeviation_m) + square(noise.m_per_sqrt_m) * distance;
  const double variance_rad2 =
      square(kStillDeviation_rad) + square(noise.rad_per_sqrt_m) * distance + square(noise.rad_per_sqrt_rad) * turn;
  return Eigen::Vector3d(1.0 / variance_m2, 1.0 / variance_m2, 1.0 / variance_rad2).asDiagonal();
}

struct Content {
  NodeId id;
  Pose2 map_from_node;
  double path_m;  // travelled before it
};

// Submap k holds the content between k and k + 2 half lengths of the path. The last one begins where its predecessor
// does not reach the end.
std::vector<Submap> submaps_along(const std::vector<Content>& content, const SessionId& session, double length_m) {
  std::vector<Submap> submaps;
  std::size_t begin = 0;
  while (begin < content.size()) {
    const double start_m = content[begin].path_m;
    const auto beyond = [&](double path_m) {
      return static_cast<std::size_t>(
          std::partition_point(content.begin() + static_cast<std::ptrdiff_t>(begin), content.end(),
                               [&](const Content& c) { return c.path_m - start_m <= path_m; }) -
          content.begin());
    };
    const std::size_t end = beyond(length_m);
    Submap submap;
    submap.id = {session, static_cast<std::uint32_t>(submaps.size())};
    for (std::size_t i = begin; i < end; ++i)
      submap.submap_from_node.emplace_back(
          content[i].id,
          i == begin ? Pose3{} : spatial(between(content[begin].map_from_node, content[i].map_from_node)));
    submaps.push_back(std::move(submap));
    if (end == content.size()) break;
    begin = std::min(beyond(0.5 * length_m), end);
  }
  return submaps;
}

}  // namespace

Map cut_into_submaps(const MapId& id, const SessionId& session, std::vector<TrackedScan> scans,
                     const SubmapCutterOptions& options) {
  Map map;
  map.id = id;
  map.nodes.reserve(scans.size());
  std::vector<Content> content;
  const Pose2 origin = scans.empty() ? Pose2{} : scans.front().map_from_robot;
  double path_m = 0.0;
  Pose2 previous;
  std::vector<Constraint> matched;
  for (std::size_t i = 0; i < scans.size(); ++i) {
    TrackedScan& scan = scans[i];
    MAPWEAVE_EXPECT(is_finite(scan.map_from_robot), "a tracked scan's pose must be finite");
    const NodeId node{session, static_cast<std::uint32_t>(i)};
    const Pose2 map_from_node = between(origin, scan.map_from_robot);
    if (i > 0) {
      const NodeId before{session, static_cast<std::uint32_t>(i - 1)};
      const Pose2 motion = between(previous, map_from_node);
      path_m += std::hypot(motion.x, motion.y);
      matched.push_back(planar_constraint({ConstraintKind::scan_match, before, node, 0}, motion,
                                          information_of(motion, options.scan_match)));
      if (scan.previous_from_this)
        map.constraints.set({ConstraintKind::odometry, before, node, 0},
                            planar_constraint({ConstraintKind::odometry, before, node, 0}, *scan.previous_from_this,
                                              information_of(*scan.previous_from_this, options.odometry)));
    }
    previous = map_from_node;
    bool shows_something_new = std::count_if(scan.scan.ranges.begin(), scan.scan.ranges.end(),
                                             [](auto range) { return range > 0; }) >= options.min_returns;
    if (shows_something_new && !content.empty()) {
      const Pose2 moved = between(content.back().map_from_node, map_from_node);
      shows_something_new = std::hypot(moved.x, moved.y) >= options.scan_distance_m ||
                            std::abs(wrap_angle(moved.phi)) >= options.scan_yaw_rad;
    }
    std::shared_ptr<const Payload> payload;
    if (shows_something_new) {
      payload = std::make_shared<const Payload>(std::move(scan.scan));
      content.push_back({node, map_from_node, path_m});
    }
    map.nodes.set(node, {node, scan.stamp, spatial(map_from_node), std::move(payload)});
  }
  for (Constraint& constraint : matched) {  // after the odometry, as their ids are
    const ConstraintId key = constraint.id;
    map.constraints.set(key, std::move(constraint));
  }
  for (Submap& submap : submaps_along(content, session, options.submap_length_m)) {
    submap.frozen = true;
    submap.content = content_hash(submap, map.nodes);
    const SubmapId key = submap.id;
    map.submaps.set(key, std::move(submap));
  }
  return map;
}

}  // namespace mapweave::laser
