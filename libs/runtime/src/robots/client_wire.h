#pragma once
// One client of a live camera map server: its channel, and what came over it and waits to be handled.

#include <mapweave/runtime/live_map_server.h>

#include <chrono>
#include <deque>

namespace mapweave::runtime {

// Under the server's mutex, but for the channel, and for `kept`, which is of who handles it.
struct ClientWire {
  using Clock = std::chrono::steady_clock;
  struct Kept {
    MapId map;
    std::vector<std::string> parts;
  };
  struct Waiting {
    transport::Channel::Delivery delivery;
    Clock::time_point since;
  };
  std::shared_ptr<transport::Channel> channel;
  std::optional<RobotId> robot;  // whose cameras alone may come on it
  std::deque<Waiting> waiting;
  bool is_handled = false, is_closed = false;
  double spent_s = 0.0;                   // of handlers' time, or as much as others that waited when it came to wait
  ClientCounts counts;                    // with its session from hello on
  std::optional<std::vector<Kept>> kept;  // for a client that has ended, since it asked first
};

}  // namespace mapweave::runtime
