#include "map_publisher.h"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace mapweave::visual {
namespace {

// What moved less is not worth a message.
constexpr double kMoved_m = 0.002, kMoved_rad = 0.001;
constexpr double kLandmarkMoved = 0.003;  // of its distance
constexpr double kLevelScale = 1.2;       // of the features' pyramid

// What is published of a feature, well below what it is off by: 0.001 / m of inverse depth, a 64th of a turn. The form
// on a wire is short where all are multiples, and rise from the upper edge of the picture. Places keep their sixteenths
// of a pixel: borrowed landmarks are found by them.
constexpr std::uint16_t kDepthSteps = 4, kAngleSteps = 4;

std::uint16_t coarse(std::uint16_t units, std::uint16_t steps) {
  return static_cast<std::uint16_t>(std::min((units + steps / 2) / steps, 65535 / steps) * steps);
}

bool has_moved(const Pose3& before, const Pose3& now, PublishedDetail detail) {
  if (detail == PublishedDetail::exact) return before.t != now.t || before.q.coeffs() != now.q.coeffs();
  const Pose3 motion = between(before, now);
  return motion.t.norm() > kMoved_m || 2.0 * motion.q.vec().norm() > kMoved_rad;
}

template <class Item>
void sort_by_id(std::vector<Item>& items) {
  std::sort(items.begin(), items.end(), [](const Item& a, const Item& b) { return a.id < b.id; });
}

}  // namespace

MapId map_of(const ClientId& client, int session) {
  const std::string name = client.robot.str() + "." + client.sensor.str();
  return MapId(session == 0 ? name : name + "." + std::to_string(session));
}

std::optional<int> session_of(const ClientId& client, MapId map) {
  const std::string name = map_of(client, 0).str();
  if (map.str() == name) return 0;
  if (map.str().compare(0, name.size() + 1, name + ".") != 0) return std::nullopt;
  int session = 0;
  const char *begin = map.str().data() + name.size() + 1, *end = map.str().data() + map.str().size();
  const auto read = std::from_chars(begin, end, session);
  return read.ec == std::errc() && read.ptr == end && session > 0 ? std::optional(session) : std::nullopt;
}

std::shared_ptr<const CameraGeometry> geometry_of(const LandmarkMap& map, const Pose3& robot_from_camera) {
  const Pinhole& camera = map.camera;
  return std::make_shared<const CameraGeometry>(CameraGeometry{camera.width, camera.height, camera.fx, camera.fy,
                                                               camera.cx, camera.cy, map.baseline_m, kLevelScale,
                                                               robot_from_camera});
}

KeyframeFeatures packed(const matching::OrbFeatures& features, const std::vector<float>& depths,
                        std::shared_ptr<const CameraGeometry> geometry) {
  KeyframeFeatures result{std::move(geometry), {}, {}};
  const double right = result.geometry->width - 1.0, bottom = result.geometry->height - 1.0;
  std::vector<std::pair<KeyframePoint, std::size_t>> points;
  points.reserve(features.points.size());
  for (std::size_t i = 0; i < features.points.size(); ++i) {
    const matching::FeaturePoint& point = features.points[i];
    const std::uint16_t inverse_depth = inverse_depth_units(static_cast<double>(depths[i]));
    points.emplace_back(
        KeyframePoint{
            pixel_units(std::clamp<double>(static_cast<double>(point.u_px), 0.0, right)),
            pixel_units(std::clamp<double>(static_cast<double>(point.v_px), 0.0, bottom)),
            inverse_depth == 0 ? inverse_depth : std::max(kDepthSteps, coarse(inverse_depth, kDepthSteps)), point.level,
            static_cast<std::uint8_t>(coarse(angle_units(static_cast<double>(point.angle_deg)), kAngleSteps))},
        i);
  }
  std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) {
    return std::tie(a.first.v, a.first.u, a.second) < std::tie(b.first.v, b.first.u, b.second);
  });
  for (const auto& [point, i] : points) {
    result.points.push_back(point);
    result.descriptors.push_back(features.descriptors[i]);
  }
  return result;
}

MapPublisher::MapPublisher(ClientPlace place, SessionId session, double sigma_px, double inverse_depth_sigma)
    : place_(std::move(place)), session_(session), sigma_px_(sigma_px), inverse_depth_sigma_(inverse_depth_sigma) {}

MapUpdate& MapPublisher::update_of(int part) {
  const auto [found, is_new] = updates_.try_emplace(part);
  if (is_new) {
    found->second.origin.map = map_of(session_.client, part);
    found->second.base = forgotten_.erase(part) > 0 ? 0 : sequence_[part];
    found->second.sequence = ++sequence_[part];
  }
  return found->second;
}

Pose3 MapPublisher::map_from_robot(const View& view) const {
  return compose(compose(place_.robot_from_camera, pose_of(view)), inverse(place_.robot_from_camera));
}

std::shared_ptr<const Payload> MapPublisher::payload_of(const LandmarkMap& map, const Keyframe& keyframe) {
  if (!geometry_) geometry_ = geometry_of(map, place_.robot_from_camera);
  return std::make_shared<const Payload>(packed(keyframe.features, keyframe.depths, geometry_));
}

LandmarkSighting MapPublisher::sighting_of(const LandmarkMap& map, const Observation& observation) const {
  const Sighting& sighting = observation.sighting;
  const Eigen::Vector2d pixel = sighting.pixel - map.calibration.readout_s * sighting.row_flow;
  LandmarkSighting result;
  result.node = node_id(map.keyframe(observation.keyframe).serial);
  result.u = pixel_units(std::clamp(pixel.x(), 0.0, map.camera.width - 1.0));
  result.v = pixel_units(std::clamp(pixel.y(), 0.0, map.camera.height - 1.0));
  const double inverse_depth = sighting.inverse_depth - map.calibration.inverse_depth_offset;
  // At an edge a depth camera may mean either side, and depths that a camera alone works out are not measured: they are
  // not published.
  const bool is_sure =
      !map.monocular && (map.baseline_m > 0.0 || sighting.inverse_depth_sigma < 2.0 * inverse_depth_sigma_);
  if (sighting.inverse_depth_sigma > 0.0 && is_sure && inverse_depth > 0.0)
    result.inverse_depth = inverse_depth_units(1.0 / inverse_depth);
  // The sighting's deviation is 2^level times that of level 0.
  result.level = static_cast<std::uint8_t>(std::max(0, std::ilogb(sighting.sigma_px / sigma_px_)));
  return result;
}

void MapPublisher::publish_keyframes(const LandmarkMap& map, PublishedDetail detail) {
  keyframes_.resize(std::max(keyframes_.size(), map.keyframes.size()));
  for (std::size_t slot = 0; slot < map.keyframes.size(); ++slot) {
    const Keyframe& keyframe = map.keyframes[slot];
    SentKeyframe& sent = keyframes_[slot];
    const bool known = !keyframe.gone && sent.part == keyframe.session && sent.serial == keyframe.serial;
    if (!known && sent.part >= 0) {
      if (!say_forgotten(sent)) update_of(sent.part).removed_nodes.push_back(node_id(sent.serial));
      sent.part = -1;
    }
    if (keyframe.gone) continue;
    const Pose3 pose = map_from_robot(keyframe.view);
    if (!known) {
      update_of(keyframe.session)
          .nodes.push_back({node_id(keyframe.serial), keyframe.stamp, pose, payload_of(map, keyframe)});
    } else if (has_moved(sent.map_from_robot, pose, detail)) {
      update_of(keyframe.session).moved.push_back({node_id(keyframe.serial), pose});
    } else {
      continue;
    }
    sent = {keyframe.serial, keyframe.session, pose};
  }
}

// One that was published and has gone from its slot: whether because the map was full.
bool MapPublisher::say_forgotten(const SentKeyframe& sent) {
  if (forgotten_now_.count(sent.serial) == 0) return false;
  update_of(sent.part).forgotten_nodes.push_back(node_id(sent.serial));
  kept_elsewhere_[sent.serial] = sent;
  return true;
}

// Where they are while those that they hang on are of the same map.
void MapPublisher::publish_forgotten(const LandmarkMap& map, PublishedDetail detail) {
  for (const Keyframe& keyframe : map.keyframes)
    for (const ForgottenKeyframe& one : keyframe.forgotten) {
      const auto sent = kept_elsewhere_.find(one.serial);
      if (sent == kept_elsewhere_.end() || sent->second.part != keyframe.session) continue;
      const Pose3 pose = map_from_robot(frame_from_keyframe(one.place) * keyframe.view);
      if (!has_moved(sent->second.map_from_robot, pose, detail)) continue;
      update_of(keyframe.session).moved.push_back({node_id(one.serial), pose});
      sent->second.map_from_robot = pose;
    }
}

std::vector<PlacedForgotten> MapPublisher::forgotten(const LandmarkMap& map) const {
  std::vector<PlacedForgotten> result;
  for (const Keyframe& keyframe : map.keyframes)
    for (const ForgottenKeyframe& one : keyframe.forgotten)
      result.push_back({node_id(one.serial), map_of(session_.client, keyframe.session),
                        map_from_robot(frame_from_keyframe(one.place) * keyframe.view)});
  sort_by_id(result);
  return result;
}

void MapPublisher::publish_landmarks(const LandmarkMap& map, PublishedDetail detail) {
  landmarks_.resize(std::max(landmarks_.size(), map.landmarks.size()));
  const std::size_t least_seen =
      detail == PublishedDetail::exact ? 1 : 2;                    // what one keyframe saw may not be there at all
  std::vector<std::pair<std::uint32_t, const Observation*>> seen;  // by serial number of the keyframe
  std::vector<std::uint32_t> now;                                  // those numbers
  std::vector<std::uint32_t> forgotten = map.forgotten_landmarks;
  std::sort(forgotten.begin(), forgotten.end());
  const auto is_kept_elsewhere = [&](std::uint32_t keyframe) { return kept_elsewhere_.count(keyframe) != 0; };
  for (std::size_t slot = 0; slot < map.landmarks.size(); ++slot) {
    const ClientLandmark& landmark = map.landmarks[slot];
    SentLandmark& sent = landmarks_[slot];
    const bool published = !landmark.gone && !landmark.borrowed && landmark.seen.size() >= least_seen;
    // The first keyframe that sees it and is of the map holds it.
    const Observation* anchor = nullptr;
    seen.clear();
    now.clear();
    if (published)
      for (const Observation& o : landmark.seen) {
        const std::uint32_t serial = map.keyframe(o.keyframe).serial;
        seen.emplace_back(serial, &o);
        if (anchor == nullptr || serial < map.keyframe(anchor->keyframe).serial) anchor = &o;
      }
    const int part = anchor != nullptr ? map.keyframe(anchor->keyframe).session : -1;
    const bool same = published && sent.part == part && sent.serial == landmark.serial;
    if (!same && sent.part >= 0) {
      MapUpdate& update = update_of(sent.part);
      const bool is_forgotten = std::binary_search(forgotten.begin(), forgotten.end(), sent.serial);
      (is_forgotten ? update.forgotten_landmarks : update.removed_landmarks).push_back(landmark_id(sent.serial));
      sent = {};
    }
    if (!published) continue;
    std::sort(seen.begin(), seen.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    seen.erase(std::remove_if(seen.begin(), seen.end(),
                              [&](const auto& s) { return map.keyframe(s.second->keyframe).session != part; }),
               seen.end());
    const Keyframe& held_by = map.keyframe(anchor->keyframe);
    const Eigen::Vector3d in_camera = held_by.view * landmark.point;
    const Eigen::Vector3i units = landmark_units(transformed(in_camera, place_.robot_from_camera));
    for (const auto& [serial, o] : seen) now.push_back(serial);
    // What keyframes saw that are kept elsewhere is kept there, too.
    if (same && !kept_elsewhere_.empty())
      sent.seen.erase(std::remove_if(sent.seen.begin(), sent.seen.end(), is_kept_elsewhere), sent.seen.end());
    const bool lost_sightings = same && !std::includes(now.begin(), now.end(), sent.seen.begin(), sent.seen.end());
    if (!same || held_by.serial != sent.anchor || lost_sightings) {
      mapweave::Landmark whole{landmark_id(landmark.serial), node_id(held_by.serial), units, landmark.colour, {}};
      for (const auto& [serial, o] : seen) whole.seen.push_back(sighting_of(map, *o));
      update_of(part).landmarks.push_back(std::move(whole));
    } else {
      LandmarkChange change{landmark_id(landmark.serial), std::nullopt, {}};
      const double moved_m = kLandmarkUnit_m * (units - sent.point_units).cast<double>().norm();
      if (detail == PublishedDetail::exact ? units != sent.point_units
                                           : moved_m > kMoved_m + kLandmarkMoved * in_camera.norm())
        change.point_units = units;
      for (const auto& [serial, o] : seen)
        if (!std::binary_search(sent.seen.begin(), sent.seen.end(), serial))
          change.seen.push_back(sighting_of(map, *o));
      if (!change.point_units && change.seen.empty()) continue;
      sent.seen = now;
      if (change.point_units) sent.point_units = units;
      update_of(part).changed_landmarks.push_back(std::move(change));
      continue;
    }
    sent = {landmark.serial, part, held_by.serial, units, now};
  }
}

// Each sighting once: it goes with its keyframe. What one keyframe alone found by a descriptor is not published unless
// all is.
void MapPublisher::publish_borrowed(const LandmarkMap& map, PublishedDetail detail) {
  const std::size_t least_seen = detail == PublishedDetail::exact ? 1 : 2;
  borrowed_.resize(std::max(borrowed_.size(), map.landmarks.size()));
  for (std::size_t slot = 0; slot < map.landmarks.size(); ++slot) {
    const ClientLandmark& landmark = map.landmarks[slot];
    SentLandmark& sent = borrowed_[slot];
    if (landmark.gone || !landmark.borrowed) sent = {};
    if (landmark.gone || !landmark.borrowed || landmark.seen.size() < least_seen) continue;
    if (sent.part < 0 || sent.serial != landmark.serial) sent = {landmark.serial, 0, 0, Eigen::Vector3i::Zero(), {}};
    std::vector<std::uint32_t> now;
    std::map<int, LandmarkChange> published;  // by part
    for (const Observation& o : landmark.seen) {
      const Keyframe& keyframe = map.keyframe(o.keyframe);
      now.push_back(keyframe.serial);
      if (std::binary_search(sent.seen.begin(), sent.seen.end(), keyframe.serial)) continue;
      LandmarkChange& change = published[keyframe.session];
      change.id = landmark.borrowed->id;
      change.seen.push_back(sighting_of(map, o));
    }
    std::sort(now.begin(), now.end());
    sent.seen = std::move(now);
    for (auto& [part, change] : published) {
      std::sort(change.seen.begin(), change.seen.end(), [](const auto& a, const auto& b) { return a.node < b.node; });
      update_of(part).borrowed.push_back(std::move(change));
    }
  }
}

std::vector<MapUpdate> MapPublisher::take(const LandmarkMap& map, PublishedDetail detail) {
  updates_.clear();
  while (!forgotten_.empty()) update_of(*forgotten_.begin());  // though nothing be left of it
  forgotten_now_.clear();
  for (const Keyframe& keyframe : map.keyframes)
    for (const ForgottenKeyframe& one : keyframe.forgotten) forgotten_now_.insert(one.serial);
  publish_keyframes(map, detail);
  publish_forgotten(map, detail);
  publish_landmarks(map, detail);
  publish_borrowed(map, detail);
  std::vector<MapUpdate> result;
  for (auto& [part, update] : updates_) {
    sort_by_id(update.nodes);
    sort_by_id(update.moved);
    sort_by_id(update.landmarks);
    sort_by_id(update.changed_landmarks);
    sort_by_id(update.borrowed);
    std::sort(update.removed_nodes.begin(), update.removed_nodes.end());
    std::sort(update.removed_landmarks.begin(), update.removed_landmarks.end());
    std::sort(update.forgotten_nodes.begin(), update.forgotten_nodes.end());
    std::sort(update.forgotten_landmarks.begin(), update.forgotten_landmarks.end());
    result.push_back(std::move(update));
  }
  return result;
}

void MapPublisher::forget(int part) {
  std::vector<std::uint32_t> serials;
  for (SentKeyframe& sent : keyframes_)
    if (sent.part == part) {
      serials.push_back(sent.serial);
      sent.part = -1;
    }
  for (SentLandmark& sent : landmarks_)
    if (sent.part == part) sent = {};
  for (auto kept = kept_elsewhere_.begin(); kept != kept_elsewhere_.end();)
    kept = kept->second.part == part ? kept_elsewhere_.erase(kept) : std::next(kept);
  std::sort(serials.begin(), serials.end());
  for (SentLandmark& sent : borrowed_)
    sent.seen.erase(std::remove_if(sent.seen.begin(), sent.seen.end(),
                                   [&](std::uint32_t serial) {
                                     return std::binary_search(serials.begin(), serials.end(), serial);
                                   }),
                    sent.seen.end());
  forgotten_.insert(part);
}

}  // namespace mapweave::visual
