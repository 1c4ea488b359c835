#pragma once
// What a live cloud consists of: one thread that speaks with edges (live_cloud.cpp), and one that merges
// (live_cloud_maps.cpp).

#include "numbered_wire.h"
#include "robot_record.h"

#include "team/journal_saver.h"
#include "team/team_run.h"

#include <mapweave/runtime/live_cloud.h>
#include <mapweave/tiers/round_merger.h>

#include <atomic>
#include <condition_variable>
#include <list>
#include <mutex>
#include <set>
#include <thread>

namespace mapweave::runtime {

struct LiveCloud::State {
  struct Edge {
    // Under `mutex`.
    std::optional<SessionId> session;
    std::uint64_t taken = 0, stored = 0, runs = 0;
    std::vector<std::pair<std::string, std::string>> requests;  // all: an edge that begins anew gets them again
    bool has_fused = false, has_all = false;
    std::vector<RobotId> members;  // whose final maps it sends, by its own word; with a coordinator
    std::deque<Said> said;         // for the merging thread
    bool is_forgotten = false;     // of its previews nothing counts any more
    std::optional<Clock::time_point> received_at;
    transport::Channel::Health wire_before;  // counts of its wires that were closed
    // Of the merging thread.
    tiers::RoundNews news;
    std::vector<std::pair<std::string, std::string>> finals;  // not given to the merger yet
    bool has_judged = false, is_late = false;                 // is_late: what it sends is no longer awaited
    std::set<std::string> sent_whole;                         // what was wanted of it, as it was said, and has come
  };
  struct Link {
    std::optional<NumberedWire> wire;
    Edge* edge = nullptr;
    bool is_closed = false;
    std::size_t asked = 0;  // requests of the edge that were said on it
  };
  enum class Phase { collecting, judging, completing, done };

  const LiveSite site;
  const RunSettings settings;
  const Hash agreement;
  const std::int64_t began;
  const bool is_coordinated;

  mutable std::mutex mutex;
  const std::shared_ptr<std::condition_variable> woken = std::make_shared<std::condition_variable>();
  std::condition_variable& changed = *woken;
  LiveOptions options;
  bool has_new_options = false;  // that the merging thread does not know
  std::map<TierId, Edge> edges;
  std::list<Link> links;
  LiveCloudCounts counts;
  std::shared_ptr<const LivePreview> shown;  // where the site keeps previews
  std::set<Hash> known;                      // what came already, whatever its number
  LivePlan newest_plan;                      // number 0: none came
  LiveRequests asked_for;
  bool has_new_requests = true;  // that no preview knows of
  RunPlan plan;                  // with the edges that it named
  bool has_new_plan = false, seals_now = false, ends = false;
  std::optional<Report> report;
  std::exception_ptr trouble;

  std::mutex stored_mutex;  // after `mutex` by who takes both
  struct Stored {
    Edge* edge;
    SessionId session;
    std::uint64_t number;
  };
  std::vector<Stored> newly_stored;
  std::optional<mapdb::UpdateJournal> journal;
  std::optional<JournalSaver> saver;

  // Of the merging thread.
  Phase phase = Phase::collecting;
  TeamRun team;
  std::map<RobotId, std::map<MapId, Map>> maps;  // of each robot; the one of its name first
  std::map<RobotId, RobotRecord> records;
  fusion::FusionResult sealed;
  std::vector<std::string> notes;
  std::set<TierId> asked;                // to judge
  std::map<TierId, std::string> wanted;  // maps that are awaited as a whole, as it was said
  std::set<TierId> gone;                 // what they merged does not count: their robots are elsewhere
  tiers::RoundMerger rounds;

  std::atomic<bool> keeps_previews;
  std::thread speaker, merger;

  State(const LiveSite& of, const RunSettings& how);
  ~State();

  // --- Links, under `mutex`.
  void speak();
  void step(Clock::time_point now);
  void replay();
  std::uint64_t greet(Link& link, const Hello& hello);
  void take(Link& link, Said said);
  bool is_new(const Said& said);
  void say_requests(Link& link);
  void say_who_is_missing() const;
  bool is_needed(const TierId& edge) const;
  bool has_its_finals(const TierId& id, const Edge& edge) const;

  // --- Merging.
  void merge();
  void take_said();
  void take(const TierId& id, Edge& edge, Said said);
  void take_robot(const TierId& id, const Edge& edge, const Said& said);
  bool take_final(const TierId& id, Edge& edge, Said& said);
  void begin_finals(const TierId& id, Edge& edge, const std::string& names);
  void preview();
  void take_requests();
  bool advance();
  void begin_sealing();
  void seal();
  void finish();
  bool have_judged() const;
  bool have_sent_wanted() const;
  void give_finals();
  std::vector<std::optional<RobotResult>> robots();
  void ask(const TierId& edge, std::vector<std::pair<std::string, std::string>> words);
};

}  // namespace mapweave::runtime
