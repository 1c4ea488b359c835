#pragma once
// A camera client's end of the wire to its edge's camera map server: what it says and when, and what becomes of what it
// receives. The client itself goes on whether or not anybody listens. A state machine: no thread, no clock, no network.

#include <mapweave/maps/receipt.h>
#include <mapweave/tiers/byte_allowance.h>
#include <mapweave/transport/outbox.h>
#include <mapweave/visual/visual_client.h>

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::tiers {

struct UplinkOptions {
  double most_bytes_per_s = 0.0;
  int least_features = 60;
  template <class Visitor>
  void describe(Visitor& v) {
    v.non_negative(
        "most_bytes_per_s", most_bytes_per_s,
        "largest mean rate in bytes per second at which a camera client sends; smaller values first thin the features "
        "of keyframes, then delay keyframes; larger values send more; poses are sent in any case; 0: unlimited");
    v.integer("least_features", least_features, 1, 100000,
              "least number of features that a keyframe is sent with, however low the rate limit "
              "(uplink.most_bytes_per_s); larger values describe keyframes better and delay them more");
  }
};

class CameraAgent {
 public:
  // outbox: empty, for what nobody has confirmed; null: in memory.
  explicit CameraAgent(visual::ClientPlace place, UplinkOptions options = {},
                       std::unique_ptr<transport::Outbox> outbox = nullptr);

  // Whose messages these are, once the client has begun; before, there is nothing to say.
  const std::optional<SessionId>& session() const { return session_; }
  // Encoded MapUpdates, in the order of their numbers: what is new of the client's maps, and what has to be repeated.
  // Nothing new while too much is in flight that nobody has confirmed: the client keeps it together meanwhile. None is
  // longer than the shortest queue of a live server, but for one of a single keyframe that is. `now`: of data.
  std::vector<transport::Envelope> updates(visual::VisualClient& client, Stamp now);
  // Of those, one that did not get onto the wire: it is sent again.
  void put_back(const transport::Envelope& update);
  // The client has ended: what it still has to publish is bounded by nothing.
  void lift_limit() { options_.most_bytes_per_s = 0.0; }
  // What the server has: by its answer to an update; by its answer to a greeting after a break, when all that is not
  // stored is sent again. A server that lacks what was confirmed before, or has what was never published, is another
  // one: such a map is published to it from the beginning. Answered: how many keyframes of such maps the client has
  // forgotten, which none but the server before may have kept.
  void stored(const Receipt& receipt);
  std::size_t reconnected(visual::VisualClient& client, const std::vector<Receipt>& receipts);
  // Where the client is; nullopt while it has no place.
  std::optional<std::string> view(const visual::VisualClient& client);
  // Where was this taken? Of a client that has no place.
  std::optional<std::string> place_request(visual::VisualClient& client);
  // Throws Error(kCorrupt, kUnsupported) for what cannot be decoded; what makes no sense to the client is left.
  void receive_share(visual::VisualClient& client, std::string_view bytes);
  visual::PlaceVerdict receive_place(visual::VisualClient& client, std::string_view bytes);

  std::uint64_t sent_bytes() const { return sent_bytes_; }
  std::uint64_t received_bytes() const { return received_bytes_; }
  std::uint64_t waiting_bytes() const { return outbox_->bytes(); }  // that nobody has confirmed

 private:
  struct Numbers {
    std::uint64_t published = 0, confirmed = 0;
    std::uint32_t share = 0, missed = 0, missed_after = 0;  // the last one, and as in ClientView
    std::uint32_t missed_by_client = 0;                     // of these, by what it says itself
  };
  bool is_repeated(const Share& share);
  MapUpdate fitted(MapUpdate update, double room_bytes) const;
  void enqueue(MapUpdate update);
  std::string counted(std::string bytes);
  void count(const std::string& bytes);

  visual::ClientPlace place_;
  UplinkOptions options_;
  std::optional<SessionId> session_;
  std::unique_ptr<transport::Outbox> outbox_;
  std::map<MapId, Numbers> numbers_;  // of updates (theirs, not the client's, which knows of no parts) and of shares
  ByteAllowance allowance_;
  std::uint64_t sent_bytes_ = 0, received_bytes_ = 0;
};

}  // namespace mapweave::tiers
