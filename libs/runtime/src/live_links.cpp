#include "live_server_state.h"

namespace mapweave::runtime {
namespace {

constexpr std::size_t kMostLinks = 1000;
constexpr std::size_t kMostGone = 1000;  // clients that left, counted each on its own

}  // namespace

void LiveMapServer::State::close(Wire& wire) {
  if (wire.is_closed) return;
  wire.is_closed = true;
  wire.waiting.clear(), wire.waiting_bytes = 0;
  wire.end();
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

std::shared_ptr<LiveMapServer::Link> LiveMapServer::connect() {
  auto wire = std::make_shared<Link::Wire>();
  const std::lock_guard lock(state_->mutex);
  state_->prune();
  if (state_->wires.size() >= kMostLinks)
    throw Error(ErrorCode::kBadInput, "this server has " + std::to_string(kMostLinks) + " clients on the wire already");
  if (state_->handling_ends)
    wire->is_closed = true, wire->end();
  else
    state_->wires.push_back(wire);
  return std::shared_ptr<Link>(new Link(std::move(wire), state_));
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
  counts.longest_hold_s = longest_hold_s, counts.is_merging = is_merging,
  counts.saving_s = state_->saver->cpu_seconds();
  if (counts.trouble.empty()) counts.trouble = state_->saver->trouble();
  for (const auto& [session, client] : clients) counts.clients.push_back(client);
  return counts;
}

LiveMapServer::Link::Link(std::shared_ptr<Wire> wire, std::weak_ptr<State> server)
    : wire_(std::move(wire)), server_(std::move(server)) {}

LiveMapServer::Link::~Link() {
  if (const auto server = server_.lock()) {
    const std::lock_guard lock(server->mutex);
    server->close(*wire_);
    server->prune();
  }
}

LiveMapServer::Link::Sent LiveMapServer::Link::send(ClientMessage message) {
  const auto server = server_.lock();
  if (!server) return Sent::never;
  const std::size_t bytes = message.bytes.size(), most = static_cast<std::size_t>(server->options.queue_kb) << 10;
  const std::lock_guard lock(server->mutex);
  if (wire_->is_closed || bytes > most) return Sent::never;
  if (wire_->waiting_bytes + bytes > most || wire_->waiting.size() >= most >> 10) {
    ++wire_->counts.put_off;
    return Sent::later;
  }
  if (wire_->waiting.empty() && !wire_->is_handled) wire_->spent_s = std::max(wire_->spent_s, server->turn_s);
  wire_->waiting_bytes += bytes;
  wire_->waiting.push_back({std::move(message), Clock::now()});
  server->has_work.notify_one();
  return Sent::taken;
}

std::vector<ServerMessage> LiveMapServer::Link::take(std::chrono::milliseconds patience) {
  return wire_->take(patience);
}

bool LiveMapServer::Link::is_closed() const { return wire_->is_over(); }

}  // namespace mapweave::runtime
