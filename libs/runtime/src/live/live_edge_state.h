#pragma once
// What a live edge consists of: one thread that speaks with robots and the cloud (live_edge.cpp), one that maps for
// each robot, and one that merges (live_edge_maps.cpp).

#include "numbered_wire.h"
#include "on_board.h"
#include "robot_record.h"

#include "team/journal_saver.h"

#include <mapweave/runtime/live_edge.h>
#include <mapweave/tiers/edge_server.h>
#include <mapweave/tiers/round_merger.h>

#include <atomic>
#include <condition_variable>
#include <list>
#include <mutex>
#include <thread>

namespace mapweave::runtime {

struct LiveEdge::State {
  struct Robot {
    const PlannedRobot* planned = nullptr;
    // Under `mutex`.
    std::optional<SessionId> session;
    std::uint64_t taken = 0, stored = 0, mapped = 0, scans = 0, lost_scans = 0;
    std::deque<std::pair<Sensed, std::size_t>> queue;  // with their bytes
    std::size_t queue_bytes = 0;
    std::optional<tiers::RobotOutcome> outcome;
    bool has_ended = false, is_member = false;
    bool has_left = false;      // since the last preview; it may have come back
    bool has_said_all = false;  // its end came; it may still have to be mapped
    std::string map_report;     // the last one, encoded; empty: none yet
    std::optional<Clock::time_point> received_at;
    transport::Channel::Health wire_before;   // counts of its wires that were closed
    std::uint64_t begun = 0, begun_soon = 0;  // wires that it began; within patience_s of the one before, in a row
    Clock::time_point begun_at{};
    std::shared_ptr<const Map> so_far;  // growing_part of its map
    std::shared_ptr<const Map> own;     // for who looks: its map so far; once it has ended, its map
    // Of its thread.
    std::optional<tiers::RobotSlam> slam;
    OnBoardParts on_board;  // where it maps itself
    RobotRecord record;
    std::optional<Stamp> first_scan, last_scan;
    Clock::time_point began{}, reads_again{};
    bool has_outcome = false;
    bool has_news = false;           // that `so_far` does not show
    std::size_t reported_nodes = 0;  // of the merging thread; of its map in map_report
    bool has_reported_end = false;
    std::thread mapper;
  };
  struct Link {
    std::optional<NumberedWire> wire;
    Robot* robot = nullptr;  // once it said hello
    bool is_closed = false;
  };

  const TierId edge;
  const LiveSite site;
  const Connect to_cloud;
  const Hash agreement;
  const std::int64_t began;  // which run of this edge it is, for the cloud

  mutable std::mutex mutex;
  const std::shared_ptr<std::condition_variable> woken = std::make_shared<std::condition_variable>();
  std::condition_variable& changed = *woken;  // channels may outlive the edge
  LiveOptions options;
  bool has_new_options = false;  // that the merging thread does not know
  std::map<RobotId, Robot> robots;
  std::list<Link> links;
  const bool is_coordinated;
  LivePlan plan;  // the newest; number 0: none came
  LiveRequests asked_for;
  bool has_new_requests = false;  // that no preview knows of
  std::optional<NumberedWire> cloud;
  LiveEdgeCounts counts;
  std::shared_ptr<const LivePreview> shown;                 // where the site keeps previews
  std::deque<Said> requests;                                // of the cloud
  std::vector<std::pair<std::string, std::string>> finals;  // what the final map rests on: subjects and bytes
  bool begins_rounds = false;                               // the cloud knows of no preview
  std::atomic<bool> ends{false}, keeps_previews;

  std::mutex stored_mutex;  // after `mutex` by who takes both
  std::vector<std::pair<Robot*, std::uint64_t>> newly_stored;
  std::optional<mapdb::UpdateJournal> journal;
  std::optional<JournalSaver> saver;
  std::unique_ptr<LiveMapServer> cameras;  // where they share; thread-safe

  // Of the merging thread.
  std::map<RobotId, std::shared_ptr<const Map>> parts;  // maps so far, of members
  std::optional<tiers::RoundMerger> rounds;
  std::optional<tiers::EdgeServer> server;
  tiers::JudgingTask task;

  std::thread speaker, merger;

  State(TierId id, const LiveSite& of, Connect connect);
  ~State();

  // --- Links, under `mutex`.
  void speak();
  void step(Clock::time_point now);
  void step_cloud(std::unique_lock<std::mutex>& lock, Clock::time_point now);
  std::uint64_t greet(Link& link, const Hello& hello);
  void take(Link& link, const Said& said);
  void keep(Robot& robot, Sensed sensed, std::size_t bytes);
  void begin_anew_with_cloud();
  void say_who_is_missing() const;

  void replay();
  void map(Robot& robot);
  void begin(Robot& robot, const SessionId& session, bool is_on_board) const;
  std::optional<tiers::RobotOutcome> step(Robot& robot, Sensed sensed, std::size_t bytes);
  tiers::RobotOutcome mapped_on_board(Robot& robot, const std::optional<Error>& trouble) const;
  static void complete(Robot& robot, const tiers::RobotOutcome& outcome);
  bool await_work(Robot& robot, std::unique_lock<std::mutex>& lock);
  void read_map(Robot& robot, std::unique_lock<std::mutex>& lock);

  void merge();
  void preview();
  void read_parts();
  void report_maps();
  void fuse_all();
  std::vector<std::pair<std::string, std::string>> fused(const std::vector<RobotId>& members);
  std::vector<RobotId> members() const;  // under `mutex`
  void take(const LivePlan& news);
  bool is_due_to_fuse() const;  // under `mutex`
  void answer(const Said& request);
  void say(const std::string& subject, std::string bytes);
  std::vector<fusion::MapPrior> priors(const std::vector<const Map*>& maps) const;
  std::set<std::pair<MapId, MapId>> refused() const;
};

}  // namespace mapweave::runtime
