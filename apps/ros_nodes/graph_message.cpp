#include "ros_messages.h"

#include <mapweave/exporters/robot_colours.h>

#include <algorithm>
#include <array>

namespace mapweave::ros_nodes {
namespace {

constexpr double kNodeSize_m = 0.08, kLineWidth_m = 0.02;

enum Kind : std::size_t { nodes, trajectories, odometry, scan_matches, extrinsics, loops, between_maps, kKinds };

struct Look {
  const char* name;
  float red, green, blue;
};
constexpr std::array<Look, kKinds> kLooks = {{{"nodes", 1.0f, 1.0f, 1.0f},
                                              {"trajectories", 0.6f, 0.6f, 0.6f},
                                              {"odometry", 0.2f, 0.4f, 0.9f},
                                              {"scan_matches", 0.1f, 0.7f, 0.2f},
                                              {"extrinsics", 0.6f, 0.2f, 0.8f},
                                              {"loops", 1.0f, 0.6f, 0.0f},
                                              {"between_maps", 0.9f, 0.0f, 0.1f}}};

std_msgs::ColorRGBA colour_message(float red, float green, float blue) {
  std_msgs::ColorRGBA colour;
  colour.r = red;
  colour.g = green;
  colour.b = blue;
  colour.a = 1.0f;
  return colour;
}

std_msgs::ColorRGBA colour_of(const exporters::RobotColour& colour) {
  constexpr float kFull = 255.0f;
  return colour_message(static_cast<float>(colour.red) / kFull, static_cast<float>(colour.green) / kFull,
                        static_cast<float>(colour.blue) / kFull);
}

visualization_msgs::Marker empty_marker(Kind kind, const std::string& frame) {
  visualization_msgs::Marker marker;
  marker.header.frame_id = frame;
  marker.ns = kLooks[kind].name;
  marker.type = kind == nodes ? visualization_msgs::Marker::SPHERE_LIST : visualization_msgs::Marker::LINE_LIST;
  marker.pose.orientation.w = 1.0;
  marker.scale.x = kind == nodes ? kNodeSize_m : kLineWidth_m;
  marker.scale.y = marker.scale.z = kind == nodes ? kNodeSize_m : 0.0;
  marker.color = colour_message(kLooks[kind].red, kLooks[kind].green, kLooks[kind].blue);
  marker.frame_locked = 1;
  return marker;
}

geometry_msgs::Point point_of(const Node& node) { return pose_message(node.map_from_node).position; }

Kind kind_of(const ConstraintId& id) {
  if (id.from.session.client.robot != id.to.session.client.robot) return between_maps;
  switch (id.kind) {
    case ConstraintKind::odometry: return odometry;
    case ConstraintKind::scan_match: return scan_matches;
    case ConstraintKind::extrinsic: return extrinsics;
    case ConstraintKind::loop: return loops;
    case ConstraintKind::between_maps:
    case ConstraintKind::prior: return between_maps;
  }
  return between_maps;
}

}  // namespace

visualization_msgs::MarkerArray graph_message(const Map& map, const std::string& frame) {
  visualization_msgs::MarkerArray graph;
  for (std::size_t kind = 0; kind < kKinds; ++kind)
    graph.markers.push_back(empty_marker(static_cast<Kind>(kind), frame));
  const std::vector<RobotId> robots = map.robots();
  const Node* before = nullptr;
  for (const auto& [id, node] : map.nodes) {
    const auto robot = std::lower_bound(robots.begin(), robots.end(), id.session.client.robot) - robots.begin();
    graph.markers[nodes].points.push_back(point_of(node));
    graph.markers[nodes].colors.push_back(colour_of(exporters::robot_colour(static_cast<std::size_t>(robot))));
    if (before != nullptr && before->id.session == id.session) {
      graph.markers[trajectories].points.push_back(point_of(*before));
      graph.markers[trajectories].points.push_back(point_of(node));
    }
    before = &node;
  }
  for (const auto& [id, constraint] : map.constraints) {
    const Node *from = map.nodes.find(id.from), *to = map.nodes.find(id.to);
    if (from == nullptr || to == nullptr || from == to) continue;
    auto& points = graph.markers[kind_of(id)].points;
    points.push_back(point_of(*from));
    points.push_back(point_of(*to));
  }
  for (visualization_msgs::Marker& marker : graph.markers)
    marker.action = marker.points.empty() ? visualization_msgs::Marker::DELETE : visualization_msgs::Marker::ADD;
  return graph;
}

}  // namespace mapweave::ros_nodes
