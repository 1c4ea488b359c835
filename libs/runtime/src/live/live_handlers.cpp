#include "live_server_state.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/tiers/kept_map.h>
#include <mapweave/tiers/subjects.h>

#include <algorithm>
#include <functional>
#include <future>

namespace mapweave::runtime {
namespace {

constexpr std::size_t kMostUnsaved = std::size_t{64} << 20;   // bytes; updates wait in their queues then
constexpr std::size_t kMostKeptPart = std::size_t{48} << 10;  // bytes
constexpr std::chrono::milliseconds kUntilAsked{100};         // again, whether something is saved

namespace subject = tiers::subject;

void post(ClientWire& wire, transport::Envelope answer, ClientCounts& more) {
  more.sent_bytes += answer.bytes.size();
  wire.channel->send(std::move(answer));
}

void send_refusal(ClientWire& wire, const Error& why, ClientCounts& more) {
  post(wire, {subject::kRefusal, encode(Refusal{why}), {}, 0, true}, more);
}

}  // namespace

std::shared_ptr<LiveMapServer::State::Wire> LiveMapServer::State::next() {
  std::shared_ptr<Wire> best;
  for (const auto& wire : wires) {
    if (wire->is_handled || wire->waiting.empty() || (best && best->spent_s <= wire->spent_s)) continue;
    if (wire->waiting.front().delivery.envelope.subject == subject::kUpdate && saver->unsaved_bytes() >= kMostUnsaved)
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
    wire->waiting.pop_front();
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
    wire->is_handled = false;
    wire->spent_s += spent_s;
    add(wire->counts, more);
  }
}

void LiveMapServer::State::handle(const std::shared_ptr<Wire>& wire, const Wire::Waiting& taken, ClientCounts& more) {
  const std::string &subject = taken.delivery.envelope.subject, &bytes = taken.delivery.envelope.bytes;
  more.received_bytes += bytes.size();
  try {
    if (subject == subject::kUpdate) return update(wire, taken, more);  // which acknowledges it
    if (subject == subject::kHello)
      greet(wire, more.session, bytes);
    else if (subject == subject::kView)
      answer_view(*wire, bytes, more);
    else if (subject == subject::kPlaceRequest)
      answer_place_request(*wire, taken, more);
    else if (subject == subject::kKeptRequest)
      answer_kept_request(*wire, bytes, more);
    else
      throw Error(ErrorCode::kBadInput, "a client sends no '" + subject + "'", to_string(more.session));
  } catch (const Interrupted& interrupted) {
    send_refusal(*wire, Error(ErrorCode::kInternal, interrupted.message()), more);
  } catch (const Error& error) {
    ++more.refused;
    send_refusal(*wire, error, more);
  } catch (const std::exception& error) {
    ++more.refused;
    send_refusal(*wire, Error(ErrorCode::kInternal, error.what()), more);
  }
  wire->channel->acknowledge(taken.delivery.number);
}

void LiveMapServer::State::answer_view(Wire& wire, const std::string& bytes, ClientCounts& more) {
  ++more.views;
  std::optional<Share> share;
  {
    const Spending spending(more.retrieval_s);
    const ClientView view = decode_client_view(bytes, to_string(more.session));
    const bool has_room = wire.channel->in_flight_bytes() < most_answer_bytes();
    const Hold hold(*this);
    if (has_room)
      share = maps.share(more.session, view);
    else
      maps.note(more.session, view);
  }
  if (const Hold hold(*this); true) advance();
  if (!share) return;
  ++more.shares;
  const Spending spending(more.sending_s);
  post(wire, {subject::kShare, encode(*share)}, more);
}

void LiveMapServer::State::answer_place_request(Wire& wire, const Wire::Waiting& taken, ClientCounts& more) {
  ++more.places;
  if (wire.channel->in_flight_bytes() >= most_answer_bytes()) return;
  const Spending spending(more.place_s);
  const std::string& bytes = taken.delivery.envelope.bytes;
  if (auto answer = place(more.session, decode_place_request(bytes, to_string(more.session))))
    post(wire, {subject::kPlace, encode(*answer)}, more);
  more.longest_place_s = seconds_since(taken.since);
}

// A client that has ended asks again and again, until it has all.
void LiveMapServer::State::answer_kept_request(Wire& wire, const std::string& bytes, ClientCounts& more) {
  const std::vector<Receipt> came = decode_receipts(bytes, to_string(more.session));
  if (!wire.kept) {
    std::function<std::vector<tiers::KeptMap>()> read;
    {
      const Hold hold(*this);
      read = maps.kept_to_read(more.session);
    }
    std::vector<Wire::Kept> kept;
    for (const tiers::KeptMap& one : read()) kept.push_back({one.map.id, tiers::encoded_in_parts(one, kMostKeptPart)});
    wire.kept = std::move(kept);
  }
  std::vector<Receipt> all;
  for (const Wire::Kept& kept : *wire.kept) {
    all.push_back({{{}, kept.map}, kept.parts.size()});
    const auto known =
        std::find_if(came.begin(), came.end(), [&](const Receipt& receipt) { return receipt.origin.map == kept.map; });
    for (std::size_t i = known != came.end() ? known->stored : 0; i < kept.parts.size(); ++i) {
      if (wire.channel->in_flight_bytes() >= most_answer_bytes()) break;
      post(wire, {subject::kKept, kept.parts[i]}, more);
    }
  }
  post(wire, {subject::kKeptEnd, encode(all)}, more);
}

void LiveMapServer::State::greet(const std::shared_ptr<Wire>& wire, const SessionId& before, const std::string& bytes) {
  const Hello hello = decode_hello(bytes, "a client's hello");
  if (wire->robot && hello.session.client.robot != *wire->robot)
    throw Error(ErrorCode::kBadInput, "this wire is of robot '" + wire->robot->str() + "'", to_string(hello.session),
                "each robot speaks for its own cameras");
  if (before != SessionId{} && before != hello.session)
    throw Error(ErrorCode::kBadInput, "it has said hello as " + to_string(before) + " before", to_string(hello.session),
                "each run of a client has a channel of its own, and one hello on it");
  const Hold hold(*this);
  transport::Envelope welcome{subject::kWelcome, encode(maps.greet(hello))};
  {
    const std::lock_guard lock(mutex);
    for (const auto& other : wires)
      if (other != wire && other->counts.session == hello.session) close(*other);
    wire->counts.session = hello.session;
    prune();
  }
  saver->save({}, [wire, welcome = std::move(welcome)] { wire->channel->send(welcome); });
  for (const SessionId& session : who_left()) maps.leave(session);
}

void LiveMapServer::State::update(const std::shared_ptr<Wire>& wire, const Wire::Waiting& taken, ClientCounts& more) {
  const SessionId& from = more.session;
  const std::string& bytes = taken.delivery.envelope.bytes;
  const double waited_s = seconds_since(taken.since);
  ++more.updates;
  more.waited_s += waited_s;
  more.longest_wait_s = waited_s;
  const Spending spending(more.update_s);
  MapUpdate decoded = decode_map_update(bytes, to_string(from));
  const Hold hold(*this);
  auto received = maps.receive(from, std::move(decoded), bytes);
  std::vector<mapdb::JournalEntry> entries;
  for (std::string& stored : received.stored) entries.push_back({from, std::move(stored)});
  saver->save(std::move(entries), [wire, receipt = received.receipt, number = taken.delivery.number] {
    const std::string& map = receipt.origin.map.str();
    wire->channel->send({subject::kReceipts, encode(std::vector<Receipt>{receipt}), map, 0, true});
    wire->channel->acknowledge(number);
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
    return Error(ErrorCode::kBadInput, "the camera map server has ended", "a veto", "begin it again first");
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
