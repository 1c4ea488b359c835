#pragma once
// A camera's client on the wire to its camera map server: what it says and when, and what becomes of what it receives.
// Wires may come and go; the client goes on whether or not anybody listens.

#include <mapweave/tiers/camera_agent.h>
#include <mapweave/tiers/kept_map.h>
#include <mapweave/transport/channel.h>

#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::runtime {

struct CameraLinkOptions {
  tiers::UplinkOptions uplink;
  Hash vocabulary;             // the camera map server's vocabulary
  double share_rate_hz = 2.0;  // how often it publishes and receives, per second of data
  // Wall time that something may wait for an answer. Then it is asked again, and the channel closed after five times
  // as long, since the next one may get through; 0: neither.
  double repeat_s = 0.0;
};

// Of the client's thread, but for use() and is_cut(), which are thread-safe. Never waits, but where `patience` says so.
class CameraLink {
 public:
  CameraLink(visual::ClientPlace place, CameraLinkOptions options,
             std::shared_ptr<transport::Channel> channel = nullptr);

  // Replaces the channel from the next exchange on: says hello, and publishes what that server has not stored,
  // the client's maps from the beginning where need be.
  void use(std::shared_ptr<transport::Channel> channel);
  bool is_cut() const;  // there is no channel, or it is closed

  // Publishes and receives, where it is time to by the stamps of the data. Answers whether it was.
  bool exchange(visual::VisualClient& client, Stamp now);
  // No more frames come: publishes the rest, within no limit of bytes, and receives for so long. Answers whether there
  // is something that the server has not confirmed.
  bool publish_rest(visual::VisualClient& client, std::chrono::milliseconds patience);
  // After the rest: asks for what the server keeps of what the client has forgotten, and receives for so long. Answers
  // whether all of it is there, or the server refuses.
  bool fetch_kept(visual::VisualClient& client, std::chrono::milliseconds patience);
  std::vector<tiers::KeptMap> take_kept();

  const visual::ClientPlace& place() const { return place_; }
  const tiers::CameraAgent& agent() const { return agent_; }
  bool is_welcome() const { return welcome_; }  // the server is there and takes what is said
  // The last refusal, by the server or of a message that is too long. Empty once a server has accepted the client.
  const std::string& refusal() const { return refusal_; }

 private:
  using Clock = std::chrono::steady_clock;
  bool publish(visual::VisualClient& client, Stamp now);  // true: there was something to publish
  void take_next_channel();
  void ask(visual::VisualClient& client);
  void receive(visual::VisualClient& client, std::chrono::milliseconds patience);
  void take(visual::VisualClient& client, const transport::Envelope& message);
  void look_for_silence();
  bool send(transport::Envelope message);
  void refused(const std::string& why);
  void note_lost(std::size_t forgotten);  // keyframes lost with the previous server

  visual::ClientPlace place_;
  CameraLinkOptions options_;
  mutable std::mutex mutex_;
  std::shared_ptr<transport::Channel> next_channel_;  // replaces channel_ at the next exchange
  std::shared_ptr<transport::Channel> channel_;       // changed under the mutex
  std::shared_ptr<transport::Channel> past_channel_;  // closed; its end may take time: of who connects
  tiers::CameraAgent agent_;
  std::optional<Stamp> last_;
  bool greeted_ = false, welcome_ = false;
  bool reported_too_long_ = false;  // a warning about a message was given for this channel
  std::string refusal_;
  std::optional<tiers::KeptParts> kept_;
  bool has_all_kept_ = false, is_kept_refused_ = false;
  Clock::time_point answered_at_ = Clock::now(), asked_for_kept_at_{};
};

}  // namespace mapweave::runtime
