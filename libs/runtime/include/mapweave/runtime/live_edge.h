#pragma once
// An edge of a deployment: maps what its robots send, a thread each, shows previews, and sends the cloud what
// EdgeServer makes of the maps once all have ended. What it says it has stored is in its journal.

#include <mapweave/core/progress.h>
#include <mapweave/core/worker_pool.h>
#include <mapweave/runtime/live_map_server.h>
#include <mapweave/runtime/live_preview.h>
#include <mapweave/runtime/live_requests.h>
#include <mapweave/runtime/live_robot.h>

#include <filesystem>
#include <vector>

namespace mapweave::runtime {

// What an edge or a cloud is made from. All that it refers to must outlive it.
struct LiveSite {
  const RunConfiguration& configuration;
  const RunPlan& plan;  // the plan of the whole team
  LiveOptions options;
  WorkerPool& pool;
  Progress& progress;
  std::optional<std::filesystem::path> journal = {};
  bool keeps_previews = false;  // for preview(), also where no page shows them
};

struct LiveEdgeCounts {
  struct RobotCounts {
    RobotId id;
    std::uint64_t taken = 0, stored = 0, mapped = 0;  // messages that came in order; are in the journal; are mapped
    std::uint64_t scans = 0, lost_scans = 0;          // scans mapped; scans that the robot had no room for
    std::size_t queue_bytes = 0;                      // bytes that wait to be mapped
    bool is_on_wire = false, has_ended = false;       // has_ended: its map is finished
    bool has_said_all = false;                        // no message of it is awaited; some may still have to be mapped
    std::optional<double> silent_s;                   // time since its last message; none: it sent none
    transport::Channel::Health wire{};
    std::uint64_t begun = 0, begun_soon = 0;  // wires that it began; the last ones that each began soon after another
    bool is_member = true;  // false: the coordinator gave it to another edge; its data here do not count
  };
  std::vector<RobotCounts> robots;  // sorted by id
  std::uint64_t refused = 0;        // hellos of other edges' robots, of names already connected, of other versions
  std::uint64_t unreadable = 0, again = 0;  // messages that cannot be decoded; that came before
  std::uint64_t previews = 0;
  std::vector<std::vector<MapId>> joint;  // groups of two or more maps that the last preview merged
  std::map<RobotId, Stamp> newest_scans;  // newest scan of each robot in the last preview
  std::size_t waiting_bytes = 0;          // bytes that the cloud has not stored
  bool is_cloud_on_wire = false;
  std::optional<double> cloud_silent_s;     // time since the cloud's last message; none: it sent none
  bool is_fused = false, is_done = false;   // its map holds all its robots; the cloud has written the team's map
  std::string trouble;                      // why the edge cannot store or go on; empty: it can
  std::set<std::string> wire_troubles;      // what holds up wires on which no robot has come
  std::uint64_t plan = 0;                   // number of the plan that it follows
  double mapping_s = 0.0;                   // wall time spent mapping scans of all robots
  std::optional<double> bytes_per_s;        // what the link to the cloud carried when last measured
  transport::Channel::Health cloud_wire{};  // state of the link to the cloud
  // Counts of the camera map server since the edge began; set where cameras share while they drive.
  std::optional<ServerCounts> cameras;
};

// The file in which the camera map server of an edge with this journal keeps what it receives.
std::filesystem::path journal_of_cameras(const std::filesystem::path& journal);

// All calls are thread-safe.
class LiveEdge {
 public:
  // Goes on where the journal ends: it maps again what is in it, before it takes more. Without one, what it has is gone
  // when it ends, and it confirms what it holds in memory. Where cameras share (server.share) it has a camera map
  // server with a journal of its own. Throws Error as UpdateJournal and LiveMapServer do, and kBadInput where no robot
  // of the plan has this edge; with a coordinator, where it is no edge of the plan.
  LiveEdge(TierId edge, const LiveSite& site, Connect to_cloud);
  ~LiveEdge();  // ends at once; the journal's content stays

  // A robot's end of a channel in this process. Letting go of it closes it.
  std::shared_ptr<transport::Channel> connect();
  // The edge's end of any channel to a robot, for as long as it is open. Closed at once where there are too many.
  void serve(std::shared_ptr<transport::Channel> robot);
  // As serve() for one camera of this robot at the camera map server, each on its own channel. The channel is closed
  // where cameras do not share.
  void serve_camera(const RobotId& robot, std::shared_ptr<transport::Channel> camera);
  // How many of this robot's cameras have come so far.
  std::size_t cameras_of(const RobotId& robot) const;
  // Its robots are those that the plan gives it. What it has of others it keeps: they may come back, and go on there.
  // With a coordinator it merges for good by a final plan alone, and anew where a later one gives it more robots.
  void follow(const LivePlan& plan);
  // What users ask for, all of it each time. False: too late, its final maps were merged without.
  bool follow(const LiveRequests& requests);
  // Takes of these what it can while it runs (LiveOptions::take_while_running).
  void use(const LiveOptions& options);
  // What the maps of its robots show so far, for the coordinator: encoded MapReports.
  std::vector<std::string> map_reports() const;
  LiveEdgeCounts counts() const;
  // The last one; null while there is none, and where none is kept: they are where the options have a page.
  std::shared_ptr<const LivePreview> preview() const;
  // A robot's map so far, from its first scan on and whatever previews show, read a few times a second; of cameras
  // once the robot has ended. Its nodes count. Null: it has none yet, or is not of this edge now.
  std::shared_ptr<const Map> map_so_far(const RobotId& robot) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::runtime
