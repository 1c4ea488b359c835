#pragma once
// Loops, from the keyframe that shows one to the frame from which on the map is corrected. In between the correction is
// computed aside, on a copy.

#include "map_correction.h"

#include <mapweave/core/background_work.h>
#include <mapweave/visual/visual_client.h>

#include <memory>

namespace mapweave::visual {

class LoopClosing {
 public:
  // Without a vocabulary no loops are found.
  LoopClosing(const std::optional<matching::BinaryVocabulary>& vocabulary, const ClientOptions& options);

  const VisualLoopDetector* places() const {
    return detector_ ? &*detector_ : nullptr;
  }  // nullptr without a vocabulary
  // Keyframes that places are recognised by.
  void add(const LandmarkMap& map, int keyframe);
  void remove(int keyframe);

  // For each new keyframe, once; it is added. None is found while a correction is pending.
  std::optional<FoundLoop> look(LandmarkMap& map, int newest, const Pyramid& picture, const Motion& motion);
  // Of a loop within one session (join_sessions()): its correction is pending from now on.
  void begin(const LandmarkMap& map, FoundLoop loop, Stamp now);

  bool is_pending() const { return pending_.has_value(); }
  // Whether what is pending holds a keyframe of another client where it is.
  bool is_on_shared() const { return pending_ && pending_->correction->loop().fixed; }
  bool is_due(Stamp now) const;
  std::shared_ptr<BackgroundWork> work() const { return pending_ ? pending_->work : nullptr; }
  // What is pending, computed here where nobody did. Answers by how much the scale of each keyframe grows.
  std::vector<double> apply(LandmarkMap& map, Stamp now);
  const std::vector<ClosedLoop>& closed() const { return closed_; }

 private:
  struct Pending {
    Stamp found, due;
    std::shared_ptr<MapCorrection> correction;
    std::shared_ptr<BackgroundWork> work;
  };
  double sigma_px_;
  VisualLoopOptions options_;
  std::optional<VisualLoopDetector> detector_;
  std::optional<Pending> pending_;
  std::vector<ClosedLoop> closed_;
};

}  // namespace mapweave::visual
