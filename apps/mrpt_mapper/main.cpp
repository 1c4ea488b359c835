// mrpt_mapper: MRPT's laser engines in a process of their own, one robot each. Started by laser::ExternalMapper; the
// protocol is described in <mapweave/laser/mapper_protocol.h>: frames on standard input, frames on standard output.

#include "engine.h"

#include <mapweave/core/exit_code.h>
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

// The next message; the stream's end before the last one means that the program is gone.
MapperInput next_message(protocol::FrameParser& parser) {
  while (true) {
    if (const auto frame = parser.next()) return decode_mapper_input(*frame, protocol::kStream);
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
  const MapperInput first = next_message(parser);
  const auto* start = std::get_if<EngineStart>(&first);
  if (start == nullptr) protocol::fail("the first message names no engine");
  const protocol::EngineOptions options = protocol::options_of(*start);
  limit_memory(options);
  const auto engine = std::visit([](const auto& chosen) { return mrpt_mapper::make_engine(chosen); }, options);

  std::vector<ScanPose> poses;
  mrpt_mapper::ScanMotion motion([&](const mrpt_mapper::MovedScan& scan) {
    engine->add(scan);
    poses.push_back({{}, scan.previous_from_this, scan.by_wheels});
    write_all(output, protocol::framed(MapperProgress{poses.size()}));
  });
  std::shared_ptr<const ScanGeometry> geometry;
  const auto answer = [&] {
    const auto trajectory = engine->trajectory();
    for (std::size_t i = 0; i < poses.size(); ++i) poses[i].map_from_robot = trajectory[i];
    write_all(output, protocol::frames_of(poses));
  };
  for (bool more = true; more;) {
    MapperInput message = next_message(parser);
    if (std::holds_alternative<PosesWanted>(message)) {
      answer();
      continue;
    }
    auto* sensed = std::get_if<Sensed>(&message);
    if (sensed == nullptr) protocol::fail("a second engine");
    if (auto* scan = std::get_if<PackedScan>(&sensed->body)) {
      if (geometry && *scan->geometry == *geometry)
        scan->geometry = geometry;  // one for all
      else
        protocol::expect_usable(*(geometry = scan->geometry));
      motion.add_scan(sensed->stamp, std::move(*scan));
    } else if (const auto* odometry = std::get_if<Pose3>(&sensed->body)) {
      motion.add_odometry(sensed->stamp, planar(*odometry));
    } else {
      more = !std::holds_alternative<StreamEnd>(sensed->body);
    }
  }
  motion.finish();
  answer();
}

}  // namespace

int main() {
  if (::isatty(STDIN_FILENO) != 0 || ::isatty(STDOUT_FILENO) != 0) {
    std::fputs("mrpt_mapper is started by mapweave (laser engines rbpf and icp); it is not run by hand\n", stderr);
    return static_cast<int>(mapweave::ExitCode::wrong_usage);
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
  write_all(output, protocol::framed(Refusal{Error(ErrorCode::kHelperFailed, failure)}));
  std::_Exit(EXIT_FAILURE);
}
