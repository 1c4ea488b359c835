#include "live_server_state.h"

#include <mapweave/core/interrupt.h>

#include <future>

namespace mapweave::runtime {
namespace {

constexpr std::size_t kMostUnsaved = std::size_t{64} << 20;  // bytes; updates wait in their queues then
constexpr std::chrono::milliseconds kUntilAsked{100};        // again, whether something is saved

}  // namespace

std::shared_ptr<LiveMapServer::State::Wire> LiveMapServer::State::next() {
  std::shared_ptr<Wire> best;
  for (const auto& wire : wires) {
    if (wire->is_handled || wire->waiting.empty() || (best && best->spent_s <= wire->spent_s)) continue;
    if (wire->waiting.front().message.kind == ClientMessage::Kind::update && saver->unsaved_bytes() >= kMostUnsaved)
      continue;
    best = wire;
  }
  return best;
}

void LiveMapServer::State::handle() {
  std::unique_lock lock(mutex);
  while (true) {
    std::shared_ptr<Wire> wire;
    has_work.wait(lock, [&] { return handling_ends || (wire = next()) != nullptr; });
    if (handling_ends) return;
    const Wire::Waiting taken = std::move(wire->waiting.front());
    wire->waiting.pop_front(), wire->waiting_bytes -= taken.message.bytes.size();
    wire->is_handled = true;
    turn_s = wire->spent_s;
    ClientCounts more;
    more.session = wire->counts.session;
    lock.unlock();
    double spent_s = 0.0;
    {
      const Spending spending(spent_s);
      handle(wire, taken, more);
    }
    lock.lock();
    wire->is_handled = false, wire->spent_s += spent_s;
    add(wire->counts, more);
  }
}

void LiveMapServer::State::handle(const std::shared_ptr<Wire>& wire, const Wire::Waiting& taken, ClientCounts& more) {
  const std::string& bytes = taken.message.bytes;
  more.received_bytes += bytes.size();
  const SessionId from = more.session;
  const auto post = [&](ServerMessage::Kind kind, std::string answer) {
    more.sent_bytes += answer.size();
    wire->post({kind, std::move(answer), {}});
  };
  try {
    switch (taken.message.kind) {
      case ClientMessage::Kind::hello: return greet(wire, from, bytes);
      case ClientMessage::Kind::update: return update(wire, from, taken, more);
      case ClientMessage::Kind::view: {
        ++more.views;
        std::optional<Share> share;
        {
          const Spending spending(more.retrieval_s);
          const ClientView view = decode_client_view(bytes, to_string(from));
          const bool has_room = wire->has_room(most_answer_bytes());
          const Hold hold(*this);
          if (has_room)
            share = maps.share(from, view);
          else
            maps.note(from, view);
        }
        if (const Hold hold(*this); true) advance();
        if (!share) return;
        ++more.shares;
        const Spending spending(more.sending_s);
        return post(ServerMessage::Kind::share, encode(*share));
      }
      case ClientMessage::Kind::place_request: {
        ++more.places;
        if (!wire->has_room(most_answer_bytes())) return;
        const Spending spending(more.place_s);
        if (auto answer = place(from, decode_place_request(bytes, to_string(from))))
          post(ServerMessage::Kind::place, encode(*answer));
        more.longest_place_s = seconds_since(taken.since);
      }
    }
  } catch (const Interrupted& interrupted) {
    post(ServerMessage::Kind::refused, interrupted.message());
  } catch (const std::exception& error) {
    ++more.refused;
    post(ServerMessage::Kind::refused, error.what());
  }
}

void LiveMapServer::State::greet(const std::shared_ptr<Wire>& wire, const SessionId& before, const std::string& bytes) {
  const Hello hello = decode_hello(bytes, "a client's hello");
  if (before != SessionId{})
    throw Error(ErrorCode::kBadInput, "it has said hello as " + to_string(before) + " before", to_string(hello.session),
                "each run of a client has a link of its own, and one hello on it");
  const Hold hold(*this);
  ServerMessage welcome{ServerMessage::Kind::welcome, {}, maps.greet(hello)};
  {
    const std::lock_guard lock(mutex);
    for (const auto& other : wires)
      if (other != wire && other->counts.session == hello.session) close(*other);
    wire->counts.session = hello.session;
    prune();
  }
  saver->save({}, [wire, welcome = std::move(welcome)] { wire->post(welcome); });
  for (const SessionId& session : who_left()) maps.leave(session);
}

void LiveMapServer::State::update(const std::shared_ptr<Wire>& wire, const SessionId& from, const Wire::Waiting& taken,
                                  ClientCounts& more) {
  const double waited_s = seconds_since(taken.since);
  ++more.updates, more.waited_s += waited_s, more.longest_wait_s = waited_s;
  const Spending spending(more.update_s);
  MapUpdate decoded = decode_map_update(taken.message.bytes, to_string(from));
  const Hold hold(*this);
  auto received = maps.receive(from, std::move(decoded), taken.message.bytes);
  std::vector<mapdb::JournalEntry> entries;
  for (std::string& stored : received.stored) entries.push_back({from, std::move(stored)});
  saver->save(std::move(entries), [wire, receipt = received.receipt] {
    wire->post({ServerMessage::Kind::receipts, {}, {receipt}});
  });
  if (saver->is_long())
    saver->replace(
        [snapshot = maps.snapshot_to_encode(), vetoed = maps.vetoed()] { return entries_of(snapshot(), vetoed); });
  advance();
}

bool LiveMapServer::State::has_ended() {
  const std::lock_guard lock(mutex);
  return handling_ends;
}

void LiveMapServer::State::veto(const Hash& judgement) {
  const auto saved = std::make_shared<std::promise<void>>();
  const std::future<void> is_saved = saved->get_future();
  const auto ended = [] {
    return Error(ErrorCode::kBadInput, "the map server has ended", "a veto", "begin it again first");
  };
  if (has_ended()) throw ended();
  {
    const Hold hold(*this);
    maps.veto(judgement);
    saver->save({{{}, {}, judgement}}, [saved] { saved->set_value(); });
    advance();
  }
  while (is_saved.wait_for(kUntilAsked) != std::future_status::ready) {
    if (const std::string trouble = saver->trouble(); !trouble.empty())
      throw Error(ErrorCode::kCannotWrite, trouble, "a veto");
    if (has_ended() && is_saved.wait_for(kUntilAsked) != std::future_status::ready) throw ended();
  }
}

std::optional<PlaceAnswer> LiveMapServer::State::place(const SessionId& from, PlaceRequest request) {
  std::shared_ptr<tiers::VisualServer::PlaceSearch> search;
  {
    const Hold hold(*this);
    search = maps.place_search(from, std::move(request));
  }
  if (!search) return std::nullopt;
  search->run(alone);
  const Hold hold(*this);
  return maps.answer(from, *search);
}

}  // namespace mapweave::runtime
