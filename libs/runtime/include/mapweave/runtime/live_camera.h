#pragma once
// A camera that does not wait, with a client of its own, on the wire to its edge's map server.

#include <mapweave/tiers/camera_agent.h>
#include <mapweave/transport/channel.h>
#include <mapweave/visual/live_client.h>

#include <mutex>

namespace mapweave::runtime {

struct LiveCameraOptions {
  visual::ClientOptions client;
  tiers::UplinkOptions uplink;
  matching::ChosenVocabulary vocabulary;  // its map server's
  double share_rate_hz = 2.0;             // of data: how often it publishes and receives
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
  // To a server that is there again, or another one: says hello, and publishes what that has not stored, its maps from
  // the beginning where need be.
  void reconnect(std::shared_ptr<transport::Channel> channel);
  // No more frames come. Publishes the rest, and waits so long for the server to confirm it. As LiveClient::finish
  // otherwise.
  visual::VisualClient& finish(std::chrono::milliseconds patience);

  // To be read after finish().
  const tiers::CameraAgent& agent() const { return agent_; }
  const std::string& refusal() const {
    return refusal_;
  }  // the last one, of the server's or because a message can never be sent

 private:
  // Whether it had anything to publish.
  bool publish(visual::VisualClient& client, Stamp now);
  void ask(visual::VisualClient& client);
  void receive(visual::VisualClient& client, std::chrono::milliseconds patience);
  bool send(transport::Envelope message);
  void refused(const std::string& why);
  void note_lost(std::size_t forgotten);  // keyframes, with the server before

  std::mutex mutex_;
  std::shared_ptr<transport::Channel> next_channel_;  // in place of the other

  // Of the tracking thread, until it has ended.
  visual::ClientPlace place_;
  std::shared_ptr<transport::Channel> channel_;
  tiers::CameraAgent agent_;
  Hash vocabulary_;
  std::optional<Stamp> last_;
  bool greeted_ = false, welcome_ = false;
  bool reported_too_long_ = false;  // that something is, for this channel
  std::string refusal_;
  visual::LiveClient client_;
};

}  // namespace mapweave::runtime
