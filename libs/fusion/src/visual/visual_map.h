#pragma once
// A map of keyframes with what comparing it with others needs, made once: words, who sees what, and places as the judge
// wants them.

#include <mapweave/core/worker_pool.h>
#include <mapweave/fusion/bag_of_words_cache.h>
#include <mapweave/maps/map.h>
#include <mapweave/matching/place_index.h>
#include <mapweave/matching/visual_judge.h>
#include <mapweave/rig/covisibility.h>

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

namespace mapweave::fusion {

struct MappedKeyframe {
  NodeId id;
  Pose3 map_from_node, map_from_camera;
  const KeyframeFeatures* content = nullptr;
  Pinhole camera;
  std::vector<matching::FeaturePoint> points;
  std::vector<std::int32_t> landmark_of_feature;               // number of the landmark that it shows; -1: none
  std::vector<std::pair<std::size_t, std::size_t>> covisible;  // landmarks shared, and with which keyframe; most first
  std::shared_ptr<const OrderedPicture> words;
  int likeness = 0;  // of its bag to that of the keyframe before: what a picture of the same place scores
};

struct VisualMapLandmark {
  LandmarkId id;
  Eigen::Vector3d point_in_map;
};

// What the judge looks at: a keyframe and those covisible with it, in the frame of the first one's node.
struct VisualPlace {
  std::vector<std::vector<std::int32_t>> landmark_of_feature;
  matching::PlaceView view;
};

class VisualMap {
 public:
  VisualMap(const Map& map, const matching::ChosenVocabulary& vocabulary, BagOfWordsCache& words, WorkerPool& pool);

  const Map& map() const { return *map_; }
  bool empty() const { return keyframes_.empty(); }
  bool is_metric() const { return is_metric_; }
  const std::vector<MappedKeyframe>& keyframes() const { return keyframes_; }     // by id
  const std::vector<VisualMapLandmark>& landmarks() const { return landmarks_; }  // by id
  // Keyframes that look like this picture, each the best of its surroundings, best first.
  std::vector<matching::SimilarPlace> alike(const matching::BagOfWords& bag, int least_score, std::size_t most,
                                            const std::function<bool(const NodeId&)>& excluded = {}) const;
  std::size_t number_of(const NodeId& id) const { return seen_.number_of(id); }  // a keyframe's
  std::optional<std::size_t> landmark_number(const LandmarkId& id) const;
  // With words only features of like words are compared; without, each with each.
  VisualPlace place(std::size_t keyframe, std::size_t most_covisible, bool with_words = true) const;

 private:
  const Hash& content(std::size_t keyframe) const;
  const Map* map_;
  bool is_metric_;
  rig::Covisibility seen_;
  std::vector<MappedKeyframe> keyframes_;
  std::vector<VisualMapLandmark> landmarks_;
  std::unique_ptr<std::once_flag[]> hashed_;
  mutable std::vector<Hash> content_;  // of keyframes that were asked for
  std::optional<matching::PlaceIndex> index_;
};

}  // namespace mapweave::fusion
