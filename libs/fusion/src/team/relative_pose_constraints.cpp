#include "relative_pose_constraints.h"

#include <mapweave/maps/map_noise.h>

#include <Eigen/LU>
#include <algorithm>

namespace mapweave::fusion {

Constraint constraint_of(const VisualWitness& w, const VisualMap& a, const VisualMap& b, double scale_a,
                         double scale_b) {
  const MetricWitness metric = rescaled(w, a, b, scale_a, scale_b);
  Constraint constraint;
  constraint.id = {ConstraintKind::between_maps, a.keyframes()[w.keyframe_a].id, b.keyframes()[w.keyframe_b].id, 0};
  constraint.from_from_to.pose = metric.node_a_from_node_b;
  constraint.information = spatial(planar(metric.information));
  constraint.because = w.judgement.id;
  return constraint;
}

Constraint constraint_of(const Witness& w, const PreparedMap& a, const PreparedMap& b) {
  const Eigen::Matrix3d information = (w.submap_information.inverse() + team_anchors_covariance()).inverse();
  Constraint constraint = planar_constraint(
      {ConstraintKind::between_maps, a.submaps[w.submap_a]->anchor(), b.submaps[w.submap_b]->anchor(), 0},
      w.submap_a_from_submap_b, 0.5 * (information + information.transpose()));
  constraint.because = w.judgement.id;
  return constraint;
}

void add_constraints(Map& map, std::vector<Constraint> constraints) {
  // They are large: what is sorted is where they are.
  std::vector<Constraint*> all;
  all.reserve(map.constraints.size() + constraints.size());
  for (auto& entry : map.constraints) all.push_back(&entry.second);
  for (Constraint& constraint : constraints) all.push_back(&constraint);
  std::stable_sort(all.begin(), all.end(), [](const Constraint* l, const Constraint* r) { return l->id < r->id; });
  Table<ConstraintId, Constraint> sorted;
  sorted.reserve(all.size());
  for (Constraint* constraint : all) {
    const ConstraintId id = constraint->id;
    sorted.set(id, std::move(*constraint));
  }
  map.constraints = std::move(sorted);
}

}  // namespace mapweave::fusion
