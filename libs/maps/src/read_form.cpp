#include "bulk.h"
#include "dense_points.h"
#include "form.h"
#include "soundness.h"

#include <cmath>

namespace mapweave {
namespace {

constexpr double kAsItIs = 1e-12;  // a quaternion whose norm is this near to 1 keeps its bits

// Numbers of an enumeration; one too large for it becomes one that no soundness rule lets pass.
template <class Enumeration>
Enumeration enumerated(std::uint32_t number) {
  return static_cast<Enumeration>(static_cast<std::uint8_t>(std::min<std::uint32_t>(number, 255)));
}

}  // namespace

void FormReader::corrupt(const std::string& what) const {
  throw Error(ErrorCode::kCorrupt, what, place_.empty() ? where_ : where_ + ", " + place_,
              "make the file again, or take an undamaged copy");
}

template <class Value>
void FormReader::require_sound(const Value& value) const {
  if (const std::string problem = problem_with(value); !problem.empty()) corrupt(problem);
}

std::string FormReader::name_or_nothing(const std::string& text, const char* of_what) const {
  if (!text.empty() && !is_valid_name(text)) corrupt("the name of a " + std::string(of_what) + " is not valid");
  return text;
}

void FormReader::take_session(const form::Session& form) {
  SessionId session;  // names are kept for ever: look at them before
  session.client.robot = RobotId(name_or_nothing(form.robot(), "robot"));
  session.client.sensor = SensorId(name_or_nothing(form.sensor(), "sensor"));
  session.run = form.run_ns();
  require_sound(session);
  if (!sessions_.empty() && !(sessions_.back() < session)) corrupt("the sessions are not in ascending order");
  sessions_.push_back(session);
}

void FormReader::take_geometry(const form::ScanGeometry& form) {
  ScanGeometry geometry;
  geometry.first_angle_rad = form.first_angle_rad();
  geometry.angle_step_rad = form.angle_step_rad();
  geometry.ray_count = form.ray_count();
  geometry.max_range_m = form.max_range_m();
  geometry.range_unit_m = form.range_unit_m();
  geometry.robot_from_laser = pose(form.robot_from_laser());
  geometry.first_ray_s = form.first_ray_s();
  geometry.ray_step_s = form.ray_step_s();
  require_sound(geometry);
  geometries_.push_back(std::make_shared<const ScanGeometry>(geometry));
}

void FormReader::take_camera(const form::CameraGeometry& form) {
  CameraGeometry camera;
  camera.width = static_cast<std::int32_t>(std::min<std::uint32_t>(form.width(), kMostPictureSide + 1));
  camera.height = static_cast<std::int32_t>(std::min<std::uint32_t>(form.height(), kMostPictureSide + 1));
  camera.fx = form.fx();
  camera.fy = form.fy();
  camera.cx = form.cx();
  camera.cy = form.cy();
  camera.baseline_m = form.baseline_m();
  camera.level_scale = form.level_scale();
  camera.robot_from_camera = pose(form.robot_from_camera());
  require_sound(camera);
  cameras_.push_back(std::make_shared<const CameraGeometry>(camera));
}

SessionId FormReader::session(std::uint32_t place) const {
  if (place >= sessions_.size())
    corrupt("session " + std::to_string(place) + " of a table of " + std::to_string(sessions_.size()));
  return sessions_[place];
}

Hash FormReader::hash(const std::string& bytes) const {
  Hash hash;
  if (bytes.size() != hash.bytes.size())
    corrupt("a hash of " + std::to_string(bytes.size()) + " bytes; 32 are expected");
  std::copy(bytes.begin(), bytes.end(), hash.bytes.begin());
  return hash;
}

Pose3 FormReader::pose(const form::Pose& form) const {
  Pose3 pose;
  if (form.planar_size() == 3) {
    pose = spatial(Pose2{form.planar(0), form.planar(1), form.planar(2)});
    require_sound(pose);
    return pose;
  }
  if (form.planar_size() != 0) corrupt("a planar pose of " + std::to_string(form.planar_size()) + " numbers");
  pose.t = {form.x(), form.y(), form.z()};
  pose.q = Eigen::Quaterniond(form.qw(), form.qx(), form.qy(), form.qz());
  require_sound(pose);
  if (std::abs(pose.q.norm() - 1.0) > kAsItIs) pose.q.normalize();
  return pose;
}

Sim3 FormReader::similarity(const form::Similarity& form) const {
  return {pose(form.pose()), form.scale() == 0.0 ? 1.0 : form.scale()};
}

Eigen::Matrix<double, 6, 6> FormReader::matrix(const form::Matrix6& form) const {
  if (form.floats_size() == 0) return matrix_of(form.numbers());
  if (form.numbers_size() != 0) corrupt("a matrix has its numbers twice");
  return matrix_of(form.floats());
}

template <class Numbers>
Eigen::Matrix<double, 6, 6> FormReader::matrix_of(const Numbers& numbers) const {
  Eigen::Matrix<double, 6, 6> matrix = Eigen::Matrix<double, 6, 6>::Zero();
  int next = 0;
  if (numbers.size() == 36) {
    for (int row = 0; row < 6; ++row)
      for (int column = 0; column < 6; ++column) matrix(row, column) = numbers[next++];
  } else if (numbers.size() == 21) {
    for (int row = 0; row < 6; ++row)
      for (int column = row; column < 6; ++column) matrix(row, column) = matrix(column, row) = numbers[next++];
  } else if (numbers.size() == 6) {
    for (int row = 0; row < 3; ++row)
      for (int column = row; column < 3; ++column) {
        const double number = numbers[next++];
        matrix(kPlanarAxes[row], kPlanarAxes[column]) = matrix(kPlanarAxes[column], kPlanarAxes[row]) = number;
      }
  } else {
    corrupt("a matrix of " + std::to_string(numbers.size()) + " numbers; 6, 21 or 36 are expected");
  }
  return matrix;
}

Alignment FormReader::alignment(const form::Alignment& form) const {
  return {similarity(form.a_from_b()), matrix(form.covariance())};
}

NodeId FormReader::node_id(const form::Id& form) const { return {session(form.session()), form.index()}; }

SubmapId FormReader::submap_id(const form::Id& form) const { return {session(form.session()), form.index()}; }

LandmarkId FormReader::landmark_id(const form::Id& form) const { return {session(form.session()), form.index()}; }

ConstraintId FormReader::constraint_id(const form::ConstraintId& form) const {
  const ConstraintId id{enumerated<ConstraintKind>(form.kind()), node_id(form.from()), node_id(form.to()),
                        form.index()};
  require_sound(id);
  return id;
}

PackedScan FormReader::scan(const form::Scan& form) const {
  if (form.geometry() >= geometries_.size())
    corrupt("geometry " + std::to_string(form.geometry()) + " of a table of " + std::to_string(geometries_.size()));
  const auto& geometry = geometries_[form.geometry()];
  if (form.ranges().size() != std::size_t{2} * geometry->ray_count)
    corrupt("a scan of " + std::to_string(form.ranges().size()) + " bytes; " + std::to_string(geometry->ray_count) +
            " rays need twice as many");
  const auto thousandths = [&](std::int32_t number) {
    if (number < -32768 || number > 32767) corrupt("a robot that moves faster than 32 m/s or 32 rad/s");
    return static_cast<std::int16_t>(number);
  };
  const SweepMotion motion{thousandths(form.x_mm_s()), thousandths(form.y_mm_s()), thousandths(form.yaw_mrad_s())};
  if (!motion.is_zero() && !geometry->has_sweep()) corrupt("a scan has a motion, and its laser no sweep");
  return {geometry, unpacked<std::uint16_t>(form.ranges()), motion};
}

OccupancyGrid FormReader::grid(const form::Grid& form) const {
  if (form.columns() > static_cast<std::uint32_t>(kMostGridSide) ||
      form.rows() > static_cast<std::uint32_t>(kMostGridSide) ||
      form.log_odds().size() != std::uint64_t{2} * form.columns() * form.rows())
    corrupt("a grid of " + std::to_string(form.log_odds().size()) + " bytes for " + std::to_string(form.columns()) +
            " x " + std::to_string(form.rows()) + " cells; twice as many are expected, and at most " +
            std::to_string(kMostGridSide) + " a side");
  OccupancyGrid grid;
  grid.resolution_m = form.resolution_m();
  grid.origin_x_m = form.origin_x_m();
  grid.origin_y_m = form.origin_y_m();
  grid.columns = static_cast<std::int32_t>(form.columns());
  grid.rows = static_cast<std::int32_t>(form.rows());
  grid.log_odds = unpacked<std::int16_t>(form.log_odds());
  return grid;
}

KeyframeFeatures FormReader::keyframe(const form::Keyframe& form) const {
  if (form.geometry() >= cameras_.size())
    corrupt("camera " + std::to_string(form.geometry()) + " of a table of " + std::to_string(cameras_.size()));
  const std::size_t count = form.descriptors().size() / kDescriptorBytes;
  if (!form.dense().empty()) {
    auto points =
        form.points().empty() && count <= kMostFeatures && form.descriptors().size() == count * kDescriptorBytes
            ? from_dense(form.dense(), count)
            : std::nullopt;
    if (!points) corrupt("a keyframe's dense points are not those of its descriptors");
    return {cameras_[form.geometry()], std::move(*points), unpacked_descriptors(form.descriptors())};
  }
  if (count > kMostFeatures || form.points().size() != count * kPointBytes ||
      form.descriptors().size() != count * kDescriptorBytes)
    corrupt("a keyframe of " + std::to_string(form.points().size()) + " bytes of points and " +
            std::to_string(form.descriptors().size()) + " of descriptors; " + std::to_string(kPointBytes) + " and " +
            std::to_string(kDescriptorBytes) + " for each feature are expected, of at most " +
            std::to_string(kMostFeatures));
  return {cameras_[form.geometry()], unpacked_points(form.points()), unpacked_descriptors(form.descriptors())};
}

std::shared_ptr<const Payload> FormReader::payload(const form::Node& form) const {
  if (form.has_scan()) return std::make_shared<const Payload>(scan(form.scan()));
  if (form.has_grid()) return std::make_shared<const Payload>(grid(form.grid()));
  if (form.has_keyframe()) return std::make_shared<const Payload>(keyframe(form.keyframe()));
  return nullptr;
}

Node FormReader::node(const form::Node& form) const {
  Node node;
  node.id = node_id(form.id());
  node.stamp.ns = static_cast<std::int64_t>(static_cast<std::uint64_t>(node.id.session.run) +
                                            static_cast<std::uint64_t>(form.stamp_after_run_ns()));
  node.map_from_node = pose(form.map_from_node());
  node.payload = payload(form);
  require_sound(node);
  return node;
}

MovedNode FormReader::moved(const form::MovedNode& form) const {
  return {node_id(form.id()), pose(form.map_from_node())};
}

Submap FormReader::submap(const form::Submap& form) const {
  Submap submap;
  submap.id = submap_id(form.id());
  for (const auto& member : form.members())
    submap.submap_from_node.emplace_back(node_id(member.node()), pose(member.submap_from_node()));
  submap.frozen = form.frozen();
  if (!form.content().empty()) submap.content = hash(form.content());
  require_sound(submap);
  return submap;
}

Constraint FormReader::constraint(const form::Constraint& form) const {
  Constraint constraint;
  constraint.id = constraint_id(form.id());
  constraint.from_from_to = similarity(form.from_from_to());
  constraint.information = matrix(form.information());
  if (!form.because().empty()) constraint.because = hash(form.because());
  require_sound(constraint);
  return constraint;
}

Judgement FormReader::judgement(const form::Judgement& form) const {
  Judgement judgement;
  judgement.id = hash(form.id());
  judgement.a = submap_id(form.a());
  judgement.b = submap_id(form.b());
  judgement.content_a = hash(form.content_a());
  judgement.content_b = hash(form.content_b());
  for (const auto& hypothesis : form.hypotheses()) judgement.hypotheses.push_back(alignment(hypothesis));
  judgement.scores.assign(form.scores().begin(), form.scores().end());
  const auto& from = form.evidence();
  Evidence& evidence = judgement.evidence;
  evidence.overlap_m2 = from.overlap_m2();
  evidence.overlap = from.overlap();
  evidence.inliers = from.inliers();
  evidence.conflict = from.conflict();
  evidence.longest_contradiction_m[0] = from.longest_contradiction_a_m();
  evidence.longest_contradiction_m[1] = from.longest_contradiction_b_m();
  evidence.second_best_ratio = from.second_best_ratio();
  evidence.verifier_inliers = from.verifier_inliers();
  evidence.verifier_disagreement_m = from.verifier_disagreement_m();
  evidence.observability = {from.observability_better(), from.observability_worse(), from.observability_yaw()};
  judgement.probability = form.probability();
  judgement.doubt = enumerated<Reason>(form.doubt());
  require_sound(judgement);
  return judgement;
}

Verdict FormReader::verdict(const form::Verdict& form) const {
  Verdict verdict;
  verdict.a = MapId(name_or_nothing(form.a(), "map"));
  verdict.b = MapId(name_or_nothing(form.b(), "map"));
  verdict.by = TierId(name_or_nothing(form.by(), "tier"));
  verdict.kind = form.kind();
  verdict.proposer = form.proposer();
  verdict.decision = enumerated<Decision>(form.decision());
  verdict.reason = enumerated<Reason>(form.reason());
  if (form.has_alignment()) verdict.alignment = alignment(form.alignment());
  verdict.probability = form.probability();
  verdict.overlap = form.overlap();
  verdict.conflict = form.conflict();
  verdict.second_best = form.second_best();
  for (const auto& id : form.witnesses()) verdict.witnesses.push_back(hash(id));
  for (const auto& id : form.contradicted()) verdict.contradicted.push_back(hash(id));
  require_sound(verdict);
  return verdict;
}

template <class Form>
Eigen::Vector3i FormReader::point(const Form& form) const {
  if (form.point_size() != 3)
    corrupt("a landmark's point of " + std::to_string(form.point_size()) + " numbers; 3 are expected");
  return {form.point(0), form.point(1), form.point(2)};
}

template <class Form>
std::vector<LandmarkSighting> FormReader::sightings(const Form& form, const SessionId& own) const {
  const auto count = static_cast<std::size_t>(form.nodes_size());
  const bool all_own = form.sessions_size() == 0;
  if (form.places().size() != kPictureBytes * count || !(all_own || form.sessions_size() == form.nodes_size()))
    corrupt("a landmark seen by " + std::to_string(count) + " nodes of " + std::to_string(form.sessions_size()) +
            " sessions, at places of " + std::to_string(form.places().size()) + " bytes; " +
            std::to_string(kPictureBytes) + " for each node are expected");
  const std::string_view places = form.places();
  std::vector<LandmarkSighting> seen(count);
  for (std::size_t i = 0; i < count; ++i) {
    const int at = static_cast<int>(i);
    seen[i].node = {all_own ? own : session(form.sessions(at)), form.nodes(at)};
    take_picture_point(seen[i], places.substr(kPictureBytes * i, kPictureBytes));
  }
  return seen;
}

Landmark FormReader::landmark(const form::Landmark& form) const {
  Landmark landmark;
  landmark.id = landmark_id(form.id());
  landmark.anchor = {landmark.id.session, form.anchor()};
  landmark.point_units = point(form);
  if (form.colour() > 0xffffff)
    corrupt("a landmark's colour is " + std::to_string(form.colour()) + "; at most 16777215 is expected");
  landmark.colour = {static_cast<std::uint8_t>(form.colour() >> 16),
                     static_cast<std::uint8_t>(form.colour() >> 8 & 0xff),
                     static_cast<std::uint8_t>(form.colour() & 0xff)};
  landmark.seen = sightings(form, landmark.id.session);
  require_sound(landmark);
  return landmark;
}

LandmarkChange FormReader::landmark_change(const form::LandmarkChange& form) const {
  LandmarkChange change;
  change.id = landmark_id(form.id());
  if (form.point_size() > 0) change.point_units = point(form);
  change.seen = sightings(form, change.id.session);
  require_sound(change);
  return change;
}

}  // namespace mapweave
