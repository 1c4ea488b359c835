// mrpt_mapper: MRPT's laser engines in a process of their own, one robot each. Started by laser::ExternalMapper; the
// protocol is described in <mapweave/laser/mapper_protocol.h>: frames on standard input, frames on standard output.

#include "engine.h"

#include <mapweave/laser/mapper_protocol.h>

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <thread>

namespace {

using namespace mapweave;
namespace protocol = laser::protocol;

constexpr double kRoomBesideMaps_bytes = 1e9;  // libraries, stacks, the trajectory, MRPT's temporaries

void write_all(int stream, std::string_view bytes) {
  while (!bytes.empty()) {
    const auto written = ::write(stream, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) std::_Exit(EXIT_FAILURE);  // nobody listens
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

// The next frame; the stream's end before `end` means that the program is gone.
protocol::MapperFrame next_frame(protocol::FrameParser& parser) {
  while (true) {
    if (auto frame = parser.next()) return std::move(*frame);
    static std::array<char, 65536> bytes;
    const auto count = ::read(STDIN_FILENO, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) std::_Exit(EXIT_FAILURE);
    parser.feed({bytes.data(), static_cast<std::size_t>(count)});
  }
}

// Leaves when the other side of standard input has gone, even in the midst of a long computation.
void watch_for_orphanage() {
  while (true) {
    pollfd input{STDIN_FILENO, 0, 0};
    if (::poll(&input, 1, -1) > 0 && (input.revents & (POLLHUP | POLLERR | POLLNVAL)) != 0) std::_Exit(EXIT_FAILURE);
  }
}

void limit_memory(const protocol::EngineOptions& options) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // their shadows are huge
  const double bytes =
      1e6 * std::visit([](const auto& engine) { return engine.memory_limit_mb; }, options) + kRoomBesideMaps_bytes;
  const rlimit limit{static_cast<rlim_t>(bytes), static_cast<rlim_t>(bytes)};
  ::setrlimit(RLIMIT_DATA, &limit);
#else
  (void)options;
  (void)kRoomBesideMaps_bytes;
#endif
}

void serve(int output) {
  protocol::FrameParser parser;
  const protocol::MapperFrame first = next_frame(parser);
  if (first.kind != protocol::Kind::start)
    protocol::fail("the first frame is of kind " + std::to_string(static_cast<int>(first.kind)));
  const protocol::EngineOptions options = protocol::decode_start(first.body);
  limit_memory(options);
  const auto engine = std::visit([](const auto& chosen) { return mrpt_mapper::make_engine(chosen); }, options);

  std::vector<protocol::ScanPose> poses;
  mrpt_mapper::ScanMotion motion([&](const mrpt_mapper::MovedScan& scan) {
    engine->add(scan);
    poses.push_back({{}, scan.previous_from_this, scan.by_wheels});
    write_all(output, protocol::encode_count(protocol::Kind::progress, poses.size()));
  });
  std::shared_ptr<const ScanGeometry> geometry;
  for (bool more = true; more;) {
    const protocol::MapperFrame frame = next_frame(parser);
    switch (frame.kind) {
      case protocol::Kind::geometry:
        geometry = std::make_shared<const ScanGeometry>(protocol::decode_geometry(frame.body));
        break;
      case protocol::Kind::scan: {
        auto [stamp, scan] = protocol::decode_scan(frame.body, geometry);
        motion.add_scan(stamp, std::move(scan));
        break;
      }
      case protocol::Kind::odometry: {
        const auto [stamp, odometry_from_robot] = protocol::decode_odometry(frame.body);
        motion.add_odometry(stamp, odometry_from_robot);
        break;
      }
      case protocol::Kind::end:
        if (!frame.body.empty()) protocol::fail("the last frame is not empty");
        more = false;
        break;
      default:
        protocol::fail("a frame of kind " + std::to_string(static_cast<int>(frame.kind)) + " is not for the helper");
    }
  }
  motion.finish();
  const auto trajectory = engine->trajectory();
  for (std::size_t i = 0; i < poses.size(); ++i) poses[i].map_from_robot = trajectory[i];
  write_all(output, protocol::encode_poses(poses) + protocol::encode_count(protocol::Kind::done, poses.size()));
}

}  // namespace

int main() {
  if (::isatty(STDIN_FILENO) != 0 || ::isatty(STDOUT_FILENO) != 0) {
    std::fputs("mrpt_mapper is started by mapweave (laser engines rbpf and icp); it is not run by hand\n", stderr);
    return 2;
  }
  // MRPT prints: the protocol keeps the true output for itself.
  const int output = ::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3);
  if (output < 0 || ::dup2(STDERR_FILENO, STDOUT_FILENO) < 0) return EXIT_FAILURE;
  ::signal(SIGPIPE, SIG_IGN);
  ::signal(SIGINT, SIG_IGN);  // Ctrl-C reaches the whole group: the program decides
  std::thread(watch_for_orphanage).detach();
  std::string failure;
  try {
    serve(output);
    std::fflush(nullptr);
    std::_Exit(EXIT_SUCCESS);
  } catch (const std::bad_alloc&) {
    failure = "memory_limit_mb reached";
  } catch (const std::exception& error) {
    failure = error.what();
  }
  if (failure.size() > 4000) failure.resize(4000);
  write_all(output, protocol::framed(protocol::Kind::failed, failure));
  std::_Exit(EXIT_FAILURE);
}
