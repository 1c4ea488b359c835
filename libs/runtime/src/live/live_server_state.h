#pragma once
// What a live map server consists of: handlers, who take turns for what waits on links (live_handlers.cpp), one thread
// that merges (live_merging.cpp), and the links (live_links.cpp).

#include "robots/client_wire.h"
#include "robots/spent_time.h"
#include "team/journal_saver.h"

#include <mapweave/core/error.h>
#include <mapweave/runtime/live_map_server.h>

#include <algorithm>
#include <condition_variable>
#include <map>
#include <mutex>
#include <set>
#include <thread>

namespace mapweave::runtime {

struct LiveMapServer::State {
  using Wire = ClientWire;
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
        const std::optional<std::filesystem::path>& path, rig::RigOptions rig);
  static tiers::ServerOptions immediate(tiers::ServerOptions options);
  mapdb::UpdateJournal restored(const std::filesystem::path& path);
  static JournalSaver::Entries entries_of(tiers::VisualServer::Snapshot snapshot, const std::set<Hash>& vetoed);
  void finish();
  void end();

  // --- Handlers. Who waits and has had the least of their time so far is next: a flood, or what is costly to refuse,
  // costs others a turn.
  std::shared_ptr<Wire> next();
  void handle();
  void handle(const std::shared_ptr<Wire>& wire, const Wire::Waiting& taken, ClientCounts& more);
  void answer_view(Wire& wire, const std::string& bytes, ClientCounts& more);
  void answer_place_request(Wire& wire, const Wire::Waiting& taken, ClientCounts& more);
  void answer_kept_request(Wire& wire, const std::string& bytes, ClientCounts& more);
  std::size_t most_answer_bytes() const { return static_cast<std::size_t>(options.answers_kb) << 10; }
  void greet(const std::shared_ptr<Wire>& wire, const SessionId& before, const std::string& bytes);
  void update(const std::shared_ptr<Wire>& wire, const Wire::Waiting& taken, ClientCounts& more);
  bool has_ended();
  void veto(const Hash& judgement);
  std::optional<PlaceAnswer> place(const SessionId& from, PlaceRequest request);

  // --- Merging. The maps are held only while a merge begins and while its result is taken over.
  void advance();
  void merge_maps();
  // What could not be merged now may be once there is more: clients go on, and what was merged before stays.
  void note_merge(double spent_s, double lasted_s, const std::string& trouble, std::vector<std::string> notes);

  // --- Links, under `mutex`, but for the first.
  void take_what_came(const std::shared_ptr<Wire>& wire);
  void close(Wire& wire);
  void prune();
  // Since it was asked last, and did not come back on another link.
  std::set<SessionId> who_left();
};

}  // namespace mapweave::runtime
