#include "soundness.h"

#include <mapweave/maps/reasons.h>

#include <algorithm>
#include <cmath>

namespace mapweave {
namespace {

std::string problem_with(const Sim3& similarity) {
  if (!(std::isfinite(similarity.scale) && similarity.scale > 0.0)) return "a scale is not a positive number";
  return problem_with(similarity.pose);
}

std::string problem_with(const Eigen::Matrix<double, 6, 6>& matrix) {
  if (!matrix.allFinite()) return "a matrix holds a number that is not finite";
  if (matrix.diagonal().minCoeff() < 0.0) return "an information or covariance matrix has a negative diagonal";
  return {};
}

std::string problem_with(const PackedScan& scan) {
  if (scan.geometry == nullptr) return "a scan has no geometry";
  if (scan.ranges.size() != scan.geometry->ray_count)
    return "a scan has " + std::to_string(scan.ranges.size()) + " ranges; its geometry says " +
           std::to_string(scan.geometry->ray_count);
  if (!scan.motion.is_zero() && !scan.geometry->has_sweep()) return "a scan has a motion, and its laser no sweep";
  return {};
}

std::string problem_with(const OccupancyGrid& grid) {
  if (!(std::isfinite(grid.resolution_m) && grid.resolution_m > 0.0))
    return "a grid's resolution is not a positive number";
  if (!(std::isfinite(grid.origin_x_m) && std::isfinite(grid.origin_y_m))) return "a grid's origin is not finite";
  if (grid.columns < 1 || grid.rows < 1 || grid.columns > kMostGridSide || grid.rows > kMostGridSide ||
      std::int64_t{grid.columns} * grid.rows > kMostGridCells)
    return "a grid has " + std::to_string(grid.columns) + " x " + std::to_string(grid.rows) + " cells; 1 to " +
           std::to_string(kMostGridSide) + " a side and at most " + std::to_string(kMostGridCells) +
           " in all are expected";
  if (grid.log_odds.size() != static_cast<std::size_t>(grid.columns) * static_cast<std::size_t>(grid.rows))
    return "a grid of " + std::to_string(grid.columns) + " x " + std::to_string(grid.rows) + " cells holds " +
           std::to_string(grid.log_odds.size());
  return {};
}

std::string problem_with(const KeyframeFeatures& keyframe) {
  if (keyframe.geometry == nullptr) return "a keyframe has no camera";
  if (keyframe.points.size() > kMostFeatures)
    return "a keyframe has " + std::to_string(keyframe.points.size()) + " features; at most " +
           std::to_string(kMostFeatures) + " are expected";
  if (keyframe.points.size() != keyframe.descriptors.size())
    return "a keyframe has " + std::to_string(keyframe.descriptors.size()) + " descriptors of " +
           std::to_string(keyframe.points.size()) + " features";
  for (const KeyframePoint& point : keyframe.points) {
    if (!is_inside(point, *keyframe.geometry)) return "a keyframe has a feature outside of its picture";
    if (point.level > kMostLevel)
      return "a keyframe has a feature on level " + std::to_string(point.level) + " of its pyramid";
  }
  return {};
}

std::string problem_with(const std::vector<LandmarkSighting>& seen) {
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (i > 0 && !(seen[i - 1].node < seen[i].node))
      return "a landmark's sightings are not in ascending order of nodes";
    if (seen[i].level > kMostLevel)
      return "a landmark is seen on level " + std::to_string(seen[i].level) + " of a pyramid";
  }
  return {};
}

std::string problem_with(const Alignment& alignment) {
  auto problem = problem_with(alignment.a_from_b);
  return problem.empty() ? problem_with(alignment.covariance) : problem;
}

std::string problem_with(const Evidence& evidence) {
  for (const double number : {evidence.overlap_m2, evidence.overlap, evidence.inliers, evidence.conflict,
                              evidence.longest_contradiction_m[0], evidence.longest_contradiction_m[1],
                              evidence.second_best_ratio, evidence.verifier_inliers, evidence.verifier_disagreement_m,
                              evidence.observability.x(), evidence.observability.y(), evidence.observability.z()})
    if (!std::isfinite(number)) return "a number of the evidence is not finite";
  return {};
}

bool is_probability(double number) { return number >= 0.0 && number <= 1.0; }

}  // namespace

std::string problem_with(const SessionId& session) {
  if (!is_valid_name(session.client.robot.str())) return "a session has no valid name of a robot";
  if (!is_valid_name(session.client.sensor.str())) return "a session has no valid name of a sensor";
  return {};
}

std::string problem_with(const Pose3& pose) {
  if (!is_finite(pose)) return "a pose holds a number that is not finite";
  if (std::abs(pose.q.norm() - 1.0) > kUnitTolerance)
    return "a pose's quaternion has norm " + std::to_string(pose.q.norm()) + "; 1 is expected";
  return {};
}

std::string problem_with(const ScanGeometry& geometry) {
  if (!(std::isfinite(geometry.first_angle_rad) && std::isfinite(geometry.angle_step_rad)))
    return "a laser's angles are not finite";
  if (geometry.ray_count < 1 || geometry.ray_count > kMostRays)
    return "a laser has " + std::to_string(geometry.ray_count) + " rays; 1 to " + std::to_string(kMostRays) +
           " are expected";
  if (!(std::isfinite(geometry.max_range_m) && geometry.max_range_m > 0.0))
    return "a laser's largest range is not a positive number";
  if (!(std::isfinite(geometry.range_unit_m) && geometry.range_unit_m > 0.0))
    return "a laser's unit of range is not a positive number";
  // NaN is no number below a limit.
  if (!(std::abs(geometry.first_ray_s) <= kLongestSweep_s &&
        std::abs(geometry.ray_time_s(geometry.ray_count - 1)) <= kLongestSweep_s))
    return "a laser's rays are not measured within " + std::to_string(static_cast<int>(kLongestSweep_s)) +
           " s of the stamp";
  return problem_with(geometry.robot_from_laser);
}

std::string problem_with(const CameraGeometry& camera) {
  if (camera.width < 1 || camera.height < 1 || camera.width > kMostPictureSide || camera.height > kMostPictureSide)
    return "a camera has pictures of " + std::to_string(camera.width) + " x " + std::to_string(camera.height) +
           " pixels; 1 to " + std::to_string(kMostPictureSide) + " a side are expected";
  for (const double focal_px : {camera.fx, camera.fy})
    if (!(std::isfinite(focal_px) && focal_px > 0.0)) return "a camera's focal length is not a positive number";
  if (!(std::isfinite(camera.cx) && std::isfinite(camera.cy))) return "a camera's centre is not finite";
  if (!(std::isfinite(camera.baseline_m) && camera.baseline_m >= 0.0))
    return "a camera's baseline is not a number from 0";
  if (!(std::isfinite(camera.level_scale) && camera.level_scale >= 1.0))
    return "the levels of a camera's pyramid do not grow";
  return problem_with(camera.robot_from_camera);
}

std::string problem_with(const Node& node) {
  auto problem = problem_with(node.map_from_node);
  if (problem.empty() && node.payload)
    problem = std::visit([](const auto& content) { return problem_with(content); }, *node.payload);
  return problem;
}

std::string problem_with(const MovedNode& moved) { return problem_with(moved.map_from_node); }

std::string problem_with(const Submap& submap) {
  if (submap.submap_from_node.empty()) return "a submap holds no nodes";
  std::vector<NodeId> members;
  members.reserve(submap.submap_from_node.size());
  for (const auto& [id, submap_from_node] : submap.submap_from_node) {
    if (auto problem = problem_with(submap_from_node); !problem.empty()) return problem;
    members.push_back(id);
  }
  const Pose3& anchor = submap.submap_from_node.front().second;
  if (anchor.t.norm() > kUnitTolerance || anchor.q.vec().norm() > kUnitTolerance)
    return "a submap's first node is not at its origin";
  std::sort(members.begin(), members.end());
  if (std::adjacent_find(members.begin(), members.end()) != members.end()) return "a submap holds a node twice";
  return {};
}

std::string problem_with(const ConstraintId& id) {
  if (id.kind > ConstraintKind::prior)
    return "a constraint is of unknown kind " + std::to_string(static_cast<int>(id.kind));
  return {};
}

std::string problem_with(const Constraint& constraint) {
  auto problem = problem_with(constraint.id);
  if (problem.empty()) problem = problem_with(constraint.from_from_to);
  return problem.empty() ? problem_with(constraint.information) : problem;
}

std::string problem_with(const Judgement& judgement) {
  if (!(judgement.a < judgement.b)) return "a judgement's submaps are not in order";
  if (judgement.hypotheses.size() > kMostHypotheses)
    return "a judgement has more than " + std::to_string(kMostHypotheses) + " hypotheses";
  if (judgement.scores.size() != judgement.hypotheses.size())
    return "a judgement has " + std::to_string(judgement.scores.size()) + " scores of " +
           std::to_string(judgement.hypotheses.size()) + " hypotheses";
  for (const Alignment& alignment : judgement.hypotheses)
    if (auto problem = problem_with(alignment); !problem.empty()) return problem;
  if (!std::all_of(judgement.scores.begin(), judgement.scores.end(), [](double score) { return std::isfinite(score); }))
    return "a judgement's score is not finite";
  if (!is_probability(judgement.probability)) return "a judgement's probability is not within 0..1";
  if (judgement.doubt > Reason::too_few_witnesses)
    return "a judgement has unknown doubt " + std::to_string(static_cast<int>(judgement.doubt));
  return problem_with(judgement.evidence);
}

bool is_proposer(const std::string& name) {
  return name.size() <= 256 && std::all_of(name.begin(), name.end(), [](char c) { return c >= ' ' && c <= '~'; });
}

std::string problem_with(const Verdict& verdict) {
  if (!is_valid_name(verdict.a.str()) || !is_valid_name(verdict.b.str())) return "a verdict has no valid name of a map";
  if (!(verdict.a < verdict.b)) return "a verdict's maps are not in order";
  if (!verdict.by.empty() && !is_valid_name(verdict.by.str())) return "a verdict has no valid name of a tier";
  if (verdict.kind != "laser" && verdict.kind != "vision" && verdict.kind != "laser and vision" &&
      verdict.kind != "grid")
    return "a verdict's kind is none of laser, vision, laser and vision, grid";
  if (!is_proposer(verdict.proposer)) return "a verdict's proposer is not up to 256 printable letters";
  if (verdict.decision > Decision::deferred)
    return "a verdict has unknown decision " + std::to_string(static_cast<int>(verdict.decision));
  if (verdict.reason > kLastReason)
    return "a verdict has unknown reason " + std::to_string(static_cast<int>(verdict.reason));
  if (!is_probability(verdict.probability)) return "a verdict's probability is not within 0..1";
  for (const double number : {verdict.overlap, verdict.conflict, verdict.second_best})
    if (!std::isfinite(number)) return "a number of a verdict is not finite";
  return verdict.alignment ? problem_with(*verdict.alignment) : std::string();
}

std::string problem_with(const Origin& origin) {
  if (!origin.tier.empty() && !is_valid_name(origin.tier.str())) return "the origin has no valid name of a tier";
  if (!origin.map.empty() && !is_valid_name(origin.map.str())) return "the origin has no valid name of a map";
  return {};
}

std::string problem_with(const Landmark& landmark) {
  if (landmark.anchor.session != landmark.id.session) return "a landmark is anchored in another session than its own";
  return problem_with(landmark.seen);
}

std::string problem_with(const LandmarkChange& change) { return problem_with(change.seen); }

}  // namespace mapweave
