#include <mapweave/runtime/live_camera.h>

#include <utility>

namespace mapweave::runtime {

LiveCamera::LiveCamera(visual::ClientPlace place, const Pinhole& camera, double baseline_m, LiveCameraOptions options,
                       std::shared_ptr<transport::Channel> channel)
    : link_(std::move(place), {options.uplink, options.vocabulary.get().hash(), options.share_rate_hz},
            std::move(channel)),
      client_(
          camera, baseline_m, std::move(options.client), options.vocabulary.get(),
          [this](visual::VisualClient& client, Stamp now, const visual::Tracked&) { link_.exchange(client, now); }) {}

visual::VisualClient& LiveCamera::finish(std::chrono::milliseconds patience) {
  constexpr std::chrono::milliseconds kTurn{50};
  visual::VisualClient& client = client_.finish();
  const auto end = std::chrono::steady_clock::now() + patience;
  while (std::chrono::steady_clock::now() < end && link_.publish_rest(client, kTurn) && !link_.is_cut()) continue;
  return client;
}

}  // namespace mapweave::runtime
