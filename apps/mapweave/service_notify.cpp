#include "service_notify.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <cstring>

namespace mapweave::app {
namespace {

using namespace std::chrono_literals;

constexpr auto kBetweenStatuses = 1s;
constexpr auto kStandstill = 10min;
constexpr int kLivesPerWatchdog = 3;

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

std::uint64_t number_of_variable(const char* name) {
  const std::string text = variable(name);
  std::uint64_t value = 0;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
  return problem == std::errc() && end == text.data() + text.size() ? value : 0;
}

// A path, or behind '@' the name of an abstract socket; empty for anything else.
std::vector<char> address_of(const std::string& name) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (name.size() < 2 || (name.front() != '/' && name.front() != '@') || name.size() >= sizeof address.sun_path)
    return {};
  std::memcpy(address.sun_path, name.data(), name.size());
  const bool is_abstract = name.front() == '@';
  if (is_abstract) address.sun_path[0] = '\0';
  std::vector<char> bytes(offsetof(sockaddr_un, sun_path) + name.size() + (is_abstract ? 0 : 1));
  std::memcpy(bytes.data(), &address, bytes.size());
  return bytes;
}

// A message has a line per variable.
std::string one_line(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

std::string with_trouble(const std::string& status, const std::string& trouble) {
  return trouble.empty() ? status : status + "; " + trouble;
}

}  // namespace

ServiceTurn service_turn_of(const runtime::LiveRobotCounts& counts) {
  ServiceTurn turn;
  turn.status = std::to_string(counts.scans) + (counts.is_on_board ? " scans or frames mapped, " : " scans sensed, ") +
                std::to_string(counts.lost_scans) + " lost, " + std::to_string(counts.waiting_bytes >> 10) +
                " kB not yet at the edge";
  turn.status = with_trouble(turn.status, counts.refusal);
  return turn;
}

ServiceTurn service_turn_of(const runtime::LiveEdgeCounts& counts) {
  ServiceTurn turn;
  std::size_t connected = 0;
  std::uint64_t scans = 0;
  for (const runtime::LiveEdgeCounts::RobotCounts& robot : counts.robots) {
    connected += robot.is_on_wire ? 1 : 0;
    scans += robot.scans;
    turn.done += robot.mapped;
    turn.has_work = turn.has_work || robot.queue_bytes > 0;
  }
  turn.status = std::to_string(connected) + " of " + std::to_string(counts.robots.size()) + " robots connected, " +
                std::to_string(scans) + " scans mapped" + (counts.is_fused ? ", all maps merged" : "");
  turn.status = with_trouble(turn.status, counts.trouble);
  return turn;
}

ServiceTurn service_turn_of(const runtime::LiveCloudCounts& counts) {
  ServiceTurn turn;
  const auto connected =
      std::count_if(counts.edges.begin(), counts.edges.end(), [](const auto& edge) { return edge.is_on_wire; });
  turn.status = std::to_string(connected) + " of " + std::to_string(counts.edges.size()) + " edges connected, " +
                std::to_string(counts.maps) + " maps" +
                (counts.is_done      ? ", results written"
                 : counts.is_sealing ? ", makes the final map"
                                     : "");
  turn.status = with_trouble(turn.status, counts.trouble);
  return turn;
}

ServiceNotifier::ServiceNotifier() : address_(address_of(variable("NOTIFY_SOCKET"))) {
  if (address_.empty()) return;
  socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const std::uint64_t watched = number_of_variable("WATCHDOG_PID");
  if (watched == 0 || watched == static_cast<std::uint64_t>(::getpid()))
    watchdog_ = std::chrono::microseconds(number_of_variable("WATCHDOG_USEC"));
}

ServiceNotifier::~ServiceNotifier() {
  if (socket_ < 0) return;
  send("STOPPING=1");
  ::close(socket_);
}

bool ServiceNotifier::send(const std::string& text) const {
  const ssize_t sent =
      ::sendto(socket_, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT,
               reinterpret_cast<const sockaddr*>(address_.data()), static_cast<socklen_t>(address_.size()));
  return sent == static_cast<ssize_t>(text.size());
}

void ServiceNotifier::show(const std::string& status, Clock::time_point now) {
  if (status == status_ || now < next_status_) return;
  next_status_ = now + kBetweenStatuses;
  if (send("STATUS=" + status)) status_ = status;
}

bool ServiceNotifier::stands_still(const ServiceTurn& turn, Clock::time_point now) {
  if (!turn.has_work || turn.done != done_) worked_ = now;
  done_ = turn.done;
  return now - worked_ > kStandstill;
}

void ServiceNotifier::turn(const ServiceTurn& turn) {
  if (socket_ < 0) return;
  const Clock::time_point now = Clock::now();
  if (!is_ready_) is_ready_ = send("READY=1");
  const bool is_still = stands_still(turn, now);
  show(one_line(turn.status) + (is_still ? "; nothing was mapped for ten minutes" : ""), now);
  if (watchdog_.count() == 0 || is_still || now < next_life_) return;
  if (send("WATCHDOG=1")) next_life_ = now + watchdog_ / kLivesPerWatchdog;
}

}  // namespace mapweave::app
