#include "endurance_team.h"

#include <mapweave/simulation/feature_sensor.h>
#include <mapweave/tiers/camera_agent.h>
#include <support/seen_frame.h>

#include <malloc.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <set>

namespace mapweave::endurance {
namespace {

constexpr double kPrinted_s = 300.0;

// Of this process: what it asked for and did not give back, and what is in memory that no other process shares.
double held_mb() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd) / 1e6;
}
double resident_mb() {
  std::ifstream file("/proc/self/smaps_rollup");
  double kilobytes = 0.0;
  for (std::string line; std::getline(file, line);)
    if (line.rfind("Private_", 0) == 0) kilobytes += std::atof(line.c_str() + line.find(':') + 1);
  return kilobytes * 1024.0 / 1e6;
}

enum class Kind : char { hello, update, view, place_request, receipt, share, place_answer, over, end };
struct Message {
  Kind kind = Kind::end;
  std::string bytes;
};

// Between a robot and the server. Each of them says all that it has to say, then `over`: no buffer is ever full on both
// sides.
class Wire {
 public:
  explicit Wire(int file) : file_(file) {}
  void say(Kind kind, const std::string& bytes = {}) const {
    const std::uint64_t size = bytes.size();
    put(&kind, sizeof kind);
    put(&size, sizeof size);
    put(bytes.data(), bytes.size());
  }
  Message receive() const {
    Message message;
    std::uint64_t size = 0;
    get(&message.kind, sizeof message.kind);
    get(&size, sizeof size);
    message.bytes.resize(size);
    get(message.bytes.data(), size);
    return message;
  }

 private:
  void put(const void* from, std::size_t size) const {
    for (const char* at = static_cast<const char*>(from); size > 0;) {
      const ssize_t done = send(file_, at, size, MSG_NOSIGNAL);
      if (done <= 0) throw Error(ErrorCode::kInternal, "the other process is gone");
      at += done;
      size -= static_cast<std::size_t>(done);
    }
  }
  void get(void* to, std::size_t size) const {
    for (char* at = static_cast<char*>(to); size > 0;) {
      const ssize_t done = recv(file_, at, size, 0);
      if (done <= 0) throw Error(ErrorCode::kInternal, "the other process is gone");
      at += done;
      size -= static_cast<std::size_t>(done);
    }
  }
  int file_;
};

class Robot {
 public:
  Robot(const visual::ClientPlace& place, const Pinhole& camera, const simulation::FeatureRecording& recording,
        double rate_hz, double share_rate_hz)
      : place_(place),
        recording_(recording),
        rate_hz_(rate_hz),
        often_(static_cast<std::size_t>(std::lround(rate_hz / share_rate_hz))),
        before_mb_(held_mb()),
        client_(camera, 0.0, {}, matching::shipped_vocabulary()),
        agent_(place) {}

  void drive(const Wire& server) {
    for (std::size_t i = 0; i < recording_.frame_count(); ++i) {
      const visual::FeatureFrame frame = test::frame_of(recording_.frame(i));
      const std::clock_t before = std::clock();
      const visual::TrackState state = client_.add(frame).state;
      spent_s_ += static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC;
      lost_ += state == visual::TrackState::lost;
      ++frames_;
      if ((i + 1) % often_ == 0) exchange(server, frame.stamp);
      if ((i + 1) % static_cast<std::size_t>(kPrinted_s * rate_hz_) == 0)
        print(static_cast<double>(i + 1) / rate_hz_ / 60.0);
    }
    server.say(Kind::end);
  }

 private:
  void exchange(const Wire& server, Stamp now) {
    if (client_.run(place_)) {
      if (!std::exchange(greeted_, true))
        server.say(Kind::hello, encode(Hello{*client_.run(place_), matching::shipped_vocabulary().hash()}));
      for (const auto& update : agent_.updates(client_, now)) server.say(Kind::update, update.bytes);
      if (const auto view = agent_.view(client_))
        server.say(Kind::view, *view);
      else if (const auto request = agent_.place_request(client_))
        server.say(Kind::place_request, *request);
    }
    server.say(Kind::over, std::to_string(now.ns));
    for (Message message = server.receive(); message.kind != Kind::over; message = server.receive()) {
      if (message.kind == Kind::receipt)
        for (const Receipt& receipt : decode_receipts(message.bytes, "receipt")) agent_.stored(receipt);
      if (message.kind == Kind::share) agent_.receive_share(client_, message.bytes);
      if (message.kind == Kind::place_answer) agent_.receive_place(client_, message.bytes);
    }
  }

  void print(double minute) {
    std::printf("%8.0f %8s %8.2f %8.1f %8.1f %10zu %10zu %10zu %6zu %6d %8.1f %8.1f\n", minute,
                place_.client.robot.str().c_str(), 1e3 * spent_s_ / frames_, held_mb() - before_mb_, resident_mb(),
                client_.keyframes().size(), client_.landmarks().size(), client_.borrowed(), client_.borrowed_seen(),
                lost_, 1e-3 * static_cast<double>(agent_.waiting_bytes()),
                1e-6 * static_cast<double>(agent_.received_bytes()));
    std::fflush(stdout);
    spent_s_ = 0.0;
    frames_ = 0;
  }

  visual::ClientPlace place_;
  const simulation::FeatureRecording& recording_;
  double rate_hz_;
  std::size_t often_;  // frames from one exchange to the next
  double before_mb_;
  visual::VisualClient client_;
  tiers::CameraAgent agent_;
  bool greeted_ = false;
  double spent_s_ = 0.0;  // of a processor, on frames since the last line
  int frames_ = 0, lost_ = 0;
};

class Server {
 public:
  explicit Server(const tiers::ServerOptions& sharing) : before_mb_(held_mb()), server_(TierId("edge"), sharing, {}) {}

  void serve(std::vector<Wire> robots) {
    sessions_.resize(robots.size());
    std::vector<bool> ended(robots.size(), false);
    for (std::size_t left = robots.size(); left > 0;) {
      for (std::size_t i = 0; i < robots.size(); ++i) {
        if (ended[i]) continue;
        std::vector<Message> messages;
        do messages.push_back(robots[i].receive());
        while (messages.back().kind != Kind::over && messages.back().kind != Kind::end);
        if (messages.back().kind == Kind::end) {
          ended[i] = true;
          --left;
        } else {
          answer(robots[i], sessions_[i], messages);
        }
      }
      server_.advance(now_, pool_);
      if (!begun_) begun_ = now_;
      const double minutes = seconds_between(*begun_, now_) / 60.0;
      if (static_cast<int>(60.0 * minutes / kPrinted_s) > lines_) {
        ++lines_;
        print(60.0 * minutes);
      }
    }
  }

 private:
  void answer(const Wire& robot, std::optional<SessionId>& session, const std::vector<Message>& messages) {
    for (const Message& message : messages) {
      if (message.kind == Kind::hello) {
        const Hello hello = decode_hello(message.bytes, "a robot");
        session = hello.session;
        server_.greet(hello);
      } else if (message.kind == Kind::update) {
        robot.say(Kind::receipt, encode(std::vector<Receipt>{server_.receive(*session, message.bytes).receipt}));
      } else if (message.kind == Kind::view) {
        if (const auto share = server_.share(*session, decode_client_view(message.bytes, "a robot")))
          robot.say(Kind::share, encode(*share));
      } else if (message.kind == Kind::place_request) {
        const auto found = server_.place(*session, decode_place_request(message.bytes, "a robot"), pool_);
        if (found) robot.say(Kind::place_answer, encode(*found));
      } else {
        now_ = std::max(now_, Stamp{std::atoll(message.bytes.c_str())});
      }
    }
    robot.say(Kind::over);
  }

  void print(double seconds) {
    std::size_t published = 0, joined = 0;
    for (const Map& map : server_.maps()) published += map.nodes.size();
    for (const fusion::Component& component : server_.merged().components) joined += component.map.nodes.size();
    std::printf("%8.0f %8s %8s %8.1f %8.1f %10zu  of them joined %zu, in %zu maps; %.0f kB for each\n", seconds / 60.0,
                "server", "", held_mb() - before_mb_, resident_mb(), published, joined,
                server_.merged().components.size(),
                1e3 * (held_mb() - before_mb_) / static_cast<double>(std::max<std::size_t>(1, published)));
    std::fflush(stdout);
  }

  double before_mb_;
  WorkerPool pool_{1};
  tiers::VisualServer server_;
  std::vector<std::optional<SessionId>> sessions_;
  Stamp now_;
  std::optional<Stamp> begun_;
  int lines_ = 0;
};

}  // namespace

void drive_team(const simulation::WorldOptions& options, const tiers::ServerOptions& sharing) {
  mallopt(M_ARENA_MAX, 1);  // mallinfo2() reports one
  WorkerPool here(1);
  const simulation::World world(options, here);
  const simulation::FeatureOptions features;
  const simulation::LandmarkField field(world.scene(0), world.buildings()[0], features);
  std::printf("%8s %8s %8s %8s %8s %10s %10s %10s %6s %6s %8s %8s\n", "minute", "who", "ms", "held MB", "MB",
              "keyframes", "landmarks", "borrowed", "seen", "lost", "wait kB", "received MB");
  std::fflush(stdout);
  std::vector<Wire> wires;
  for (std::size_t i = 0; i < options.robots.size(); ++i) {
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, ends) != 0)
      throw Error(ErrorCode::kInternal, "cannot open a pair of sockets");
    const pid_t child = fork();
    if (child < 0) throw Error(ErrorCode::kInternal, "cannot start a process");
    if (child == 0) {
      close(ends[0]);
      try {
        const auto& model = options.cameras[0].intrinsics();
        const simulation::FeatureRecording recording(world, field, features, i, 0);
        const visual::ClientPlace place{
            {RobotId(options.robots[i].id), SensorId(options.cameras[0].id)},
            compose(inverse(world.world_from_robot(i, 0.0)), recording.frame(0).world_from_camera)};
        Robot robot(place, {model.width, model.height, model.fx, model.fy, model.cx, model.cy}, recording,
                    options.cameras[0].frames_per_second, sharing.share_rate_hz);
        robot.drive(Wire(ends[1]));
      } catch (const std::exception& error) {
        std::fprintf(stderr, "%s: %s\n", options.robots[i].id.c_str(), error.what());
        _exit(1);
      }
      _exit(0);
    }
    close(ends[1]);
    wires.emplace_back(ends[0]);
  }
  Server(sharing).serve(wires);
  while (wait(nullptr) > 0) {}
}

}  // namespace mapweave::endurance
