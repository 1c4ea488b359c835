#include "live_server_state.h"

#include <mapweave/transport/in_process_channel.h>

namespace mapweave::runtime {
namespace {

constexpr std::size_t kMostGone = 1000;  // clients that left, counted each on its own

}  // namespace

void LiveMapServer::State::close(Wire& wire) {
  if (wire.is_closed) return;
  wire.is_closed = true;
  wire.waiting.clear();
  wire.channel->close();
}

void LiveMapServer::State::prune() {
  for (const auto& wire : wires) {
    if (!wire->is_closed || wire->is_handled) continue;
    const SessionId& session = wire->counts.session;
    ClientCounts& sum = gone[session];
    sum.session = session;
    add(sum, wire->counts);
    if (session != SessionId{}) left.push_back(session);
  }
  for (auto one = gone.begin(); gone.size() > kMostGone;) {  // the lowest, but for who said nothing
    if (one->first == SessionId{}) ++one;
    add(gone[SessionId{}], one->second);
    one = gone.erase(one);
  }
  wires.erase(
      std::remove_if(wires.begin(), wires.end(), [](const auto& wire) { return wire->is_closed && !wire->is_handled; }),
      wires.end());
}

std::set<SessionId> LiveMapServer::State::who_left() {
  const std::lock_guard lock(mutex);
  std::set<SessionId> result(left.begin(), left.end());
  left.clear();
  for (const auto& wire : wires) result.erase(wire->counts.session);
  return result;
}

void LiveMapServer::State::take_what_came(const std::shared_ptr<Wire>& wire) {
  const std::lock_guard lock(mutex);
  if (wire->is_closed) return;
  for (transport::Channel::Delivery& delivery : wire->channel->receive(std::chrono::milliseconds(0))) {
    if (wire->waiting.empty() && !wire->is_handled) wire->spent_s = std::max(wire->spent_s, turn_s);
    wire->waiting.push_back({std::move(delivery), Clock::now()});
    has_work.notify_one();
  }
  if (!wire->channel->is_closed()) return;
  close(*wire);
  prune();
}

std::shared_ptr<transport::Channel> LiveMapServer::connect(const std::optional<RobotId>& robot) {
  const std::size_t most = static_cast<std::size_t>(state_->options.queue_kb);
  const auto channel = transport::make_in_process_channel({most << 10, most});
  serve(channel.second, robot);
  return channel.first;
}

void LiveMapServer::serve(std::shared_ptr<transport::Channel> client, const std::optional<RobotId>& robot) {
  const auto wire = std::make_shared<ClientWire>();
  wire->robot = robot;
  wire->channel = std::move(client);
  {
    const std::lock_guard lock(state_->mutex);
    state_->prune();
    if (state_->wires.size() >= kMostLinks)
      throw Error(ErrorCode::kBadInput,
                  "this server has " + std::to_string(kMostLinks) + " clients on the wire already");
    if (state_->handling_ends) return wire->channel->close();
    state_->wires.push_back(wire);
  }
  wire->channel->set_listener([server = std::weak_ptr(state_), its = std::weak_ptr(wire)] {
    const auto state = server.lock();
    const auto known = its.lock();
    if (state && known) state->take_what_came(known);
  });
}

ServerCounts LiveMapServer::counts() const {
  double longest_hold_s = 0.0;
  bool is_merging = false;
  {
    const std::lock_guard lock(state_->maps_mutex);
    longest_hold_s = state_->longest_hold_s;
    is_merging = state_->merger_is_busy || state_->maps.pending() != nullptr;
  }
  const std::lock_guard lock(state_->mutex);
  std::map<SessionId, ClientCounts> clients = state_->gone;
  for (const auto& wire : state_->wires) {
    ClientCounts& sum = clients[wire->counts.session];
    sum.session = wire->counts.session;
    add(sum, wire->counts);
  }
  ServerCounts counts = state_->counts;
  counts.longest_hold_s = longest_hold_s;
  counts.is_merging = is_merging;
  counts.saving_s = state_->saver->cpu_seconds();
  if (counts.trouble.empty()) counts.trouble = state_->saver->trouble();
  for (const auto& [session, client] : clients) counts.clients.push_back(client);
  return counts;
}

}  // namespace mapweave::runtime
