#include "loop_closing.h"

#include <utility>

namespace mapweave::visual {

LoopClosing::LoopClosing(const std::optional<matching::BinaryVocabulary>& vocabulary, const ClientOptions& options)
    : sigma_px_(options.tracking.sigma_px), options_(options.loops) {
  if (vocabulary) detector_.emplace(*vocabulary, options);
}

void LoopClosing::add(const LandmarkMap& map, int keyframe) {
  if (detector_) detector_->add(map, keyframe);
}
void LoopClosing::remove(int keyframe) {
  if (detector_) detector_->remove(keyframe);
}

std::optional<FoundLoop> LoopClosing::look(LandmarkMap& map, int newest, const Pyramid& picture, const Motion& motion) {
  add(map, newest);
  if (!detector_ || pending_) return std::nullopt;
  return detector_->look(map, newest, picture, motion);
}

void LoopClosing::begin(const LandmarkMap& map, FoundLoop loop, Stamp now) {
  const auto correction = std::make_shared<MapCorrection>(map, std::move(loop), sigma_px_);
  const auto delay_ns = static_cast<std::int64_t>(options_.delay_s * 1e9);
  pending_ = Pending{
      now, {now.ns + delay_ns}, correction, std::make_shared<BackgroundWork>([correction] { correction->run(); })};
}

bool LoopClosing::is_due(Stamp now) const {
  return pending_ && (options_.wait ? pending_->due <= now : pending_->work->is_done());
}

std::vector<double> LoopClosing::apply(LandmarkMap& map, Stamp now) {
  const Pending pending = *std::exchange(pending_, std::nullopt);
  pending.work->run();
  const std::vector<double> scales = pending.correction->apply(map);
  see_matches(map, pending.correction->loop(), sigma_px_);
  const auto& fixed = pending.correction->loop().fixed;
  closed_.push_back({pending.found, now, fixed ? std::optional(fixed->keyframe) : std::nullopt});
  return scales;
}

}  // namespace mapweave::visual
