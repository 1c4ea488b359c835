#include "ties.h"
#include "covisibility.h"
#include "lengths.h"

#include <Eigen/LU>
#include <algorithm>

namespace mapweave::fusion {

Constraint constraint_of(ConstraintKind kind, const NodeId& from, const NodeId& to, const Pose3& from_from_to, double sigma_m,
                         double sigma_rad) {
  const double m = 1.0 / (sigma_m * sigma_m), rad = 1.0 / (sigma_rad * sigma_rad);
  return planar_constraint({kind, from, to, 0}, planar(from_from_to), Eigen::Vector3d(m, m, rad).asDiagonal());
}

std::vector<Constraint> steps_of(const Map& map, const BindOptions& options) {
  std::vector<Constraint> result;
  for (const Step& step : steps(covisibility(map), options.least_shared)) {
    const Pose3 moved_by = between(step.from->map_from_node, step.to->map_from_node);
    result.push_back(constraint_of(ConstraintKind::scan_match, step.from->id, step.to->id, moved_by,
                                   options.step_m + options.step_share * moved_by.t.norm(), options.step_rad));
  }
  return result;
}

Constraint tie_of(const VisualWitness& w, const VisualMap& a, const VisualMap& b, double scale_a, double scale_b) {
  const MetricWitness metric = in_lengths(w, a, b, scale_a, scale_b);
  Constraint constraint;
  constraint.id = {ConstraintKind::between_maps, a.keyframes()[w.keyframe_a].id, b.keyframes()[w.keyframe_b].id, 0};
  constraint.from_from_to.pose = metric.node_a_from_node_b;
  constraint.information = spatial(planar(metric.information));
  constraint.because = w.judgement.id;
  return constraint;
}

Constraint tie_of(const Witness& w, const PreparedMap& a, const PreparedMap& b) {
  // Submaps bend a little once their nodes move on their own.
  const Eigen::Matrix3d floor = Eigen::Vector3d(9e-4, 9e-4, 9e-6).asDiagonal();
  const Eigen::Matrix3d information = (w.submap_information.inverse() + floor).inverse();
  Constraint constraint =
      planar_constraint({ConstraintKind::between_maps, a.submaps[w.submap_a]->anchor(), b.submaps[w.submap_b]->anchor(), 0},
                        w.submap_a_from_submap_b, 0.5 * (information + information.transpose()));
  constraint.because = w.judgement.id;
  return constraint;
}

void add_all(Map& map, std::vector<Constraint> constraints) {
  std::vector<Constraint> all;
  all.reserve(map.constraints.size() + constraints.size());
  for (auto& entry : map.constraints) all.push_back(std::move(entry.second));
  for (auto& constraint : constraints) all.push_back(std::move(constraint));
  std::stable_sort(all.begin(), all.end(), [](const Constraint& l, const Constraint& r) { return l.id < r.id; });
  map.constraints = {};
  map.constraints.reserve(all.size());
  for (auto& constraint : all) {
    const ConstraintId id = constraint.id;
    map.constraints.set(id, std::move(constraint));
  }
}

}  // namespace mapweave::fusion
