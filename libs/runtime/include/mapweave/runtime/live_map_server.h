#pragma once
// An edge's camera map server with its own threads, for cameras that do not wait (CVS III-B): a queue for each client,
// handlers that take from them in turn, and maps that are merged aside. What it says it has stored is in its journal.

#include <mapweave/runtime/live_options.h>
#include <mapweave/tiers/visual_server.h>
#include <mapweave/transport/channel.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace mapweave::runtime {

// What one client's run has cost so far (CVS, table II), and how long what it said waited. Seconds: of processor time,
// but for waiting.
struct ClientCounts {
  SessionId session;  // empty: sum of clients that sent no hello, or left beyond the 1000 last
  std::uint64_t received_bytes = 0, sent_bytes = 0;
  std::uint64_t updates = 0, views = 0, shares = 0, places = 0, refused = 0;
  double update_s = 0.0;                        // decoding updates and adding them to the maps
  double retrieval_s = 0.0;                     // choosing what to send for its views
  double sending_s = 0.0;                       // encoding what is sent
  double place_s = 0.0;                         // finding places
  double waited_s = 0.0, longest_wait_s = 0.0;  // waiting time of updates, from arrival to handling
  double longest_place_s = 0.0;                 // longest time from a place request to its answer
};
// Adds counts and seconds to the sum; keeps the longer of the longest times.
void add(ClientCounts& sum, const ClientCounts& more);

struct ServerCounts {
  std::vector<ClientCounts> clients;  // sorted by session
  int merges = 0;
  double merging_s = 0.0, longest_merge_s = 0.0;  // processor time of merges; wall time of the longest one
  double saving_s = 0.0;                          // processor time of writing the journal
  double longest_hold_s = 0.0;                    // longest time that one thread locked the maps
  bool is_merging = false;                        // a merge runs, or the pause after it with enough new keyframes
  std::vector<std::string> notes;  // for people, of the last merge: why cameras of one robot are not merged
  std::string trouble;             // why it can no longer save or merge; empty: it can
};

// All calls are thread-safe. Options of the server that speak of data time (`wait`, `fuse_delay_s`) have no effect: a
// merge counts when it is done.
class LiveMapServer {
 public:
  // Goes on where the journal ends; without one, what it has is gone when it ends. Throws Error as UpdateJournal, and
  // kCorrupt where the journal holds what no server has stored. rig: of clients that are cameras of one robot.
  LiveMapServer(TierId edge, tiers::ServerOptions server, fusion::FusionOptions fusion, LiveServerOptions options,
                const std::optional<std::filesystem::path>& journal, rig::RigOptions rig = {});
  ~LiveMapServer();  // ends as finish() does

  // A client's end of a channel in this process, for one run from its hello on; subjects: tiers/subjects.h. Where the
  // same run says hello on another channel, this one is closed: a wire that broke. May outlive the server. Letting go
  // of it closes it. Throws as serve().
  std::shared_ptr<transport::Channel> connect(const std::optional<RobotId>& robot = std::nullopt);
  // The server's end of any channel to a client. Updates are acknowledged once they are in the journal, all else once
  // it is handled. robot: nobody comes on it but this robot's cameras. Throws Error(kBadInput) where there are too
  // many; the channel is closed where the server has ended.
  void serve(std::shared_ptr<transport::Channel> client, const std::optional<RobotId>& robot = std::nullopt);

  // Robots whose maps must not be matched to each other from the next merge on, the lower id first.
  void refuse(std::set<std::pair<RobotId, RobotId>> robots);

  // A judgement that is not to be believed from the next merge on, which begins soon; in the journal when it returns.
  // Throws Error(kCannotWrite) where it cannot be saved now: it counts all the same, and is saved once there is room;
  // kBadInput after finish().
  void veto(const Hash& judgement);

  // Where a robot is by what its cameras said last, as VisualServer::robot: for who sends it somewhere.
  std::optional<tiers::RobotInTeam> robot(const RobotId& robot) const;

  ServerCounts counts() const;
  // What has been handled is saved, what waits in queues is dropped (no client was informed that it is stored), threads
  // end. Channels are closed. What it knows may be read from then on.
  tiers::VisualServer& finish();

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace mapweave::runtime
