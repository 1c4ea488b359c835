#pragma once
// What a service manager receives from a program that it runs, by the protocol of sd_notify(3): that it is ready, what
// it does (STATUS), that it still works (WATCHDOG), that it ends. Nothing where NOTIFY_SOCKET is not set.

#include <mapweave/runtime/live_cloud.h>

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

namespace mapweave::app {

// One turn of a program's work loop.
struct ServiceTurn {
  std::string status;      // for operators
  bool has_work = false;   // something waits to be done
  std::uint64_t done = 0;  // grows while that is done
};

ServiceTurn service_turn_of(const runtime::LiveRobotCounts&);
ServiceTurn service_turn_of(const runtime::LiveEdgeCounts&);
ServiceTurn service_turn_of(const runtime::LiveCloudCounts&);

// Not thread-safe. What cannot be sent at once is sent at a later turn.
class ServiceNotifier {
 public:
  ServiceNotifier();
  ~ServiceNotifier();  // the program ends
  ServiceNotifier(const ServiceNotifier&) = delete;
  ServiceNotifier& operator=(const ServiceNotifier&) = delete;

  // Several times within WATCHDOG_USEC. The first turn says that the program is ready. A program whose work stood still
  // for ten minutes does not say that it works.
  void turn(const ServiceTurn& turn);

 private:
  using Clock = std::chrono::steady_clock;
  bool send(const std::string& text) const;
  void show(const std::string& status, Clock::time_point now);
  bool stands_still(const ServiceTurn& turn, Clock::time_point now);

  int socket_ = -1;
  std::vector<char> address_;  // a sockaddr_un, as long as its name is
  bool is_ready_ = false;
  std::chrono::microseconds watchdog_{0};  // zero: nobody watches
  std::string status_;
  Clock::time_point next_status_{}, next_life_{}, worked_{};
  std::uint64_t done_ = 0;
};

}  // namespace mapweave::app
