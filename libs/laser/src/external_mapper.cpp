#include <mapweave/core/interrupt.h>
#include <mapweave/laser/external_mapper.h>

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <filesystem>

extern char** environ;

namespace mapweave::laser {
namespace {

constexpr int kInterruptCheck_ms = 100;  // how late an interruption may be noticed
constexpr int kExitChecks = 1000,
              kExitCheck_us =
                  5000;  // a process that has closed its stream is given 5 s to end (it may be dumping core)
constexpr char kRemedy[] = "run this robot again, or with another laser engine";

std::string path_of_helper(const std::string& chosen) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  const fs::path path =
      chosen.empty() ? fs::read_symlink("/proc/self/exe", ignored).parent_path() / "mrpt_mapper" : fs::path(chosen);
  if (!fs::is_regular_file(path, ignored) || ::access(path.c_str(), X_OK) != 0)
    throw Error(ErrorCode::kMissing, "the helper of laser engines rbpf and icp is not there, or not executable",
                path.string(), "build the target mrpt_mapper, or name its path with the option 'helper'");
  return path.string();
}

// posix_spawn's two argument objects, released together.
struct SpawnArguments {
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  SpawnArguments() {
    ::posix_spawn_file_actions_init(&files);
    ::posix_spawnattr_init(&attributes);
  }
  ~SpawnArguments() {
    ::posix_spawn_file_actions_destroy(&files);
    ::posix_spawnattr_destroy(&attributes);
  }
  SpawnArguments(const SpawnArguments&) = delete;
  SpawnArguments& operator=(const SpawnArguments&) = delete;
};

std::string system_message(int code) { return std::error_code(code, std::generic_category()).message(); }

}  // namespace

ExternalMapper::ExternalMapper(ClientId client, std::variant<RbpfOptions, IcpOptions> engine,
                               ExternalMapperOptions options)
    : client_(client), options_(std::move(options)) {
  map_.id = MapId(client_.robot.str());
  start(path_of_helper(options_.helper));
  try {
    send(protocol::framed(protocol::start_of(engine)));
  } catch (...) {
    end_helper();
    throw;
  }
}

ExternalMapper::~ExternalMapper() { end_helper(); }

// One socket serves as the helper's standard input and output: unlike a pipe it can be written to without SIGPIPE.
// Every descriptor of ours is close-on-exec, so when this process dies the helper sees its stream end.
// (PR_SET_PDEATHSIG would fire when the thread ends that started the helper.)
void ExternalMapper::start(const std::string& program) {
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    throw Error(ErrorCode::kHelperFailed, "no stream to the helper can be made: " + system_message(errno),
                client_.robot.str(), "raise the limit of open files");
  stream_ = ends[0];
  SpawnArguments spawn;
  ::posix_spawn_file_actions_adddup2(&spawn.files, ends[1], STDIN_FILENO);
  ::posix_spawn_file_actions_adddup2(&spawn.files, ends[1], STDOUT_FILENO);
  if (!options_.show_messages)
    ::posix_spawn_file_actions_addopen(&spawn.files, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  ::posix_spawn_file_actions_addclosefrom_np(&spawn.files, STDERR_FILENO + 1);
  sigset_t none, all;
  sigemptyset(&none);
  sigfillset(&all);
  ::posix_spawnattr_setsigmask(&spawn.attributes, &none);
  ::posix_spawnattr_setsigdefault(&spawn.attributes, &all);
  ::posix_spawnattr_setflags(&spawn.attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  std::string name = "mrpt_mapper", robot = client_.robot.str();
  std::array<char*, 3> arguments{name.data(), robot.data(),
                                 nullptr};  // the robot's name for those who look at the list of processes
  const int code =
      ::posix_spawn(&process_, program.c_str(), &spawn.files, &spawn.attributes, arguments.data(), environ);
  ::close(ends[1]);
  if (code != 0) {
    process_ = -1;
    end_helper();
    throw Error(ErrorCode::kHelperFailed, "helper mrpt_mapper cannot be started: " + system_message(code), program,
                "build the target mrpt_mapper again");
  }
}

void ExternalMapper::add(const LaserInput& input) {
  MAPWEAVE_EXPECT(!finished_, "no input after finish()");
  if (std::holds_alternative<InertialInput>(input)) return;
  const Stamp stamp = std::visit([](const auto& any) { return any.stamp; }, input);
  if (!first_stamp_) first_stamp_ = stamp;
  if (const auto* odometry = std::get_if<OdometryInput>(&input)) {
    return send(stamp, odometry->odometry_from_robot);
  }
  const PackedScan& scan = std::get<ScanInput>(input).scan;
  MAPWEAVE_EXPECT(scan.geometry && scan.geometry->ray_count == scan.ranges.size(),
                  "a scan has as many ranges as its geometry says");
  send(stamp, scan);
  scans_.push_back({stamp, scan});
}

void ExternalMapper::finish() {
  MAPWEAVE_EXPECT(!finished_, "finish() is called once");
  is_done_ = false;
  send({}, StreamEnd{});
  await_poses();
  if (poses_.size() != scans_.size()) {
    failure_ =
        "it answered with " + std::to_string(poses_.size()) + " poses for " + std::to_string(scans_.size()) + " scans";
    fail();
  }
  end_helper();
  map_ = map_of(std::move(scans_));
  scans_ = {};
  poses_ = {};
  finished_ = true;
}

void ExternalMapper::catch_up() {
  if (finished_) return;
  is_done_ = false;
  send(protocol::framed(MapperInput(PosesWanted{})));
  await_poses();
  // Scans that wait for odometry have no pose yet.
  map_ = map_of({scans_.begin(), scans_.begin() + static_cast<std::ptrdiff_t>(poses_.size())});
  poses_ = {};
}

void ExternalMapper::await_poses() {
  std::string_view nothing;
  while (!is_done_)
    if (!exchange(nothing, true)) fail();
}

Map ExternalMapper::map_of(std::vector<SentScan> scans) const {
  std::vector<TrackedScan> tracked;
  tracked.reserve(scans.size());
  for (std::size_t i = 0; i < scans.size(); ++i) {
    std::optional<Pose2> by_wheels;
    if (poses_[i].by_wheels) by_wheels = poses_[i].previous_from_this;
    tracked.push_back({scans[i].stamp, std::move(scans[i].scan), poses_[i].map_from_robot, by_wheels});
  }
  return cut_into_submaps(map_.id, SessionId{client_, first_stamp_ ? first_stamp_->ns : 0}, std::move(tracked),
                          options_.submaps);
}

void ExternalMapper::send(const Stamp& stamp, decltype(Sensed::body) sensed) {
  send(protocol::framed(Sensed{client_.robot, ++sent_, stamp, std::move(sensed)}));
}

void ExternalMapper::send(std::string_view bytes) {
  if (error_) throw Error(*error_);
  bool open = true;
  while (!bytes.empty() && open) open = exchange(bytes, true);
  if (open) open = exchange(bytes, false);
  if (!open) fail();
}

bool ExternalMapper::exchange(std::string_view& outgoing, bool wait) {
  throw_if_interrupted();
  pollfd waiting{stream_, static_cast<short>(POLLIN | (outgoing.empty() ? 0 : POLLOUT)), 0};
  if (::poll(&waiting, 1, wait ? kInterruptCheck_ms : 0) <= 0) return true;
  if ((waiting.revents & POLLOUT) != 0 && !outgoing.empty()) {
    const auto sent = ::send(stream_, outgoing.data(), outgoing.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent > 0) outgoing.remove_prefix(static_cast<std::size_t>(sent));
    // A refused write is no reason to leave yet: what the helper said last may still wait to be read.
  }
  if ((waiting.revents & (POLLIN | POLLHUP | POLLERR)) == 0) return true;
  std::array<char, 65536> bytes;
  const auto received = ::recv(stream_, bytes.data(), bytes.size(), MSG_DONTWAIT);
  if (received < 0) return errno == EAGAIN || errno == EINTR;
  if (received == 0) return false;
  try {
    incoming_.feed({bytes.data(), static_cast<std::size_t>(received)});
    while (const auto frame = incoming_.next()) take(decode_mapper_output(*frame, protocol::kStream));
  } catch (const Error& error) {
    failure_ = error.problem();
    return false;
  }
  return true;
}

void ExternalMapper::take(const MapperOutput& output) {
  if (const auto* progress = std::get_if<MapperProgress>(&output)) {
    finished_scans_ = progress->scans;
  } else if (const auto* refusal = std::get_if<Refusal>(&output)) {
    failure_ = refusal->why.problem();
  } else {
    const auto& [poses, is_last] = std::get<ScanPoses>(output);
    if (is_done_) protocol::fail("poses that nobody asked for");
    if (poses_.size() + poses.size() > scans_.size()) protocol::fail("more poses than scans");
    poses_.insert(poses_.end(), poses.begin(), poses.end());
    is_done_ = is_last;
  }
}

int ExternalMapper::reap(int* status, int options) {
  rusage usage{};
  const int reaped = ::wait4(process_, status, options, &usage);
  if (reaped == process_)
    helper_cpu_seconds_ += static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
                           1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
  return reaped;
}

void ExternalMapper::fail() {
  throw_if_interrupted();  // Ctrl-C and SIGTERM may have ended the helper too
  std::string end = failure_.empty() ? "ended" : "stopped";
  for (int check = 0; failure_.empty() && process_ > 0 && check < kExitChecks; ++check) {
    int status = 0;
    const int reaped = reap(&status, WNOHANG);
    if (reaped == 0) {
      ::usleep(kExitCheck_us);
      continue;
    }
    if (reaped == process_)
      end += WIFSIGNALED(status) ? " by signal " + std::to_string(WTERMSIG(status))
                                 : " with exit code " + std::to_string(WEXITSTATUS(status));
    process_ = -1;
  }
  end_helper();
  error_.emplace(ErrorCode::kHelperFailed,
                 "helper mrpt_mapper " + end + " after " + std::to_string(finished_scans_) + " scans" +
                     (failure_.empty() ? "" : ": " + failure_),
                 client_.robot.str(), kRemedy);
  throw Error(*error_);
}

void ExternalMapper::end_helper() {
  if (process_ > 0) {
    ::kill(process_, SIGKILL);
    while (reap(nullptr, 0) < 0 && errno == EINTR) {}
    process_ = -1;
  }
  if (stream_ >= 0) ::close(stream_);
  stream_ = -1;
}

}  // namespace mapweave::laser
