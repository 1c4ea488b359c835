#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/transport/broker.h>

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include <cerrno>
#include <condition_variable>
#include <cstdlib>
#include <mutex>
#include <sstream>
#include <system_error>
#include <thread>

namespace mapweave::transport {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using Json = nlohmann::json;

constexpr auto kEnding = std::chrono::seconds(5);  // what a server gets to end by itself
constexpr std::size_t kLogLines = 5;

bool is_program(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored) && ::access(path.c_str(), X_OK) == 0;
}

Json permissions_of(const BrokerUser& user) {
  Json permissions = Json::object();
  if (!user.may_publish.empty()) permissions["publish"] = {{"allow", user.may_publish}};
  if (!user.may_receive.empty()) permissions["subscribe"] = {{"allow", user.may_receive}};
  return permissions;
}

Json tls_of(const BrokerOptions& options) {
  Json tls = {{"cert_file", options.certificate.string()}, {"key_file", options.key.string()}};
  if (!options.ca.empty()) {
    tls["ca_file"] = options.ca.string();
    tls["verify"] = true;
  }
  return tls;
}

// nats-server reads JSON as its own configuration. port, leaf_port: -1 lets it choose.
Json configuration_of(const BrokerOptions& options, int port, int leaf_port) {
  Json all = {{"listen", options.host + ":" + std::to_string(port)},
              {"max_payload", options.most_message_bytes},
              {"log_file", (options.folder / "broker.log").string()},
              {"logfile_size_limit", std::int64_t{16} << 20},
              {"ports_file_dir", options.folder.string()},
              {"ping_interval", "20s"},
              {"write_deadline", "30s"}};
  if (!options.name.empty()) all["server_name"] = options.name;
  if (options.has_jet_stream) {
    all["jetstream"] = {{"store_dir", (options.folder / "store").string()},
                        {"max_memory_store", std::int64_t{64} << 20},
                        {"max_file_store", options.most_store_bytes}};
    if (!options.domain.empty()) all["jetstream"]["domain"] = options.domain;
  }
  for (const BrokerUser& user : options.users) {
    Json one = {{"user", user.name}, {"password", user.password}};
    if (const Json permissions = permissions_of(user); !permissions.empty()) one["permissions"] = permissions;
    all["authorization"]["users"].push_back(one);
  }
  if (!options.certificate.empty()) all["tls"] = tls_of(options);
  if (options.leaf_port) {
    all["leafnodes"]["listen"] = options.host + ":" + std::to_string(leaf_port);
    if (!options.certificate.empty()) all["leafnodes"]["tls"] = tls_of(options);
  }
  for (const std::string& hub : options.hubs) {
    Json remote = {{"url", hub}};
    const fs::path& ca = options.hub_ca.empty() ? options.ca : options.hub_ca;
    if (!ca.empty()) remote["tls"] = {{"ca_file", ca.string()}};
    all["leafnodes"]["remotes"].push_back(remote);
  }
  if (!options.hubs.empty()) all["leafnodes"]["reconnect"] = 1;  // seconds
  return all;
}

int port_of(const std::string& url) {
  const std::size_t colon = url.rfind(':');
  return colon == std::string::npos ? 0 : std::atoi(url.c_str() + colon + 1);
}

}  // namespace

fs::path find_broker(const fs::path& program) {
  if (!program.empty()) {
    if (is_program(program)) return program;
    throw Error(ErrorCode::kMissing, "this is no program that can be run", program.string(),
                "name nats-server's path, or leave it empty for the one on PATH");
  }
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "/usr/sbin:/usr/bin" : path);
  for (std::string folder; std::getline(folders, folder, ':');)
    if (is_program(fs::path(folder) / "nats-server")) return fs::path(folder) / "nats-server";
  if (is_program("/usr/sbin/nats-server")) return "/usr/sbin/nats-server";
  throw Error(ErrorCode::kMissing, "there is no nats-server on PATH", {},
              "apt-get install --no-install-recommends nats-server, or name a broker that runs elsewhere");
}

std::string broker_configuration(const BrokerOptions& options) {
  MAPWEAVE_EXPECT(options.port > 0, "a server that others start has a port");
  return configuration_of(options, options.port, options.leaf_port.value_or(0)).dump(2) + "\n";
}

struct Broker::State {
  BrokerOptions options;
  fs::path program;
  int port = -1, leaf_port = -1;

  std::mutex mutex;
  std::condition_variable changed;
  std::thread keeper;  // started the child, which is killed where this thread ends
  pid_t child = -1;
  bool is_running = false;

  fs::path configuration() const { return options.folder / "broker.conf"; }
  fs::path log() const { return options.folder / "broker.log"; }

  void launch();
  void await(std::chrono::milliseconds patience);
  bool read_ports();
  bool wait_for_end(std::chrono::milliseconds patience);
  void end(int signal);
  std::string last_log_lines() const;
};

void Broker::State::launch() {
  make_folder(options.folder, "check that you may write there", "the broker's folder cannot be made");
  write_file(configuration(), configuration_of(options, port, leaf_port).dump(2) + "\n");
  ::chmod(configuration().c_str(), S_IRUSR | S_IWUSR);  // it may hold passwords
  const std::string file = program.string(), given = configuration().string(), output = log().string();
  const pid_t parent = ::getpid();
  std::unique_lock lock(mutex);
  child = -1;
  int failure = 0;
  keeper = std::thread([this, file, given, output, parent, &failure] {
    sigset_t all;  // signals are for the threads of the program that made the broker
    ::sigfillset(&all);
    ::pthread_sigmask(SIG_SETMASK, &all, nullptr);
    char* const arguments[] = {const_cast<char*>(file.c_str()), const_cast<char*>("-c"),
                               const_cast<char*>(given.c_str()), nullptr};
    const pid_t made = ::fork();
    if (made == 0) {  // only what is safe after fork()
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      if (::getppid() != parent) ::_exit(127);
      ::setpgid(0, 0);  // Ctrl-C at a terminal is for its parent, which ends it in order
      sigset_t none;
      ::sigemptyset(&none);
      ::sigprocmask(SIG_SETMASK, &none, nullptr);
      const int null = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
      const int written = ::open(output.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
      ::dup2(null, STDIN_FILENO);
      ::dup2(written, STDOUT_FILENO);
      ::dup2(written, STDERR_FILENO);
      ::close_range(3, ~0U, 0);
      ::execv(arguments[0], arguments);
      ::_exit(127);
    }
    {
      const std::lock_guard started(mutex);
      failure = made < 0 ? errno : 0;
      child = made < 0 ? 0 : made;
      is_running = made > 0;
      changed.notify_all();
    }
    // Its id is its own until it is reaped, which is under the lock that end() holds while it sends a signal.
    siginfo_t ended{};
    if (made > 0)
      while (::waitid(P_PID, static_cast<id_t>(made), &ended, WEXITED | WNOWAIT) < 0 && errno == EINTR) {}
    const std::lock_guard gone(mutex);
    if (made > 0) ::waitpid(made, nullptr, 0);
    is_running = false;
    changed.notify_all();
  });
  changed.wait(lock, [&] { return child >= 0; });
  if (failure == 0) return;
  lock.unlock();
  keeper.join();
  throw Error(ErrorCode::kHelperFailed, "the broker cannot be started: " + std::generic_category().message(failure),
              file);
}

// Of the file that the server writes once it listens; it lacks the leaf nodes' port, which is in the log.
bool Broker::State::read_ports() {
  const fs::path file = options.folder / (program.filename().string() + "_" + std::to_string(child) + ".ports");
  std::error_code error;
  if (!fs::exists(file, error)) return false;
  const Json ports = Json::parse(read_file(file, 1 << 16), nullptr, false);
  if (!ports.is_object() || !ports.contains("nats") || !ports["nats"].is_array() || ports["nats"].empty() ||
      !ports["nats"][0].is_string())
    return false;
  port = port_of(ports["nats"][0]);
  if (options.leaf_port) {
    constexpr char kSaid[] = "Listening for leafnode connections on ";
    const std::string text = read_file(log());
    const std::size_t at = text.rfind(kSaid);
    if (at == std::string::npos) return false;
    leaf_port = port_of(text.substr(at, text.find('\n', at) - at));
    if (leaf_port <= 0) return false;
  }
  fs::remove(file, error);  // of a server that is killed it would stay
  return port > 0;
}

void Broker::State::await(std::chrono::milliseconds patience) {
  const auto until = Clock::now() + patience;
  while (!read_ports()) {
    std::unique_lock lock(mutex);
    changed.wait_for(lock, std::chrono::milliseconds(10), [&] { return !is_running; });
    const bool ended = !is_running;
    lock.unlock();
    if (!ended && Clock::now() < until) continue;
    end(SIGKILL);
    throw Error(ErrorCode::kHelperFailed,
                (ended ? std::string("the broker ended at once: ") : std::string("the broker does not answer: ")) +
                    last_log_lines(),
                log().string(), "see its log, and its configuration beside it");
  }
}

std::string Broker::State::last_log_lines() const {
  std::error_code error;
  if (!fs::exists(log(), error)) return "it wrote no log";
  std::istringstream text(read_file(log()));
  std::vector<std::string> lines;
  for (std::string line; std::getline(text, line);) {
    lines.push_back(line);
    if (lines.size() > kLogLines) lines.erase(lines.begin());
  }
  std::string all;
  for (const std::string& line : lines) all += (all.empty() ? "" : " / ") + line;
  return all.empty() ? "its log is empty" : all;
}

bool Broker::State::wait_for_end(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex);
  return changed.wait_for(lock, patience, [&] { return !is_running; });
}

void Broker::State::end(int signal) {
  if (!keeper.joinable()) return;
  {
    const std::lock_guard lock(mutex);
    if (is_running) ::kill(child, signal);
  }
  if (!wait_for_end(kEnding)) {
    const std::lock_guard lock(mutex);
    if (is_running) ::kill(child, SIGKILL);
  }
  keeper.join();
}

Broker::Broker(BrokerOptions options, std::chrono::milliseconds patience) : state_(std::make_unique<State>()) {
  MAPWEAVE_EXPECT(!options.folder.empty(), "a broker has a folder");
  state_->program = find_broker(options.program);
  state_->port = options.port > 0 ? options.port : -1;
  state_->leaf_port = options.leaf_port && *options.leaf_port > 0 ? *options.leaf_port : -1;
  state_->options = std::move(options);
  state_->options.folder = fs::absolute(state_->options.folder);
  start(patience);
}

Broker::~Broker() {
  if (state_) stop();
}
Broker::Broker(Broker&&) noexcept = default;
Broker& Broker::operator=(Broker&& other) noexcept {
  if (state_) stop();
  state_ = std::move(other.state_);
  return *this;
}

std::string Broker::url() const {
  return (state_->options.certificate.empty() ? "nats://" : "tls://") + state_->options.host + ":" +
         std::to_string(state_->port);
}

std::string Broker::leaf_url() const {
  MAPWEAVE_EXPECT(state_->options.leaf_port, "this server takes no leaf nodes");
  return "nats-leaf://" + state_->options.host + ":" + std::to_string(state_->leaf_port);
}

int Broker::process() const { return state_->child; }

bool Broker::is_running() const {
  const std::lock_guard lock(state_->mutex);
  return state_->is_running;
}

void Broker::stop() { state_->end(SIGTERM); }
void Broker::kill() { state_->end(SIGKILL); }

void Broker::start(std::chrono::milliseconds patience) {
  MAPWEAVE_EXPECT(!is_running(), "it runs already");
  if (state_->keeper.joinable()) state_->keeper.join();
  state_->launch();
  state_->await(patience);
}

}  // namespace mapweave::transport
