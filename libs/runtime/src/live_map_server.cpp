#include "client_wire.h"
#include "journal_saver.h"
#include "spent_time.h"

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/matching/binary_vocabulary.h>
#include <mapweave/runtime/live_map_server.h>

#include <algorithm>
#include <condition_variable>
#include <future>
#include <map>
#include <mutex>
#include <set>
#include <thread>

namespace mapweave::runtime {
namespace {

constexpr std::size_t kMostLinks = 1000;
constexpr std::size_t kMostGone = 1000;                      // clients that left, counted each on its own
constexpr std::size_t kMostUnsaved = std::size_t{64} << 20;  // bytes; updates wait in their queues then
constexpr std::chrono::milliseconds kUntilAsked{100};        // again, whether something is saved

// But for those in names: what they count grows from merge to merge, while what a note says is the same.
std::string without_numbers(const std::string& note) {
  std::string rest;
  bool is_quoted = false;
  for (const char letter : note) {
    if (letter == '\'') is_quoted = !is_quoted;
    if (is_quoted || letter < '0' || letter > '9') rest += letter;
  }
  return rest;
}

}  // namespace

struct LiveMapServer::State {
  using Wire = Link::Wire;
  const LiveServerOptions options;
  WorkerPool alone{1};
  std::optional<WorkerPool> merge_pool;

  std::mutex maps_mutex;  // taken before `mutex` by who takes both
  std::condition_variable maps_changed;
  tiers::VisualServer maps;
  double longest_hold_s = 0.0;
  std::set<std::string> noted;  // of the merge thread
  bool merger_is_busy = false;  // or rests

  std::mutex mutex;
  std::condition_variable has_work;
  std::vector<std::shared_ptr<Wire>> wires;
  double turn_s = 0.0;  // of who was handled last
  std::map<SessionId, ClientCounts> gone;
  std::vector<SessionId> left;  // whom the maps have not forgotten yet
  ServerCounts counts;
  bool handling_ends = false, merging_ends = false;
  std::optional<JournalSaver>
      saver;  // filled under maps_mutex: what is in the journal has the order in which maps took it
  std::vector<std::thread> handlers;
  std::thread merger;
  std::once_flag finished;

  class Hold {
   public:
    explicit Hold(State& state) : state_(state), lock_(state.maps_mutex), begin_(Clock::now()) {}
    ~Hold() { state_.longest_hold_s = std::max(state_.longest_hold_s, seconds_since(begin_)); }
    Hold(const Hold&) = delete;
    Hold& operator=(const Hold&) = delete;

   private:
    State& state_;
    const std::lock_guard<std::mutex> lock_;
    const Clock::time_point begin_;
  };

  State(TierId edge, tiers::ServerOptions server, fusion::FusionOptions fusion, LiveServerOptions live,
        const std::optional<std::filesystem::path>& path, rig::RigOptions rig)
      : options(live), maps(edge, immediate(std::move(server)), std::move(fusion), rig) {
    saver.emplace(path ? std::optional(restored(*path)) : std::nullopt,
                  std::uint64_t{1024} * static_cast<std::uint64_t>(live.journal_kb), [this] {
                    const std::lock_guard lock(mutex);
                    has_work.notify_all();
                  });
    std::thread([this] {
      lower_priority();
      merge_pool.emplace(options.merge_threads);
    }).join();
    advance();
    try {
      merger = std::thread([this] { merge_maps(); });
      for (int i = 0; i < options.handlers; ++i) handlers.emplace_back([this] { handle(); });
    } catch (...) {
      end();
      throw;
    }
  }

  static tiers::ServerOptions immediate(tiers::ServerOptions options) {
    options.wait = false;
    return options;
  }

  mapdb::UpdateJournal restored(const std::filesystem::path& path) {
    mapdb::UpdateJournal journal(path);
    std::size_t count = 0;
    journal.replay([&](const mapdb::JournalEntry& entry) {
      if (entry.vetoed) return maps.veto(*entry.vetoed);
      ++count;
      try {
        maps.greet({entry.from, matching::shipped_vocabulary().hash()});
        maps.receive(entry.from, entry.update);
      } catch (const Error& error) {
        throw Error(ErrorCode::kCorrupt, std::string("an update of it does not fit: ") + error.what(), path.string(),
                    "begin another journal; clients that are still there publish all again");
      }
    });
    const JournalSaver::Entries all = entries_of(maps.snapshot(), maps.vetoed());
    if (all.size() < count + maps.vetoed().size()) journal.replace(all);
    return journal;
  }

  static JournalSaver::Entries entries_of(tiers::VisualServer::Snapshot snapshot, const std::set<Hash>& vetoed) {
    JournalSaver::Entries entries;
    for (const Hash& judgement : vetoed) entries.push_back({{}, {}, judgement});
    for (auto& [from, update] : snapshot) entries.push_back({from, std::move(update)});
    return entries;
  }

  // --- Handlers. Who waits and has had the least of their time so far is next: a flood, or what is costly to refuse,
  // costs others a turn.
  std::shared_ptr<Wire> next() {
    std::shared_ptr<Wire> best;
    for (const auto& wire : wires) {
      if (wire->is_handled || wire->waiting.empty() || (best && best->spent_s <= wire->spent_s)) continue;
      if (wire->waiting.front().message.kind == ClientMessage::Kind::update && saver->unsaved_bytes() >= kMostUnsaved)
        continue;
      best = wire;
    }
    return best;
  }

  void handle() {
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

  void handle(const std::shared_ptr<Wire>& wire, const Wire::Waiting& taken, ClientCounts& more) {
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

  std::size_t most_answer_bytes() const { return static_cast<std::size_t>(options.answers_kb) << 10; }

  void greet(const std::shared_ptr<Wire>& wire, const SessionId& before, const std::string& bytes) {
    const Hello hello = decode_hello(bytes, "a client's hello");
    if (before != SessionId{})
      throw Error(ErrorCode::kBadInput, "it has said hello as " + to_string(before) + " before",
                  to_string(hello.session), "each run of a client has a link of its own, and one hello on it");
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

  void update(const std::shared_ptr<Wire>& wire, const SessionId& from, const Wire::Waiting& taken,
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

  bool has_ended() {
    const std::lock_guard lock(mutex);
    return handling_ends;
  }

  void veto(const Hash& judgement) {
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

  std::optional<PlaceAnswer> place(const SessionId& from, PlaceRequest request) {
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

  // --- Merging. The maps are held only while a merge begins and while its result is taken over.
  void advance() {
    maps.advance({std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now().time_since_epoch()).count()},
                 *merge_pool, !merger_is_busy);
    if (maps.pending()) maps_changed.notify_one();
  }

  void merge_maps() {
    lower_priority();
    std::unique_lock lock(maps_mutex);
    while (true) {
      maps_changed.wait(lock, [&] { return merging_ends || maps.pending(); });
      if (merging_ends) return;
      std::shared_ptr<BackgroundWork> work = maps.pending();
      merger_is_busy = true;
      lock.unlock();
      const Clock::time_point begin = Clock::now();
      double spent_s = 0.0;
      const std::string trouble = trouble_of([&] {
        const Spending spending(spent_s);
        work->run();
      });
      const double lasted_s = seconds_since(begin);
      std::vector<std::string> notes;
      const std::string later = trouble_of([&] {
        const Hold hold(*this);
        if (trouble.empty())
          advance(), notes = maps.notes();
        else
          maps.abandon();
      });
      work.reset();  // with what is no longer known
      note_merge(spent_s, lasted_s, trouble.empty() ? later : trouble, std::move(notes));
      lock.lock();
      maps_changed.wait_for(lock,
                            std::chrono::duration<double>(lasted_s * (1.0 / std::max(0.01, options.merge_share) - 1.0)),
                            [&] { return merging_ends; });
      merger_is_busy = false;
      if (const std::string last = trouble_of([&] { advance(); }); !last.empty()) maps.abandon();
    }
  }

  // Why it failed; empty: it did not.
  template <class Work>
  static std::string trouble_of(const Work& work) {
    try {
      work();
    } catch (const Interrupted& interrupted) {
      return interrupted.message();
    } catch (const std::exception& error) {
      return error.what();
    }
    return {};
  }

  // What could not be merged now may be once there is more: clients go on, and what was merged before stays.
  void note_merge(double spent_s, double lasted_s, const std::string& trouble, std::vector<std::string> notes) {
    if (!trouble.empty()) log(LogLevel::error, "the maps could not be merged: " + trouble);
    for (const std::string& note : notes)
      if (noted.insert(without_numbers(note)).second) log(LogLevel::warning, note);
    const std::lock_guard counting(mutex);
    if (trouble.empty()) ++counts.merges, counts.notes = std::move(notes);
    counts.merging_s += spent_s, counts.trouble = trouble;
    counts.longest_merge_s = std::max(counts.longest_merge_s, lasted_s);
  }

  // --- Links, under `mutex`.
  void close(Wire& wire) {
    if (wire.is_closed) return;
    wire.is_closed = true;
    wire.waiting.clear(), wire.waiting_bytes = 0;
    wire.end();
  }

  void prune() {
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
    wires.erase(std::remove_if(wires.begin(), wires.end(),
                               [](const auto& wire) { return wire->is_closed && !wire->is_handled; }),
                wires.end());
  }

  // Since it was asked last, and did not come back on another link.
  std::set<SessionId> who_left() {
    const std::lock_guard lock(mutex);
    std::set<SessionId> result(left.begin(), left.end());
    left.clear();
    for (const auto& wire : wires) result.erase(wire->counts.session);
    return result;
  }

  void finish() {
    std::call_once(finished, [this] { end(); });
  }

  void end() {
    {
      const std::lock_guard lock(mutex);
      handling_ends = true;
      has_work.notify_all();
    }
    for (std::thread& handler : handlers) handler.join();
    saver->finish();
    {
      const std::lock_guard lock(maps_mutex);
      merging_ends = true;
      maps_changed.notify_all();
    }
    if (merger.joinable()) merger.join();
    const std::lock_guard lock(mutex);
    for (const auto& wire : wires) close(*wire);
    prune();
  }
};

LiveMapServer::LiveMapServer(TierId edge, tiers::ServerOptions server, fusion::FusionOptions fusion,
                             LiveServerOptions options, const std::optional<std::filesystem::path>& journal,
                             rig::RigOptions rig)
    : state_(std::make_shared<State>(edge, std::move(server), std::move(fusion), options, journal, rig)) {}

LiveMapServer::~LiveMapServer() { state_->finish(); }

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

void LiveMapServer::veto(const Hash& judgement) { state_->veto(judgement); }

std::optional<tiers::RobotInTeam> LiveMapServer::robot(const RobotId& robot) const {
  const State::Hold hold(*state_);
  return state_->maps.robot(robot);
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

tiers::VisualServer& LiveMapServer::finish() {
  state_->finish();
  return state_->maps;
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
