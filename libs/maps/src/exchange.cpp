#include "bulk.h"
#include "exchange_form.h"
#include "soundness.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace mapweave {
namespace {

constexpr double kLeastDistance_m = 0.05, kLeastSigma_m = 1e-4,
                 kGrowth = 1.06;  // of distances and deviations from one number to the next
constexpr double kHalf = 127.0;   // of the 8 bits of an octahedron's side

double sign(double x) { return x < 0.0 ? -1.0 : 1.0; }

// A unit vector as a point of an octahedron that is folded open (Meyer et al., On Floating-Point Normal Vectors, 2010).
std::uint32_t packed_direction(const Eigen::Vector3d& direction) {
  if (direction.isZero(0.0)) return 0;
  const Eigen::Vector3d p = direction / direction.lpNorm<1>();
  double u = p.x(), v = p.y();
  if (p.z() < 0.0) {
    u = (1.0 - std::abs(p.y())) * sign(p.x());
    v = (1.0 - std::abs(p.x())) * sign(p.y());
  }
  const auto bits = [](double x) { return static_cast<std::uint32_t>(std::lround(x * kHalf + kHalf)) + 1; };
  return bits(u) << 8 | bits(v);
}

Eigen::Vector3d unpacked_direction(std::uint32_t packed) {
  if (packed == 0) return Eigen::Vector3d::Zero();
  const auto side = [](std::uint32_t bits) {
    return std::clamp((static_cast<double>(bits) - 1.0 - kHalf) / kHalf, -1.0, 1.0);
  };
  const double u = side(packed >> 8 & 0xff), v = side(packed & 0xff), z = 1.0 - std::abs(u) - std::abs(v);
  if (z >= 0.0) return Eigen::Vector3d(u, v, z).normalized();
  return Eigen::Vector3d((1.0 - std::abs(v)) * sign(u), (1.0 - std::abs(u)) * sign(v), z).normalized();
}

std::uint32_t steps_of(double length_m, double unit_m) {
  return static_cast<std::uint32_t>(
      std::lround(std::clamp(std::log(length_m / unit_m) / std::log(kGrowth), 0.0, 254.0)));
}
std::uint32_t packed_distance(double distance_m) {
  return distance_m > 0.0 ? steps_of(distance_m, kLeastDistance_m) + 1 : 0;
}
double unpacked_distance(std::uint32_t packed) {
  return packed == 0 ? 0.0 : kLeastDistance_m * std::pow(kGrowth, packed - 1);
}

void expect_sound_name(const MapId& map) { MAPWEAVE_EXPECT(is_valid_name(map.str()), "a message speaks of a map"); }
template <class Value>
void expect_sound(const Value& value) {
  const std::string problem = problem_with(value);
  MAPWEAVE_EXPECT(problem.empty(), "only sound values are sent: " + problem);
}

template <class Repeated>
void fill_landmarks(Repeated& form, const std::vector<DescribedLandmark>& landmarks, const SessionTable& sessions) {
  for (const DescribedLandmark& landmark : landmarks) *form.Add() = form_of(landmark, sessions);
}

SessionTable sessions_of(const std::vector<DescribedLandmark>& landmarks,
                         const std::vector<MovedNode>& corrected = {}) {
  SessionTable sessions;
  for (const DescribedLandmark& landmark : landmarks) {
    expect_sound(landmark.id.session);
    sessions.add(landmark.id.session);
  }
  for (const MovedNode& moved : corrected) {
    expect_sound(moved);
    sessions.add(moved.id.session);
  }
  sessions.sort();
  return sessions;
}

SessionTable sessions_of(const Share& share) {
  std::vector<DescribedLandmark> landmarks = share.landmarks;
  for (const SharedKeyframe& keyframe : share.keyframes)
    landmarks.insert(landmarks.end(), keyframe.landmarks.begin(), keyframe.landmarks.end());
  SessionTable sessions = sessions_of(landmarks, share.corrected);
  const auto add = [&](const NodeId& id) {
    expect_sound(id.session);
    sessions.add(id.session);
  };
  for (const SharedKeyframe& keyframe : share.keyframes) add(keyframe.id);
  for (const NodeId& id : share.dropped) add(id);
  sessions.sort();
  return sessions;
}

bool is_scale(double scale) { return std::isfinite(scale) && scale > 0.0; }

std::string problem_with(const KeyframeFeatures& features) {
  return problem_with(Node{{}, {}, {}, std::make_shared<const Payload>(features)});
}

MapId map_name(const std::string& name, const FormReader& reader) {
  if (name.empty()) reader.corrupt("it names no map");
  return MapId(reader.name_or_nothing(name, "map"));
}

template <class Repeated>
std::vector<DescribedLandmark> landmarks_of(const Repeated& forms, const FormReader& reader) {
  std::vector<DescribedLandmark> landmarks;
  landmarks.reserve(static_cast<std::size_t>(forms.size()));
  for (const auto& form : forms) landmarks.push_back(reader.shared_landmark(form));
  return landmarks;
}

form::SharedKeyframe form_of(const SharedKeyframe& keyframe, const SessionTable& sessions) {
  expect_sound(keyframe.map_from_camera);
  MAPWEAVE_EXPECT(is_scale(keyframe.scale), "a scale is a positive number");
  MAPWEAVE_EXPECT(keyframe.landmarks.size() <= kMostLandmarksOfKeyframe, "a shared keyframe has few landmarks");
  form::SharedKeyframe form;
  *form.mutable_id() = form_of(keyframe.id, sessions);
  *form.mutable_map_from_camera() = form_of(keyframe.map_from_camera);
  if (keyframe.scale != 1.0) form.set_scale(keyframe.scale);
  if (keyframe.features) {
    MAPWEAVE_EXPECT(keyframe.features->geometry != nullptr, "a picture has a camera");
    *form.mutable_camera() = form_of(*keyframe.features->geometry);
    Geometries geometries;
    geometries.cameras.add(keyframe.features->geometry);
    *form.mutable_features() = form_of(*keyframe.features, geometries);
  }
  fill_landmarks(*form.mutable_landmarks(), keyframe.landmarks, sessions);
  return form;
}

SharedKeyframe shared_keyframe_of(const form::SharedKeyframe& form, const FormReader& reader,
                                  const std::string& where) {
  SharedKeyframe keyframe;
  keyframe.id = reader.node_id(form.id());
  keyframe.map_from_camera = reader.pose(form.map_from_camera());
  if (form.scale() != 0.0) keyframe.scale = form.scale();
  if (!is_scale(keyframe.scale)) reader.corrupt("a scale is not a positive number");
  if (form.has_camera() != form.has_features())
    reader.corrupt("a shared keyframe has a camera and features, or neither");
  if (form.has_features()) {
    FormReader of_features(where);
    of_features.take_camera(form.camera());
    keyframe.features = of_features.keyframe(form.features());
    if (const std::string problem = problem_with(*keyframe.features); !problem.empty()) reader.corrupt(problem);
  }
  if (static_cast<std::size_t>(form.landmarks_size()) > kMostLandmarksOfKeyframe)
    reader.corrupt("a shared keyframe with " + std::to_string(form.landmarks_size()) + " landmarks; at most " +
                   std::to_string(kMostLandmarksOfKeyframe) + " are expected");
  keyframe.landmarks = landmarks_of(form.landmarks(), reader);
  return keyframe;
}

void take_keyframes(const form::Share& form, const FormReader& reader, const std::string& where, Share& share) {
  for (const int count : {form.keyframes_size(), form.dropped_size()})
    if (static_cast<std::size_t>(count) > kMostSharedKeyframes)
      reader.corrupt("a share of " + std::to_string(count) + " keyframes; at most " +
                     std::to_string(kMostSharedKeyframes) + " are expected");
  std::set<NodeId> named;
  for (const auto& one : form.keyframes()) {
    share.keyframes.push_back(shared_keyframe_of(one, reader, where));
    if (!named.insert(share.keyframes.back().id).second) reader.corrupt("a keyframe is shared twice");
  }
  for (const auto& id : form.dropped()) share.dropped.push_back(reader.node_id(id));
}

constexpr std::size_t kLongestNote = 4096;  // bytes

void fill_end(form::StreamEnd& form, const StreamEnd& end) {
  if (end.trouble) fill_error(form, *end.trouble);
  MAPWEAVE_EXPECT(end.notes.size() <= kMostNotes && end.log.size() <= kLongestNote, "a last word is short");
  for (const std::string& note : end.notes) {
    MAPWEAVE_EXPECT(note.size() <= kLongestNote, "a note is short");
    form.add_notes(note);
  }
  if (end.log.empty()) return;
  form.set_log(end.log);
  form.set_log_sha256(std::string(end.log_sha256.bytes.begin(), end.log_sha256.bytes.end()));
}

StreamEnd end_of(const form::StreamEnd& form, const FormReader& reader) {
  StreamEnd end{};
  if (form.code() > 0) end.trouble = error_of(form, reader);
  if (static_cast<std::size_t>(form.notes_size()) > kMostNotes || form.log().size() > kLongestNote)
    reader.corrupt("a last word of " + std::to_string(form.notes_size()) + " notes; at most " +
                   std::to_string(kMostNotes) + " are expected, of " + std::to_string(kLongestNote) + " bytes");
  for (const std::string& note : form.notes()) {
    if (note.size() > kLongestNote) reader.corrupt("a note of " + std::to_string(note.size()) + " bytes");
    end.notes.push_back(note);
  }
  if (form.log().empty() != form.log_sha256().empty()) reader.corrupt("a log has a path and a checksum, or neither");
  if (form.log().empty()) return end;
  end.log = form.log();
  end.log_sha256 = reader.hash(form.log_sha256());
  return end;
}

}  // namespace

form::SharedLandmark form_of(const DescribedLandmark& landmark, const SessionTable& sessions) {
  form::SharedLandmark form;
  *form.mutable_id() = form_of(landmark.id, sessions);
  const Eigen::Vector3i point = landmark_units(landmark.point_in_map),
                        feature = landmark_units(landmark.feature_from_point);
  for (int axis = 0; axis < 3; ++axis) form.add_point(point(axis));
  form.set_descriptor(packed(std::vector<BinaryDescriptor>{landmark.descriptor}));
  for (int axis = 0; axis < 3; ++axis) form.add_feature(feature(axis));
  form.set_look(packed_direction(landmark.direction) << 16 | packed_distance(landmark.nearest_m) << 8 |
                packed_distance(landmark.farthest_m));
  form.set_sigma(steps_of(landmark.sigma_m, kLeastSigma_m));
  return form;
}

DescribedLandmark FormReader::shared_landmark(const form::SharedLandmark& form) const {
  if (form.point_size() != 3 || form.feature_size() != 3 || form.descriptor().size() != kDescriptorBytes)
    corrupt("a shared landmark has " + std::to_string(form.point_size()) + " and " +
            std::to_string(form.feature_size()) + " coordinates and a descriptor of " +
            std::to_string(form.descriptor().size()) + " bytes; 3, 3 and " + std::to_string(kDescriptorBytes) +
            " are expected");
  DescribedLandmark landmark;
  landmark.id = landmark_id(form.id());
  for (int axis = 0; axis < 3; ++axis) {
    landmark.point_in_map(axis) = kLandmarkUnit_m * form.point(axis);
    landmark.feature_from_point(axis) = kLandmarkUnit_m * form.feature(axis);
  }
  landmark.descriptor = unpacked_descriptors(form.descriptor()).front();
  landmark.direction = unpacked_direction(form.look() >> 16);
  landmark.nearest_m = unpacked_distance(form.look() >> 8 & 0xff);
  landmark.farthest_m = unpacked_distance(form.look() & 0xff);
  landmark.sigma_m = kLeastSigma_m * std::pow(kGrowth, std::min<std::uint32_t>(form.sigma(), 255));
  return landmark;
}

std::string encode(const Hello& hello) {
  expect_sound(hello.session);
  form::Exchange form;
  *form.mutable_hello()->mutable_session() = form_of(hello.session);
  form.mutable_hello()->set_vocabulary(std::string(hello.vocabulary.bytes.begin(), hello.vocabulary.bytes.end()));
  return written(form);
}

std::string encode(const ClientView& view) {
  expect_sound_name(view.map);
  expect_sound(view.map_from_robot);
  form::Exchange form;
  auto& content = *form.mutable_view();
  content.set_map(view.map.str());
  content.set_stamp_ns(view.stamp.ns);
  *content.mutable_map_from_robot() = form_of(view.map_from_robot);
  content.set_forgotten(view.forgotten);
  content.set_room(view.room);
  content.set_missed(view.missed);
  content.set_missed_after(view.missed_after);
  return written(form);
}

std::string encode(const PlaceRequest& request) {
  MAPWEAVE_EXPECT(request.features.geometry != nullptr, "a picture has a camera");
  form::Exchange form;
  auto& content = *form.mutable_place_request();
  content.set_stamp_ns(request.stamp.ns);
  *content.mutable_camera() = form_of(*request.features.geometry);
  Geometries geometries;
  geometries.cameras.add(request.features.geometry);
  *content.mutable_features() = form_of(request.features, geometries);
  return written(form);
}

std::string encode(const PlaceAnswer& answer) {
  expect_sound_name(answer.map);
  expect_sound(answer.map_from_robot);
  const SessionTable sessions = sessions_of(answer.landmarks);
  form::Exchange form;
  auto& content = *form.mutable_place_answer();
  content.set_stamp_ns(answer.stamp.ns);
  content.set_map(answer.map.str());
  *content.mutable_map_from_robot() = form_of(answer.map_from_robot);
  fill_landmarks(*content.mutable_landmarks(), answer.landmarks, sessions);
  return written(form, sessions);
}

std::string encode(const Share& share) {
  expect_sound_name(share.map);
  MAPWEAVE_EXPECT(is_scale(share.scale), "a scale is a positive number");
  MAPWEAVE_EXPECT(std::max(share.keyframes.size(), share.dropped.size()) <= kMostSharedKeyframes,
                  "a share has a bounded number of keyframes");
  const SessionTable sessions = sessions_of(share);
  form::Exchange form;
  auto& content = *form.mutable_share();
  content.set_map(share.map.str());
  fill_landmarks(*content.mutable_landmarks(), share.landmarks, sessions);
  for (const MovedNode& moved : share.corrected) *content.add_corrected() = form_of(moved, sessions);
  if (share.scale != 1.0) content.set_scale(share.scale);
  for (const SharedKeyframe& keyframe : share.keyframes) *content.add_keyframes() = form_of(keyframe, sessions);
  for (const NodeId& id : share.dropped) *content.add_dropped() = form_of(id, sessions);
  content.set_number(share.number);
  return written(form, sessions);
}

std::string encode(const Sensed& sensed) {
  MAPWEAVE_EXPECT(is_valid_name(sensed.robot.str()) && sensed.sequence > 0, "a robot numbers what it sends");
  form::Exchange form;
  auto& content = *form.mutable_sensed();
  content.set_robot(sensed.robot.str());
  content.set_sequence(sensed.sequence);
  content.set_stamp_ns(sensed.stamp.ns);
  if (const auto* scan = std::get_if<PackedScan>(&sensed.body)) {
    expect_sound(Node{{}, {}, {}, std::make_shared<const Payload>(*scan)});
    expect_sound(*scan->geometry);
    *content.mutable_geometry() = form_of(*scan->geometry);
    fill_measured(*content.mutable_scan(), *scan);
  } else if (const auto* odometry = std::get_if<Pose3>(&sensed.body)) {
    expect_sound(*odometry);
    *content.mutable_odometry() = form_of(*odometry);
  } else if (const auto* inertial = std::get_if<InertialYaw>(&sensed.body)) {
    MAPWEAVE_EXPECT(std::isfinite(inertial->yaw_rad), "only sound values are sent: a heading is not finite");
    content.set_inertial_yaw_rad(inertial->yaw_rad);
  } else if (std::holds_alternative<LostScan>(sensed.body)) {
    content.set_lost_scan(true);
  } else if (const auto* part = std::get_if<MappedPart>(&sensed.body)) {
    MAPWEAVE_EXPECT(part->bytes.size() <= kMostPartBytes, "a part is small");
    content.mutable_mapped()->set_is_report(part->is_report);
    content.mutable_mapped()->set_ends(part->ends);
    content.mutable_mapped()->set_bytes(part->bytes);
  } else {
    fill_end(*content.mutable_end(), std::get<StreamEnd>(sensed.body));
  }
  return written(form);
}

Hello decode_hello(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  const auto form = read_exchange(bytes, reader, where, form::Exchange::kHello);
  reader.take_session(form.hello().session());
  return {reader.session(0), reader.hash(form.hello().vocabulary())};
}

ClientView decode_client_view(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  const auto form = read_exchange(bytes, reader, where, form::Exchange::kView);
  return {map_name(form.view().map(), reader),
          {form.view().stamp_ns()},
          reader.pose(form.view().map_from_robot()),
          form.view().forgotten(),
          form.view().room(),
          form.view().missed(),
          form.view().missed_after()};
}

PlaceRequest decode_place_request(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  const auto form = read_exchange(bytes, reader, where, form::Exchange::kPlaceRequest);
  reader.take_camera(form.place_request().camera());
  PlaceRequest request{{form.place_request().stamp_ns()}, reader.keyframe(form.place_request().features())};
  if (const std::string problem = problem_with(request.features); !problem.empty()) reader.corrupt(problem);
  return request;
}

PlaceAnswer decode_place_answer(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  const auto form = read_exchange(bytes, reader, where, form::Exchange::kPlaceAnswer);
  const auto& content = form.place_answer();
  return {{content.stamp_ns()},
          map_name(content.map(), reader),
          reader.pose(content.map_from_robot()),
          landmarks_of(content.landmarks(), reader)};
}

Share decode_share(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  const auto form = read_exchange(bytes, reader, where, form::Exchange::kShare);
  Share share;
  share.map = map_name(form.share().map(), reader);
  share.landmarks = landmarks_of(form.share().landmarks(), reader);
  for (const auto& moved : form.share().corrected()) share.corrected.push_back(reader.moved(moved));
  if (form.share().scale() != 0.0) share.scale = form.share().scale();
  if (!is_scale(share.scale)) reader.corrupt("a scale is not a positive number");
  take_keyframes(form.share(), reader, where, share);
  share.number = form.share().number();
  return share;
}

Sensed decode_sensed(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  return sensed_of(read_exchange(bytes, reader, where, form::Exchange::kSensed).sensed(), reader);
}

Sensed sensed_of(const form::Sensed& content, FormReader& reader) {
  if (content.robot().empty() || content.sequence() == 0) reader.corrupt("it says neither whose it is nor which");
  Sensed sensed{
      RobotId(reader.name_or_nothing(content.robot(), "robot")), content.sequence(), {content.stamp_ns()}, StreamEnd{}};
  switch (content.body_case()) {
    case form::Sensed::kScan:
      reader.take_geometry(content.geometry());
      sensed.body = reader.scan(content.scan());
      break;
    case form::Sensed::kOdometry: sensed.body = reader.pose(content.odometry()); break;
    case form::Sensed::kInertialYawRad:
      if (!std::isfinite(content.inertial_yaw_rad())) reader.corrupt("a heading that is not finite");
      sensed.body = InertialYaw{content.inertial_yaw_rad()};
      break;
    case form::Sensed::kEnd: sensed.body = end_of(content.end(), reader); break;
    case form::Sensed::kLostScan:
      if (!content.lost_scan()) reader.corrupt("a scan that is lost and is not");
      sensed.body = LostScan{};
      break;
    case form::Sensed::kMapped:
      if (content.mapped().bytes().size() > kMostPartBytes) reader.corrupt("a part of a map of too many bytes");
      sensed.body = MappedPart{content.mapped().is_report(), content.mapped().ends(), content.mapped().bytes()};
      break;
    case form::Sensed::BODY_NOT_SET: reader.corrupt("a robot that says nothing");
  }
  return sensed;
}

}  // namespace mapweave
