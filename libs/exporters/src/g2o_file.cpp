#include <mapweave/exporters/g2o_file.h>

#include "number_text.h"

#include <mapweave/core/error.h>
#include <mapweave/maps/map_noise.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace mapweave::exporters {
namespace {

bool is_planar(const Constraint& constraint) {
  const auto& i = constraint.information;  // z, roll and pitch are rows 2, 3, 4
  return is_planar(constraint.from_from_to.pose) && i.middleRows<3>(2).isZero(0.0) && i.middleCols<3>(2).isZero(0.0);
}

bool is_planar(const Map& map) {
  if (!map.landmarks.empty()) return false;
  for (const auto& [id, node] : map.nodes)
    if (!is_planar(node.map_from_node)) return false;
  for (const auto& [id, constraint] : map.constraints)
    if (id.kind != ConstraintKind::prior && !is_planar(constraint)) return false;
  return true;
}

void append_numbers(std::string& text, std::initializer_list<double> numbers) {
  for (const double number : numbers) {
    text += ' ';
    append_shortest(text, number);
  }
}

void append_pose(std::string& text, const Pose3& pose, bool planar_graph) {
  if (planar_graph)
    append_numbers(text, {pose.t.x(), pose.t.y(), planar(pose).phi});
  else
    append_numbers(text, {pose.t.x(), pose.t.y(), pose.t.z(), pose.q.x(), pose.q.y(), pose.q.z(), pose.q.w()});
}

void append_information(std::string& text, const Constraint& constraint, bool planar_graph) {
  if (planar_graph) {
    const Eigen::Matrix3d information = planar(constraint.information);
    for (int row = 0; row < 3; ++row)
      for (int column = row; column < 3; ++column) append_numbers(text, {information(row, column)});
    return;
  }
  // g2o measures turns by the vector part of the quaternion, half of a small angle in radians.
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column)
      append_numbers(text, {constraint.information(row, column) * (row < 3 ? 1.0 : 2.0) * (column < 3 ? 1.0 : 2.0)});
}

// What keyframes saw: cameras as parameters, landmarks as vertices, sightings as edges of pixel and inverse depth.
class Sightings {
 public:
  Sightings(const Map& map, const Table<NodeId, std::size_t>& numbers) : map_(map), numbers_(numbers) {}

  std::string text() {
    for (const auto& [id, landmark] : map_.landmarks) add(landmark);
    return cameras_text_ + text_;
  }

 private:
  void add(const Landmark& landmark) {
    const Node* anchor = map_.nodes.find(landmark.anchor);
    MAPWEAVE_EXPECT(anchor != nullptr, "a landmark hangs on a keyframe of the map");
    std::string edges;
    std::size_t count = 0;
    const std::size_t number = numbers_.size() + landmarks_;
    for (const LandmarkSighting& sighting : landmark.seen) {
      const Node* node = map_.nodes.find(sighting.node);
      const KeyframeFeatures* keyframe = node != nullptr ? keyframe_of(*node) : nullptr;
      if (keyframe == nullptr) continue;
      edges += edge(sighting, *keyframe, number);
      ++count;
    }
    if (count < 2) return;  // nothing holds it
    text_ += "VERTEX_TRACKXYZ " + std::to_string(number);
    const Eigen::Vector3d point = transformed(landmark.point_in_anchor(), anchor->map_from_node);
    append_numbers(text_, {point.x(), point.y(), point.z()});
    text_ += '\n' + edges;
    ++landmarks_;
  }

  std::string edge(const LandmarkSighting& sighting, const KeyframeFeatures& keyframe, std::size_t landmark) {
    const CameraGeometry& camera = *keyframe.geometry;
    std::string text = "EDGE_PROJECT_DISPARITY " + std::to_string(*numbers_.find(sighting.node)) + ' ' +
                       std::to_string(landmark) + ' ' + std::to_string(number_of(camera));
    const double inverse_depth = sighting.inverse_depth * kInverseDepthUnit_per_m;
    append_numbers(text, {pixels_of(sighting.u), pixels_of(sighting.v), inverse_depth});
    const double sigma_px = kLandmarkSigma_px * std::pow(2.0, sighting.level),
                 sigma_per_m =
                     camera.baseline_m > 0.0 ? sigma_px / (camera.fx * camera.baseline_m) : kInverseDepthSigma_per_m;
    const double of_pixel = 1.0 / (sigma_px * sigma_px),
                 of_depth = sighting.inverse_depth == 0 ? 0.0 : 1.0 / (sigma_per_m * sigma_per_m);
    append_numbers(text, {of_pixel, 0.0, 0.0, of_pixel, 0.0, of_depth});
    return text + '\n';
  }

  std::size_t number_of(const CameraGeometry& camera) {
    const auto known =
        std::find_if(cameras_.begin(), cameras_.end(), [&](const CameraGeometry* other) { return *other == camera; });
    if (known != cameras_.end()) return static_cast<std::size_t>(known - cameras_.begin());
    cameras_text_ += "PARAMS_CAMERACALIB " + std::to_string(cameras_.size());
    append_pose(cameras_text_, camera.robot_from_camera, false);
    append_numbers(cameras_text_, {camera.fx, camera.fy, camera.cx, camera.cy});
    cameras_text_ += '\n';
    cameras_.push_back(&camera);
    return cameras_.size() - 1;
  }

  const Map& map_;
  const Table<NodeId, std::size_t>& numbers_;
  std::vector<const CameraGeometry*> cameras_;
  std::size_t landmarks_ = 0;
  std::string cameras_text_, text_;
};

}  // namespace

std::string g2o_text(const Map& map) {
  const bool planar_graph = is_planar(map);
  Table<NodeId, std::size_t> numbers;
  numbers.reserve(map.nodes.size());
  for (const auto& [id, node] : map.nodes) {
    const std::size_t number = numbers.size();
    numbers.set(id, number);
  }

  std::string text =
      "# " + std::to_string(numbers.size()) + " vertices, " + std::to_string(map.constraints.size()) + " constraints\n";
  // One line for each run of nodes that follow each other.
  for (auto begin = map.nodes.begin(), end = begin; begin != map.nodes.end(); begin = end) {
    while (end != map.nodes.end() && end->first.session == begin->first.session &&
           end->first.index - begin->first.index == static_cast<std::size_t>(end - begin))
      ++end;
    const auto first = static_cast<std::size_t>(begin - map.nodes.begin()),
               last = static_cast<std::size_t>(end - map.nodes.begin()) - 1;
    text += "# vertices " + std::to_string(first) + " to " + std::to_string(last) + ": " +
            to_string(begin->first.session) + ", nodes " + std::to_string(begin->first.index) + " to " +
            std::to_string(std::prev(end)->first.index) + "\n";
  }

  for (const auto& [id, node] : map.nodes) {
    text += (planar_graph ? "VERTEX_SE2 " : "VERTEX_SE3:QUAT ") + std::to_string(*numbers.find(id));
    append_pose(text, node.map_from_node, planar_graph);
    text += '\n';
  }
  if (!numbers.empty()) text += "FIX 0\n";

  std::size_t priors = 0;
  for (const auto& [id, constraint] : map.constraints) {
    if (id.kind == ConstraintKind::prior) {
      ++priors;
      continue;
    }
    if (std::abs(constraint.from_from_to.scale - 1.0) > 1e-9)
      throw Error(ErrorCode::kUnsupported, "the constraint from " + to_string(id.from) + " to " + to_string(id.to) +
                                               " has a scale, which a g2o pose graph has not");
    const std::size_t* from = numbers.find(id.from);
    const std::size_t* to = numbers.find(id.to);
    MAPWEAVE_EXPECT(from != nullptr && to != nullptr, "a constraint names a node that the map does not hold");
    text += (planar_graph ? "EDGE_SE2 " : "EDGE_SE3:QUAT ") + std::to_string(*from) + ' ' + std::to_string(*to);
    append_pose(text, constraint.from_from_to.pose, planar_graph);
    append_information(text, constraint, planar_graph);
    text += '\n';
  }
  text += Sightings(map, numbers).text();
  if (priors > 0) text += "# left out: " + std::to_string(priors) + " priors\n";
  return text;
}

}  // namespace mapweave::exporters
