#pragma once
// cpp-httplib's server with limits that it lacks: a request has a time and a size, waiting connections have a number,
// and all of them end at once when the server does, whatever the other end does. Nothing else includes its header.

#include <httplib.h>

#include <atomic>
#include <condition_variable>
#include <mutex>

namespace mapweave::runtime {

// One request, one response, and it is closed: what a refused request still holds is never taken for the next one.
class BoundedServer : public httplib::Server {
 public:
  static constexpr std::size_t kMostRequestBytes = 8192;

  // As many requests at once; as many connections again may wait for them, others wait in the system. Listens on no
  // port that another program listens on.
  explicit BoundedServer(int threads);
  // The port that it will listen on, of `port` 0 any that is free; -1: it cannot, and errno says why.
  int open(const std::string& host, int port);
  // From any thread. What can be written at once is still written; everything else ends.
  void end() { ends_ = true; }
  bool ends() const { return ends_; }

 private:
  bool process_and_close_socket(socket_t socket) override;
  std::atomic<bool> ends_{false};
};

}  // namespace mapweave::runtime
