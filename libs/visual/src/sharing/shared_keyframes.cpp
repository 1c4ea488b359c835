#include "shared_keyframes.h"

#include "borrowed_landmarks.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace mapweave::visual {
namespace {

constexpr std::size_t kMostFeatures = 10000;          // of a keyframe that is kept: bounds memory
constexpr std::size_t kMostInView = 400;              // landmarks for one keyframe
constexpr std::size_t kBeside = 3;                    // others that speak with the keyframe that looks alike
constexpr double kBeside_m = 1.0, kBeside_rad = 0.5;  // from it: they show much of the same
constexpr double kMostScale = 1000.0;                 // either way: no map of a camera is as large or as small

// The session's keyframe nearest to a camera; -1 without any.
int nearest_to(const LandmarkMap& map, int session, const View& view) {
  int nearest = -1;
  double least = 0.0;
  for (int number = 0; number < static_cast<int>(map.keyframes.size()); ++number) {
    const Keyframe& keyframe = map.keyframe(number);
    if (keyframe.gone || keyframe.session != session) continue;
    const double apart = (keyframe.view.centre() - view.centre()).squaredNorm();
    if (nearest < 0 || apart < least || (apart == least && keyframe.serial < map.keyframe(nearest).serial)) {
      nearest = number;
      least = apart;
    }
  }
  return nearest;
}

}  // namespace

bool is_sound(const SharedKeyframe& shared) {
  return is_finite(shared.map_from_camera) && std::abs(shared.map_from_camera.q.norm() - 1.0) < 1e-6 &&
         shared.map_from_camera.t.norm() < matching::kMostCoordinate_m && std::isfinite(shared.scale) &&
         shared.scale > 1.0 / kMostScale && shared.scale < kMostScale;
}

int keyframe_beside(const LandmarkMap& map, int session, std::uint32_t serial) {
  int best = -1;
  const auto apart = [&](int number) {
    return std::abs(static_cast<std::int64_t>(map.keyframe(number).serial) - static_cast<std::int64_t>(serial));
  };
  for (int number = 0; number < static_cast<int>(map.keyframes.size()); ++number) {
    const Keyframe& keyframe = map.keyframe(number);
    if (keyframe.gone || keyframe.session != session) continue;
    if (best < 0 || apart(number) < apart(best) ||
        (apart(number) == apart(best) && keyframe.serial < map.keyframe(best).serial))
      best = number;
  }
  return best;
}

SharedKeyframes::SharedKeyframes(std::optional<matching::BinaryVocabulary> vocabulary, const ClientOptions& options)
    : vocabulary_(std::move(vocabulary)), options_(options) {}

bool SharedKeyframes::take_whole(const SharedKeyframe& shared, Known& known) const {
  const KeyframeFeatures& whole = *shared.features;
  if (whole.points.size() > kMostFeatures || whole.points.size() != whole.descriptors.size() || !whole.geometry)
    return false;
  known = Known();
  known.scale = shared.scale;
  known.camera = whole.geometry->pinhole();
  known.features.descriptors = whole.descriptors;
  for (const KeyframePoint& point : whole.points) {
    known.features.points.push_back({static_cast<float>(pixels_of(point.u)), static_cast<float>(pixels_of(point.v)),
                                     static_cast<float>(angle_deg_of(point.angle)), point.level});
    known.depths.push_back(static_cast<float>(shared.scale * depth_m_of(point.inverse_depth)));
  }
  return true;
}

void SharedKeyframes::grow(Known& known, double factor) {
  if (factor == 1.0) return;
  known.scale *= factor;
  for (float& depth : known.depths) depth *= static_cast<float>(factor);
  for (auto& [id, landmark] : known.landmarks) landmark = matching::transformed(landmark, {Pose3(), factor});
}

void SharedKeyframes::note(const NodeId& id, Known& known) {
  if (!vocabulary_) return;
  if (!index_) index_.emplace(vocabulary_->words());
  index_->remove(id);
  index_->add(id, vocabulary_->describe_picture(known.features.descriptors).bag);
}

int SharedKeyframes::receive(const LandmarkMap& map, const Receiver& receiver,
                             const std::vector<SharedKeyframe>& keyframes) {
  const int session = receiver.session;
  int taken = 0;
  for (const SharedKeyframe& shared : keyframes) {
    has_received_ = true;
    const auto before = known_.find(shared.id);
    if (shared.id.session == receiver.own || !is_sound(shared) || (before == known_.end() && !shared.features))
      continue;
    Known whole;
    if (shared.features && !take_whole(shared, whole)) continue;
    const View view = view_of(shared.map_from_camera);
    const int anchor = nearest_to(map, session, view);
    if (anchor < 0) continue;
    Known& known = before == known_.end() ? known_[shared.id] : before->second;
    const int session_before = known.session;
    if (shared.features) {
      known = std::move(whole);
      note(shared.id, known);
    } else {
      grow(known, shared.scale / known.scale);
    }
    if (before != known_.end() && session_before != session) ++times_lost_[session_before];
    known.session = session;
    known.view = view;
    known.anchor = map.keyframe(anchor).serial;
    const Sim3 camera_from_map{inverse(shared.map_from_camera), 1.0};
    for (const DescribedLandmark& landmark : shared.landmarks) {
      if (landmark.id.session == receiver.own || !matching::problem_with(landmark).empty()) continue;
      if (known.landmarks.size() < kMostLandmarksOfKeyframe || known.landmarks.count(landmark.id) != 0)
        known.landmarks.insert_or_assign(landmark.id, matching::transformed(landmark, camera_from_map));
    }
    ++taken;
  }
  limit(receiver);
  return taken;
}

std::uint32_t SharedKeyframes::times_lost(int session) const {
  const auto known = times_lost_.find(session);
  return known == times_lost_.end() ? 0 : known->second;
}

SharedKeyframes::Entry SharedKeyframes::take_out(Entry entry) {
  if (index_) index_->remove(entry->first);
  return known_.erase(entry);
}

void SharedKeyframes::drop(const std::vector<NodeId>& ids) {
  const bool is_full = known_.size() >= room();
  for (const NodeId& id : ids)
    if (const auto entry = known_.find(id); entry != known_.end()) {
      take_out(entry);
      dropped_ += is_full;
    }
}

void SharedKeyframes::limit(const Receiver& receiver) {
  if (known_.size() <= room()) return;
  std::vector<std::tuple<bool, double, NodeId>> order;  // those of other sessions first, then the farthest
  for (const auto& [id, known] : known_)
    order.emplace_back(known.session == receiver.session, -(known.view.centre() - receiver.centre).squaredNorm(), id);
  std::sort(order.begin(), order.end());
  order.resize(known_.size() - room());
  for (const auto& [is_of_session, apart, id] : order) {
    const auto entry = known_.find(id);
    if (!is_of_session) ++times_lost_[entry->second.session];
    take_out(entry);
  }
  dropped_ += order.size();
}

void SharedKeyframes::forget(int session) {
  for (auto entry = known_.begin(); entry != known_.end();)
    entry = entry->second.session == session ? take_out(entry) : std::next(entry);
}

void SharedKeyframes::follow(const LandmarkMap& map, const std::vector<View>& before,
                             const std::vector<double>& scales) {
  for (auto& [id, known] : known_) {
    const int anchor = keyframe_beside(map, known.session, known.anchor);
    if (anchor < 0 || static_cast<std::size_t>(anchor) >= before.size()) continue;
    const auto slot = static_cast<std::size_t>(anchor);
    known.view = stretched(known.view * before[slot].inverse(), scales[slot]) * map.keyframe(anchor).view;
    grow(known, scales[slot]);
  }
}

std::vector<DescribedLandmark> SharedKeyframes::in_view(int session, const View& view, const Pinhole& camera) const {
  std::vector<std::pair<double, const Known*>> nearest;
  for (const auto& [id, known] : known_)
    if (known.session == session) nearest.emplace_back((known.view.centre() - view.centre()).squaredNorm(), &known);
  std::stable_sort(nearest.begin(), nearest.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<DescribedLandmark> result;
  for (const auto& [apart, known] : nearest) {
    const Sim3 map_from_camera{pose_of(known->view), 1.0};
    const View view_from_other = view * known->view.inverse();
    for (const auto& [id, landmark] : known->landmarks) {
      if (result.size() >= kMostInView) return result;
      if (!((view_from_other * landmark.point_in_map).z() > kNearest_m)) continue;
      DescribedLandmark here = matching::transformed(landmark, map_from_camera);
      if (is_expected(here, camera, view)) result.push_back(std::move(here));
    }
  }
  return result;
}

std::vector<PlacedShared> SharedKeyframes::placed() const {
  std::vector<PlacedShared> result;
  for (const auto& [id, known] : known_)
    result.push_back({id, known.session, pose_of(known.view), known.landmarks.size()});
  return result;
}

std::vector<NodeId> SharedKeyframes::alike(std::optional<int> session, const matching::OrbFeatures& features,
                                           std::size_t most) const {
  std::vector<NodeId> result;
  if (!index_) return result;
  const auto is_elsewhere = [&](const NodeId& id) { return session && known_.at(id).session != *session; };
  for (const matching::SimilarPlace& place :
       index_->query(vocabulary_->describe_picture(features.descriptors).bag, most, is_elsewhere))
    result.push_back(place.id);
  return result;
}

std::optional<SharedPlace> SharedKeyframes::judged(const NodeId& keyframe, const JudgedPlace& here) const {
  const Known& known = known_.at(keyframe);
  JudgedPlace there;
  there.view.id = {keyframe.session, keyframe.index};
  there.add(keyframe, known.camera, View(), known.features, known.depths);
  std::vector<std::pair<double, const std::pair<const NodeId, Known>*>> beside;
  for (const auto& entry : known_) {
    const View apart = entry.second.view * known.view.inverse();
    if (entry.first == keyframe || entry.second.session != known.session || apart.centre().norm() > kBeside_m ||
        Eigen::AngleAxisd(apart.rotation).angle() > kBeside_rad)
      continue;
    beside.emplace_back(apart.centre().norm(), &entry);
  }
  std::stable_sort(beside.begin(), beside.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (std::size_t i = 0; i < std::min(beside.size(), kBeside); ++i) {
    const auto& [id, other] = *beside[i].second;
    there.add(id, other.camera, known.view * other.view.inverse(), other.features, other.depths);
  }
  there.view.metric = here.view.metric;
  const auto found = first_from_second(there.view, here.view, options_.loops.least_probability, options_.seed);
  if (!found) return std::nullopt;
  SharedPlace place;
  place.keyframe = keyframe;
  place.session = known.session;
  place.view = view_of(compose(pose_of(known.view), found->pose));
  place.keyframe_view = known.view;
  place.scale = here.view.metric ? 1.0 : found->scale;
  place.anchor = known.anchor;
  return place;
}

}  // namespace mapweave::visual
