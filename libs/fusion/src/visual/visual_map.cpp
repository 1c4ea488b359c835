#include "visual_map.h"

#include <mapweave/core/error.h>
#include <mapweave/rig/scale.h>

#include <algorithm>
#include <map>

namespace mapweave::fusion {
namespace {

constexpr double kSamePoint_px = 2.5;       // between where a landmark was found and the feature that shows it
constexpr std::size_t kLookedUp = 24;       // most alike of all, of which places apart are chosen
constexpr std::size_t kMostCovisible = 20;  // bounds memory; those that share most

MappedKeyframe mapped(const Node& node) {
  const KeyframeFeatures& content = *keyframe_of(node);
  const CameraGeometry& geometry = *content.geometry;
  MappedKeyframe result;
  result.id = node.id;
  result.map_from_node = node.map_from_node;
  result.content = &content;
  result.map_from_camera = compose(node.map_from_node, geometry.robot_from_camera);
  result.camera = geometry.pinhole();
  for (const KeyframePoint& point : content.points)
    result.points.push_back({static_cast<float>(pixels_of(point.u)), static_cast<float>(pixels_of(point.v)),
                             static_cast<float>(angle_deg_of(point.angle)), point.level});
  result.landmark_of_feature.assign(content.points.size(), -1);
  return result;
}

struct Shown {
  std::int32_t landmark;
  double u, v;
};

// Each landmark goes to the nearest feature that has none nearer.
void assign_to_features(MappedKeyframe& keyframe, std::vector<Shown> shown) {
  std::sort(shown.begin(), shown.end(),
            [](const Shown& a, const Shown& b) { return a.v < b.v || (a.v == b.v && a.landmark < b.landmark); });
  std::vector<double> nearest(keyframe.points.size(), kSamePoint_px * kSamePoint_px);
  for (std::size_t i = 0; i < keyframe.points.size(); ++i) {
    const double u = static_cast<double>(keyframe.points[i].u_px), v = static_cast<double>(keyframe.points[i].v_px);
    for (auto s = std::lower_bound(shown.begin(), shown.end(), v - kSamePoint_px,
                                   [](const Shown&a, double y) { return a.v < y; });
         s != shown.end() && s->v <= v + kSamePoint_px; ++s) {
      const double square = (s->u - u) * (s->u - u) + (s->v - v) * (s->v - v);
      if (square < nearest[i]) {
        nearest[i] = square;
        keyframe.landmark_of_feature[i] = s->landmark;
      }
    }
  }
}

Hash content_of(const MappedKeyframe& keyframe) {
  const auto& points = keyframe.content->points;
  const auto& descriptors = keyframe.content->descriptors;
  Hasher hasher;
  hasher.add("keyframe")
      .add(keyframe.camera.fx)
      .add(keyframe.camera.fy)
      .add(keyframe.camera.cx)
      .add(keyframe.camera.cy);
  hasher.add(static_cast<std::int64_t>(points.size())).add_bytes(points.data(), points.size() * sizeof(KeyframePoint));
  return hasher.add_bytes(descriptors.data(), descriptors.size() * sizeof(BinaryDescriptor)).finish();
}

// Of what the view shows, its keyframes' content apart, and of that.
Hash content_of(const matching::PlaceView& view, const std::vector<Hash>& keyframes) {
  Hasher hasher;
  hasher.add("place").add(static_cast<std::int64_t>(view.metric));
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    const auto& [t, q] = view.keyframes[i].side_from_camera;
    const matching::FeaturesView& features = view.keyframes[i].features;
    hasher.add(keyframes[i]).add(static_cast<std::int64_t>(features.nodes != nullptr));
    for (const double number : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) hasher.add(number);
    hasher.add_bytes(view.keyframes[i].landmark_of_feature, features.count * sizeof(std::int32_t));
  }
  std::vector<Eigen::Vector3d> points;
  for (const matching::LandmarkView& landmark : view.landmarks) points.push_back(landmark.point_in_side);
  return hasher.add_bytes(points.data(), points.size() * sizeof(Eigen::Vector3d)).finish();
}

}  // namespace

VisualMap::VisualMap(const Map& map, const matching::ChosenVocabulary& vocabulary, BagOfWordsCache& words,
                     WorkerPool& pool)
    : map_(&map), is_metric_(rig::is_metric(map)), seen_(rig::covisibility(map)) {
  for (std::size_t i = 0; i < seen_.keyframes.size(); ++i) {
    keyframes_.push_back(mapped(*seen_.keyframes[i]));
    auto& covisible = keyframes_.back().covisible = seen_.shared[i];
    if (covisible.size() > kMostCovisible) covisible.resize(kMostCovisible);
  }
  if (keyframes_.empty()) return;
  std::vector<std::vector<Shown>> shown(keyframes_.size());
  for (const auto& [id, landmark] : map.landmarks) {
    const Node* anchor = map.nodes.find(landmark.anchor);
    MAPWEAVE_EXPECT(anchor != nullptr, "a landmark hangs on a keyframe of its map");
    for (const LandmarkSighting& sighting : landmark.seen) {
      const std::size_t number = number_of(sighting.node);
      if (number == keyframes_.size()) continue;
      shown[number].push_back(
          {static_cast<std::int32_t>(landmarks_.size()), pixels_of(sighting.u), pixels_of(sighting.v)});
    }
    landmarks_.push_back({id, transformed(landmark.point_in_anchor(), anchor->map_from_node)});
  }
  pool.for_each(keyframes_.size(), [&](std::size_t i) {
    assign_to_features(keyframes_[i], std::move(shown[i]));
    keyframes_[i].words = words.words_of(*seen_.keyframes[i], vocabulary.get());
  });
  hashed_.reset(new std::once_flag[keyframes_.size()]);
  content_.resize(keyframes_.size());
  index_.emplace(vocabulary.get().words());
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    index_->add(keyframes_[i].id, keyframes_[i].words->bag);
    const std::size_t other = i > 0 ? i - 1 : std::min<std::size_t>(1, keyframes_.size() - 1);
    keyframes_[i].likeness = matching::common_share(keyframes_[i].words->bag, keyframes_[other].words->bag);
  }
}

std::vector<matching::SimilarPlace> VisualMap::alike(const matching::BagOfWords& bag, int least_score, std::size_t most,
                                                     const std::function<bool(const NodeId&)>& excluded) const {
  auto groups = matching::best_of_groups(
      index_->query(bag, kLookedUp, excluded, least_score),
      [&](const NodeId& id) {
        std::vector<NodeId> result;
        for (const auto& other : keyframes_[number_of(id)].covisible) result.push_back(keyframes_[other.second].id);
        return result;
      },
      0.4);
  if (groups.size() > most) groups.resize(most);
  return groups;
}

const Hash& VisualMap::content(std::size_t keyframe) const {
  std::call_once(hashed_[keyframe], [&] { content_[keyframe] = content_of(keyframes_[keyframe]); });
  return content_[keyframe];
}

std::optional<std::size_t> VisualMap::landmark_number(const LandmarkId& id) const {
  const auto found = std::lower_bound(landmarks_.begin(), landmarks_.end(), id,
                                      [](const VisualMapLandmark& l, const LandmarkId& key) { return l.id < key; });
  return found != landmarks_.end() && found->id == id
             ? std::optional(static_cast<std::size_t>(found - landmarks_.begin()))
             : std::nullopt;
}

VisualPlace VisualMap::place(std::size_t keyframe, std::size_t most_covisible, bool with_words) const {
  VisualPlace place;
  std::vector<std::size_t> members{keyframe};
  for (const auto& other : keyframes_[keyframe].covisible)
    if (members.size() <= most_covisible) members.push_back(other.second);
  const Pose3 side_from_map = inverse(keyframes_[keyframe].map_from_node);
  place.view.id = {keyframes_[keyframe].id.session, keyframes_[keyframe].id.index};
  place.view.metric = is_metric_;
  std::map<std::int32_t, std::int32_t> numbers;  // of the map's landmarks, in the place
  place.landmark_of_feature.reserve(members.size());
  for (const std::size_t member : members) {
    const MappedKeyframe& from = keyframes_[member];
    const Pose3 side_from_camera = compose(side_from_map, from.map_from_camera);
    auto& of_feature = place.landmark_of_feature.emplace_back(from.points.size(), -1);
    for (std::size_t i = 0; i < from.points.size(); ++i) {
      const std::int32_t landmark = from.landmark_of_feature[i];
      const double depth_m = depth_m_of(from.content->points[i].inverse_depth);
      const auto next = static_cast<std::int32_t>(place.view.landmarks.size());
      if (landmark >= 0) {
        const auto [known, is_new] = numbers.emplace(landmark, next);
        of_feature[i] = known->second;
        if (is_new)
          place.view.landmarks.push_back(
              {transformed(landmarks_[static_cast<std::size_t>(landmark)].point_in_map, side_from_map),
               from.content->descriptors[i]});
      } else if (is_metric_ && depth_m > 0.0) {
        of_feature[i] = next;
        const Eigen::Vector3d ray =
            from.camera.ray({static_cast<double>(from.points[i].u_px), static_cast<double>(from.points[i].v_px)});
        place.view.landmarks.push_back({transformed(depth_m * ray, side_from_camera), from.content->descriptors[i]});
      }
    }
    matching::KeyframeView view;
    view.id = from.id;
    view.camera = from.camera;
    view.side_from_camera = side_from_camera;
    view.features = {from.points.size(), from.points.data(), from.content->descriptors.data(),
                     with_words ? from.words->node_of_feature.data() : nullptr,
                     with_words ? from.words->by_node.data() : nullptr};
    view.landmark_of_feature = of_feature.data();
    view.level_scale = from.content->geometry->level_scale;
    place.view.keyframes.push_back(view);
  }
  std::vector<Hash> contents;
  for (const std::size_t member : members) contents.push_back(content(member));
  place.view.content = content_of(place.view, contents);
  return place;
}

}  // namespace mapweave::fusion
