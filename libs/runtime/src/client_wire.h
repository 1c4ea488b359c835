#pragma once
// What waits in both directions between a live client and its server.

#include <mapweave/runtime/live_map_server.h>

#include <chrono>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>

namespace mapweave::runtime {

struct LiveMapServer::Link::Wire {
  using Clock = std::chrono::steady_clock;
  struct Waiting {
    ClientMessage message;
    Clock::time_point since;
  };
  // Under the server's mutex: what the client said.
  std::deque<Waiting> waiting;
  std::size_t waiting_bytes = 0;
  bool is_handled = false, is_closed = false;
  double spent_s = 0.0;  // of handlers' time, or as much as others that waited when it came to wait
  ClientCounts counts;   // with its session from hello on

  // What it has to receive. Thread-safe.
  void post(ServerMessage message);
  bool has_room(std::size_t most_bytes);
  void end();
  bool is_over();
  std::vector<ServerMessage> take(std::chrono::milliseconds patience);

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<ServerMessage> answers_;
  std::size_t answer_bytes_ = 0;
  std::map<MapId, tiers::Receipt> receipts_;  // the last one of each map
  std::string refusal_;                       // the last one
  bool is_over_ = false;
};

}  // namespace mapweave::runtime
