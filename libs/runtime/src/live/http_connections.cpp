#include "http_connections.h"

#include <mapweave/core/log.h>

#include <poll.h>

#include <algorithm>
#include <array>
#include <chrono>

namespace mapweave::runtime {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kToSend = 5s;   // a request
constexpr auto kToTake = 30s;  // a response
constexpr auto kToClose = 500ms;
constexpr auto kSlice = 50ms;  // between two looks whether the server ends
constexpr std::size_t kMostLeftBytes = 1 << 16;

class Connection : public httplib::Stream {
 public:
  Connection(socket_t socket, const std::atomic<bool>& ends) : socket_(socket), ends_(ends) {}
  ~Connection() override { ::close(socket_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  bool is_readable() const override { return next_ < filled_ || wait(POLLIN, read_until_); }
  bool is_writable() const override { return wait(POLLOUT, Clock::now() + kToTake); }
  ssize_t read(char* bytes, std::size_t size) override {
    if (next_ == filled_) {
      if (received_ >= BoundedServer::kMostRequestBytes || !wait(POLLIN, read_until_)) return -1;
      const ssize_t count = ::recv(socket_, buffer_.data(), buffer_.size(), 0);
      if (count <= 0) return count;
      next_ = 0;
      filled_ = static_cast<std::size_t>(count);
      received_ += filled_;
    }
    const std::size_t count = std::min(size, filled_ - next_);
    std::copy_n(buffer_.begin() + static_cast<std::ptrdiff_t>(next_), count, bytes);
    next_ += count;
    return static_cast<ssize_t>(count);
  }
  ssize_t write(const char* bytes, std::size_t size) override {
    const auto until = Clock::now() + kToTake;
    for (std::size_t sent = 0; sent < size;) {
      if (!wait(POLLOUT, until)) return -1;
      const ssize_t count = ::send(socket_, bytes + sent, size - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
      if (count < 0 && errno != EAGAIN && errno != EINTR) return -1;
      sent += static_cast<std::size_t>(std::max<ssize_t>(count, 0));
    }
    return static_cast<ssize_t>(size);
  }
  void get_remote_ip_and_port(std::string&, int&) const override {}
  void get_local_ip_and_port(std::string&, int&) const override {}
  socket_t socket() const override { return socket_; }

  // What the other end still sends is read, so that it gets the response before it learns that nobody listens.
  void finish() {
    ::shutdown(socket_, SHUT_WR);
    const auto until = Clock::now() + kToClose;
    std::size_t left = 0;
    while (left < kMostLeftBytes && wait(POLLIN, until)) {
      const ssize_t count = ::recv(socket_, buffer_.data(), buffer_.size(), 0);
      if (count <= 0) return;
      left += static_cast<std::size_t>(count);
    }
  }

 private:
  bool wait(short what, Clock::time_point until) const {
    while (true) {
      pollfd one{socket_, what, 0};
      const int ready = ::poll(&one, 1, static_cast<int>(std::chrono::milliseconds(kSlice).count()));
      if (ready > 0) return true;
      if ((ready < 0 && errno != EINTR) || ends_ || Clock::now() >= until) return false;
    }
  }

  const socket_t socket_;
  const std::atomic<bool>& ends_;
  const Clock::time_point read_until_ = Clock::now() + kToSend;
  std::array<char, 4096> buffer_;
  std::size_t next_ = 0, filled_ = 0, received_ = 0;
};

class BoundedQueue : public httplib::TaskQueue {
 public:
  BoundedQueue(int threads, const std::atomic<bool>& ends)
      : most_(2 * static_cast<std::size_t>(threads)), ends_(ends), pool_(static_cast<std::size_t>(threads)) {}
  void enqueue(std::function<void()> task) override {
    std::unique_lock lock(mutex_);
    while (held_ >= most_ && !ends_) changed_.wait_for(lock, kSlice);
    ++held_;
    pool_.enqueue([this, task = std::move(task)] {
      task();
      const std::lock_guard done(mutex_);
      --held_;
      changed_.notify_one();
    });
  }
  void shutdown() override { pool_.shutdown(); }

 private:
  const std::size_t most_;
  const std::atomic<bool>& ends_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::size_t held_ = 0;
  httplib::ThreadPool pool_;
};

}  // namespace

BoundedServer::BoundedServer(int threads) {
  new_task_queue = [this, threads] { return new BoundedQueue(threads, ends_); };
  set_socket_options([](socket_t socket) {  // the library's own would share a port with another program
    const int yes = 1;
    ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  });
}

int BoundedServer::open(const std::string& host, int port) {
  constexpr int kWaitingInSystem = 64;  // the library has room for 5, and who finds none tries again a second later
  errno = 0;
  const int bound = port == 0 ? bind_to_any_port(host) : bind_to_port(host, port) ? port : -1;
  if (bound >= 0) ::listen(svr_sock_, kWaitingInSystem);
  return bound;
}

bool BoundedServer::process_and_close_socket(socket_t socket) {
  Connection connection(socket, ends_);
  bool is_closed = false, is_done = false;
  if (!connection.is_readable()) return false;
  try {  // many ranges of one text would be many copies of it
    is_done = process_request(connection, true, is_closed, [](httplib::Request& request) { request.ranges.clear(); });
  } catch (const std::exception& error) {
    log(LogLevel::debug, "a request for the page was given up: " + std::string(error.what()));
  }
  connection.finish();
  return is_done;
}

}  // namespace mapweave::runtime
