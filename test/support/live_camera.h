#pragma once
// A camera that does not wait, with a client of its own, on the wire to its edge's camera map server.

#include <mapweave/runtime/camera_link.h>
#include <support/live_client.h>

namespace mapweave::test {

struct LiveCameraOptions {
  visual::ClientOptions client;
  tiers::UplinkOptions uplink;
  matching::ChosenVocabulary vocabulary;  // the camera map server's vocabulary
  double share_rate_hz = 2.0;             // how often it publishes and receives, per second of data
};

// Goes on whether or not anybody listens. All calls are thread-safe.
class LiveCamera {
 public:
  LiveCamera(visual::ClientPlace place, const Pinhole& camera, double baseline_m, LiveCameraOptions options,
             std::shared_ptr<transport::Channel> channel);

  // As LiveClient's: never waits, a frame that waits already is dropped.
  void add(visual::Frame frame) { client_.add(std::move(frame)); }
  void add(visual::FeatureFrame frame) { client_.add(std::move(frame)); }
  int dropped() const { return client_.dropped(); }
  // As CameraLink::use(): to a server that is there again, or another one.
  void reconnect(std::shared_ptr<transport::Channel> channel) { link_.use(std::move(channel)); }
  // No more frames come. Publishes the rest, and waits so long for the server to confirm it. As LiveClient::finish
  // otherwise.
  visual::VisualClient& finish(std::chrono::milliseconds patience);

  // To be read after finish().
  const tiers::CameraAgent& agent() const { return link_.agent(); }
  const std::string& refusal() const { return link_.refusal(); }

 private:
  runtime::CameraLink link_;  // used by the tracking thread alone until that has ended
  LiveClient client_;
};

inline LiveCamera::LiveCamera(visual::ClientPlace place, const Pinhole& camera, double baseline_m,
                              LiveCameraOptions options, std::shared_ptr<transport::Channel> channel)
    : link_(std::move(place), {options.uplink, options.vocabulary.get().hash(), options.share_rate_hz},
            std::move(channel)),
      client_(
          camera, baseline_m, std::move(options.client), options.vocabulary.get(),
          [this](visual::VisualClient& client, Stamp now, const visual::Tracked&) { link_.exchange(client, now); }) {}

inline visual::VisualClient& LiveCamera::finish(std::chrono::milliseconds patience) {
  constexpr std::chrono::milliseconds kTurn{50};
  visual::VisualClient& client = client_.finish();
  const auto end = std::chrono::steady_clock::now() + patience;
  while (std::chrono::steady_clock::now() < end && link_.publish_rest(client, kTurn) && !link_.is_cut()) continue;
  return client;
}

}  // namespace mapweave::test
