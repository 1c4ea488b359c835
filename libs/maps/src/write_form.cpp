#include "bulk.h"
#include "dense_points.h"
#include "form.h"
#include "sameness.h"

#include <mapweave/maps/in_floats.h>

namespace mapweave {
namespace {

std::string bytes_of(const Hash& hash) { return std::string(hash.bytes.begin(), hash.bytes.end()); }

void fill(form::Pose& form, const Pose3& pose) {
  form.set_x(pose.t.x());
  form.set_y(pose.t.y());
  form.set_z(pose.t.z());
  form.set_qx(pose.q.x());
  form.set_qy(pose.q.y());
  form.set_qz(pose.q.z());
  form.set_qw(pose.q.w());
}

void fill(form::Similarity& form, const Sim3& similarity) {
  fill(*form.mutable_pose(), similarity.pose);
  if (similarity.scale != 1.0) form.set_scale(similarity.scale);
}

void fill(form::Matrix6& form, const Eigen::Matrix<double, 6, 6>& matrix) {
  using Matrix = Eigen::Matrix<double, 6, 6>;
  Matrix planar = Matrix::Zero();
  for (const int row : kPlanarAxes)
    for (const int column : kPlanarAxes) planar(row, column) = matrix(row, column);
  if (!same(matrix, Matrix(matrix.transpose()))) {
    for (int row = 0; row < 6; ++row)
      for (int column = 0; column < 6; ++column) form.add_numbers(matrix(row, column));
  } else if (!same(matrix, planar)) {
    for (int row = 0; row < 6; ++row)
      for (int column = row; column < 6; ++column) form.add_numbers(matrix(row, column));
  } else {
    for (int row = 0; row < 3; ++row)
      for (int column = row; column < 3; ++column) form.add_numbers(matrix(kPlanarAxes[row], kPlanarAxes[column]));
  }
}

void shorten(form::Pose& form) {
  const Pose3 pose{{form.x(), form.y(), form.z()}, {form.qw(), form.qx(), form.qy(), form.qz()}};
  const Pose2 rounded = in_floats(planar(pose));
  if (!same(spatial(rounded), pose)) return;
  form::Pose shorter;
  for (const double number : {rounded.x, rounded.y, rounded.phi}) shorter.add_planar(static_cast<float>(number));
  if (shorter.ByteSizeLong() < form.ByteSizeLong()) form = shorter;
}

void shorten(form::Matrix6& form) {
  const auto is_float = [](double number) { return same(in_float(number), number); };
  if (!std::all_of(form.numbers().begin(), form.numbers().end(), is_float)) return;
  for (const double number : form.numbers()) form.add_floats(static_cast<float>(number));
  form.clear_numbers();
}

void fill(form::Alignment& form, const Alignment& alignment) {
  fill(*form.mutable_a_from_b(), alignment.a_from_b);
  fill(*form.mutable_covariance(), alignment.covariance);
}

void fill(form::Evidence& form, const Evidence& evidence) {
  form.set_overlap_m2(evidence.overlap_m2);
  form.set_overlap(evidence.overlap);
  form.set_inliers(evidence.inliers);
  form.set_conflict(evidence.conflict);
  form.set_longest_contradiction_a_m(evidence.longest_contradiction_m[0]);
  form.set_longest_contradiction_b_m(evidence.longest_contradiction_m[1]);
  form.set_second_best_ratio(evidence.second_best_ratio);
  form.set_verifier_inliers(evidence.verifier_inliers);
  form.set_verifier_disagreement_m(evidence.verifier_disagreement_m);
  form.set_observability_better(evidence.observability.x());
  form.set_observability_worse(evidence.observability.y());
  form.set_observability_yaw(evidence.observability.z());
}

template <class AnyId>
void fill(form::Id& form, const AnyId& id, const SessionTable& sessions) {
  form.set_session(sessions.place(id.session));
  form.set_index(id.index);
}

void fill(form::ConstraintId& form, const ConstraintId& id, const SessionTable& sessions) {
  form.set_kind(static_cast<std::uint32_t>(id.kind));
  fill(*form.mutable_from(), id.from, sessions);
  fill(*form.mutable_to(), id.to, sessions);
  form.set_index(id.index);
}

void fill(form::Scan& form, const PackedScan& scan, const Geometries& geometries) {
  form.set_geometry(geometries.lasers.place(scan.geometry));
  fill_measured(form, scan);
}

void fill(form::Grid& form, const OccupancyGrid& grid) {
  form.set_resolution_m(grid.resolution_m);
  form.set_origin_x_m(grid.origin_x_m);
  form.set_origin_y_m(grid.origin_y_m);
  form.set_columns(static_cast<std::uint32_t>(grid.columns));
  form.set_rows(static_cast<std::uint32_t>(grid.rows));
  form.set_log_odds(packed(grid.log_odds));
}

void fill(form::Keyframe& form, const KeyframeFeatures& keyframe, const Geometries& geometries) {
  form.set_geometry(geometries.cameras.place(keyframe.geometry));
  if (can_be_dense(keyframe.points))
    form.set_dense(dense(keyframe.points));
  else
    form.set_points(packed(keyframe.points));
  form.set_descriptors(packed(keyframe.descriptors));
}

template <class Form>
void fill_point(Form& form, const Eigen::Vector3i& point_units) {
  for (int axis = 0; axis < 3; ++axis) form.add_point(point_units(axis));
}

template <class Form>
void fill_sightings(Form& form, const std::vector<LandmarkSighting>& seen, const SessionId& own,
                    const SessionTable& sessions) {
  const bool all_own =
      std::all_of(seen.begin(), seen.end(), [&](const LandmarkSighting& s) { return s.node.session == own; });
  std::string places;
  places.reserve(kPictureBytes * seen.size());
  for (const LandmarkSighting& sighting : seen) {
    if (!all_own) form.add_sessions(sessions.place(sighting.node.session));
    form.add_nodes(sighting.node.index);
    append_picture_point(places, sighting);
  }
  form.set_places(std::move(places));
}

}  // namespace

void SessionTable::sort() {
  std::sort(sessions_.begin(), sessions_.end());
  sessions_.erase(std::unique(sessions_.begin(), sessions_.end()), sessions_.end());
}

std::uint32_t SessionTable::place(const SessionId& session) const {
  const auto found = std::lower_bound(sessions_.begin(), sessions_.end(), session);
  MAPWEAVE_EXPECT(found != sessions_.end() && *found == session, "every session was collected: " + to_string(session));
  return static_cast<std::uint32_t>(found - sessions_.begin());
}

form::Session form_of(const SessionId& session) {
  form::Session form;
  form.set_robot(session.client.robot.str());
  form.set_sensor(session.client.sensor.str());
  form.set_run_ns(session.run);
  return form;
}

form::ScanGeometry form_of(const ScanGeometry& geometry) {
  form::ScanGeometry form;
  form.set_first_angle_rad(geometry.first_angle_rad);
  form.set_angle_step_rad(geometry.angle_step_rad);
  form.set_ray_count(geometry.ray_count);
  form.set_max_range_m(geometry.max_range_m);
  form.set_range_unit_m(geometry.range_unit_m);
  fill(*form.mutable_robot_from_laser(), geometry.robot_from_laser);
  form.set_first_ray_s(geometry.first_ray_s);
  form.set_ray_step_s(geometry.ray_step_s);
  return form;
}

void fill_measured(form::Scan& form, const PackedScan& scan) {
  form.set_ranges(packed(scan.ranges));
  form.set_x_mm_s(scan.motion.x_mm_s);
  form.set_y_mm_s(scan.motion.y_mm_s);
  form.set_yaw_mrad_s(scan.motion.yaw_mrad_s);
}

form::CameraGeometry form_of(const CameraGeometry& camera) {
  form::CameraGeometry form;
  form.set_width(static_cast<std::uint32_t>(camera.width));
  form.set_height(static_cast<std::uint32_t>(camera.height));
  form.set_fx(camera.fx);
  form.set_fy(camera.fy);
  form.set_cx(camera.cx);
  form.set_cy(camera.cy);
  form.set_baseline_m(camera.baseline_m);
  form.set_level_scale(camera.level_scale);
  fill(*form.mutable_robot_from_camera(), camera.robot_from_camera);
  return form;
}

form::Id form_of(const NodeId& id, const SessionTable& sessions) {
  form::Id form;
  fill(form, id, sessions);
  return form;
}

form::Id form_of(const SubmapId& id, const SessionTable& sessions) {
  form::Id form;
  fill(form, id, sessions);
  return form;
}

form::Id form_of(const LandmarkId& id, const SessionTable& sessions) {
  form::Id form;
  fill(form, id, sessions);
  return form;
}

form::Node form_of(const Node& node, const SessionTable& sessions, const Geometries& geometries) {
  form::Node form;
  fill(*form.mutable_id(), node.id, sessions);
  const auto after_run = static_cast<std::uint64_t>(node.stamp.ns) - static_cast<std::uint64_t>(node.id.session.run);
  form.set_stamp_after_run_ns(static_cast<std::int64_t>(after_run));
  fill(*form.mutable_map_from_node(), node.map_from_node);
  if (node.payload == nullptr) return form;
  if (const auto* scan = std::get_if<PackedScan>(node.payload.get())) fill(*form.mutable_scan(), *scan, geometries);
  if (const auto* grid = std::get_if<OccupancyGrid>(node.payload.get())) fill(*form.mutable_grid(), *grid);
  if (const auto* keyframe = std::get_if<KeyframeFeatures>(node.payload.get()))
    fill(*form.mutable_keyframe(), *keyframe, geometries);
  return form;
}

form::MovedNode form_of(const MovedNode& moved, const SessionTable& sessions) {
  form::MovedNode form;
  fill(*form.mutable_id(), moved.id, sessions);
  fill(*form.mutable_map_from_node(), moved.map_from_node);
  return form;
}

form::Submap form_of(const Submap& submap, const SessionTable& sessions) {
  form::Submap form;
  fill(*form.mutable_id(), submap.id, sessions);
  for (const auto& [id, submap_from_node] : submap.submap_from_node) {
    auto& member = *form.add_members();
    fill(*member.mutable_node(), id, sessions);
    fill(*member.mutable_submap_from_node(), submap_from_node);
  }
  form.set_frozen(submap.frozen);
  if (submap.content != Hash{}) form.set_content(bytes_of(submap.content));
  return form;
}

form::ConstraintId form_of(const ConstraintId& id, const SessionTable& sessions) {
  form::ConstraintId form;
  fill(form, id, sessions);
  return form;
}

form::Constraint form_of(const Constraint& constraint, const SessionTable& sessions) {
  form::Constraint form;
  fill(*form.mutable_id(), constraint.id, sessions);
  fill(*form.mutable_from_from_to(), constraint.from_from_to);
  fill(*form.mutable_information(), constraint.information);
  if (constraint.because) form.set_because(bytes_of(*constraint.because));
  return form;
}

void shorten(form::Node& node) { shorten(*node.mutable_map_from_node()); }
void shorten(form::MovedNode& moved) { shorten(*moved.mutable_map_from_node()); }
void shorten(form::Submap& submap) {
  for (auto& member : *submap.mutable_members()) shorten(*member.mutable_submap_from_node());
}
void shorten(form::Constraint& constraint) {
  shorten(*constraint.mutable_from_from_to()->mutable_pose());
  shorten(*constraint.mutable_information());
}

form::Judgement form_of(const Judgement& judgement, const SessionTable& sessions) {
  form::Judgement form;
  form.set_id(bytes_of(judgement.id));
  fill(*form.mutable_a(), judgement.a, sessions);
  fill(*form.mutable_b(), judgement.b, sessions);
  form.set_content_a(bytes_of(judgement.content_a));
  form.set_content_b(bytes_of(judgement.content_b));
  for (const Alignment& alignment : judgement.hypotheses) fill(*form.add_hypotheses(), alignment);
  for (const double score : judgement.scores) form.add_scores(score);
  fill(*form.mutable_evidence(), judgement.evidence);
  form.set_probability(judgement.probability);
  form.set_doubt(static_cast<std::uint32_t>(judgement.doubt));
  return form;
}

form::Landmark form_of(const Landmark& landmark, const SessionTable& sessions) {
  form::Landmark form;
  fill(*form.mutable_id(), landmark.id, sessions);
  form.set_anchor(landmark.anchor.index);
  fill_point(form, landmark.point_units);
  const auto& [red, green, blue] = landmark.colour;
  form.set_colour(static_cast<std::uint32_t>(red << 16 | green << 8 | blue));
  fill_sightings(form, landmark.seen, landmark.id.session, sessions);
  return form;
}

form::LandmarkChange form_of(const LandmarkChange& change, const SessionTable& sessions) {
  form::LandmarkChange form;
  fill(*form.mutable_id(), change.id, sessions);
  if (change.point_units) fill_point(form, *change.point_units);
  fill_sightings(form, change.seen, change.id.session, sessions);
  return form;
}

form::Pose form_of(const Pose3& pose) {
  form::Pose form;
  fill(form, pose);
  return form;
}

form::Keyframe form_of(const KeyframeFeatures& keyframe, const Geometries& geometries) {
  form::Keyframe form;
  fill(form, keyframe, geometries);
  return form;
}

form::Verdict form_of(const Verdict& verdict) {
  form::Verdict form;
  form.set_a(verdict.a.str());
  form.set_b(verdict.b.str());
  form.set_by(verdict.by.str());
  form.set_kind(verdict.kind);
  form.set_proposer(verdict.proposer);
  form.set_decision(static_cast<std::uint32_t>(verdict.decision));
  form.set_reason(static_cast<std::uint32_t>(verdict.reason));
  if (verdict.alignment) fill(*form.mutable_alignment(), *verdict.alignment);
  form.set_probability(verdict.probability);
  form.set_overlap(verdict.overlap);
  form.set_conflict(verdict.conflict);
  form.set_second_best(verdict.second_best);
  for (const Hash& id : verdict.witnesses) form.add_witnesses(bytes_of(id));
  for (const Hash& id : verdict.contradicted) form.add_contradicted(bytes_of(id));
  return form;
}

}  // namespace mapweave
