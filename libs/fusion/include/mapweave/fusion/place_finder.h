#pragma once
// Where in a map of keyframes was a picture taken (CORB-SLAM 2.2; CVS III-B, relocalisation)? Words, then the judge.

#include <mapweave/core/worker_pool.h>
#include <mapweave/fusion/bag_of_words_cache.h>
#include <mapweave/fusion/fusion_options.h>
#include <mapweave/maps/map.h>

#include <memory>
#include <optional>

namespace mapweave::fusion {

struct FoundPlace {
  NodeId keyframe;  // of the map, that shows the same
  Pose3 map_from_robot;
  double probability = 0.0;
};

// const calls are thread-safe.
class PlaceFinder {
 public:
  // The map outlives it, unchanged.
  PlaceFinder(const Map& map, const matching::ChosenVocabulary& vocabulary, BagOfWordsCache& pictures,
              WorkerPool& pool);
  ~PlaceFinder();
  PlaceFinder(PlaceFinder&&) noexcept;
  PlaceFinder& operator=(PlaceFinder&&) noexcept;

  // nullopt where nothing looks alike, nothing that does holds, or two places that are not the same do. It has the
  // map's scale.
  std::optional<FoundPlace> find(const KeyframeFeatures& picture, const FusionOptions& options, WorkerPool& pool) const;

 private:
  struct Known;
  std::unique_ptr<Known> known_;
};

}  // namespace mapweave::fusion
