#pragma once
// The cloud of a deployment: merges what its edges send, shows previews, and once all robots have ended leaves the
// folder of results as `run` leaves it.

#include <mapweave/runtime/batch_runner.h>
#include <mapweave/runtime/live_edge.h>

namespace mapweave::runtime {

struct LiveCloudCounts {
  struct EdgeCounts {
    TierId id;
    std::uint64_t taken = 0, stored = 0;         // messages that came in order; messages in the journal
    bool is_on_wire = false, has_fused = false;  // has_fused: its final maps are all here
    bool has_all = false;                        // the edge has all messages of the cloud
    std::uint64_t runs = 0;                      // how often the edge's program began
    std::optional<double> silent_s;              // time since its last message; none: it sent none
    bool is_needed = true;                       // false: the coordinator gave it no robots
    transport::Channel::Health wire{};
  };
  std::vector<EdgeCounts> edges;                         // sorted by id
  std::uint64_t refused = 0, unreadable = 0, again = 0;  // messages, as in LiveEdgeCounts
  std::uint64_t previews = 0;
  std::vector<std::vector<MapId>> joint;  // groups of two or more maps that the last preview merged
  std::vector<std::string> apart;         // why pairs of maps stayed apart in the last preview
  std::size_t maps = 0;                   // number of maps in the last preview
  std::map<RobotId, Stamp> newest_scans;  // newest scan of each robot in the last preview
  bool is_sealing = false, is_done = false;
  std::string trouble;                  // why the cloud cannot store or go on; empty: it can
  std::set<std::string> wire_troubles;  // what holds up wires on which no edge has come
  std::uint64_t plan = 0;               // number of the plan that it follows
};

// All calls are thread-safe.
class LiveCloud {
 public:
  // Goes on where the journal ends, as LiveEdge. Throws Error: kCannotWrite where the results could not be written,
  // what UpdateJournal throws, and what run_batch() throws of maps that it begins with.
  LiveCloud(const LiveSite& site, const RunSettings& settings);
  ~LiveCloud();

  // As LiveEdge's, to edges.
  std::shared_ptr<transport::Channel> connect();
  void serve(std::shared_ptr<transport::Channel> edge);
  // With a coordinator it waits for a final plan, and for the edges that have robots by it.
  void follow(const LivePlan& plan);
  // As LiveEdge's.
  bool follow(const LiveRequests& requests);
  void use(const LiveOptions& options);  // as LiveEdge::use()
  // Does not wait any longer for who has not ended: what their edges have not sent is left out, and the report says so.
  void seal_now();
  // The report, once the folder is there and this was sent to the edges; nullopt: it is not yet. Throws what went
  // wrong for good (Error), and Interrupted where an interruption ended it.
  std::optional<Report> wait(std::chrono::milliseconds patience);
  LiveCloudCounts counts() const;
  std::shared_ptr<const LivePreview> preview() const;  // as LiveEdge::preview()

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::runtime
