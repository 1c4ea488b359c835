#pragma once
// The coordinator of a deployment: receives what programs say of themselves and what edges' maps show, and decides
// which robot's data go to which edge, again when the world changes and after each coordinator.overlap_period_s.

#include <mapweave/runtime/live_plan.h>
#include <mapweave/runtime/run_configuration.h>

#include <nlohmann/json_fwd.hpp>

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::runtime {

struct LiveCoordinatorCounts {
  struct EdgeCounts {
    TierId id;
    bool is_there = true;            // false: its robots went to other edges
    std::optional<double> silent_s;  // time since its last message; none: it sent none
    std::vector<RobotId> robots;     // robots that the plan gives it
    double speed = 1.0, bytes_per_s = 0.0;
    std::string speed_is, bytes_are;  // "measured", "configured", "like others"
  };
  struct RobotCounts {
    RobotId id;
    TierId edge, at;  // edge by the plan; edge that the robot reports. Empty: none
    bool has_come = false, has_ended = false;
    std::optional<double> silent_s;
    std::uint64_t scans = 0, queue_bytes = 0;  // scans mapped; bytes that wait to be mapped
  };
  std::vector<EdgeCounts> edges;    // sorted by id
  std::vector<RobotCounts> robots;  // sorted by id
  LivePlan plan;
  double plan_age_s = 0.0;
  std::uint64_t decisions = 0, moves = 0, unreadable = 0;
  std::optional<double> cloud_silent_s;
  // Time from the last sensed scan to the team's map, were nothing mapped before: by the last decision, and as it was.
  double expected_s = 0.0;
  std::optional<double> actual_s;  // none before the map is written, and where nobody saw the last robot end
  std::string last;                // the last decision in words; empty: none yet
};

// All calls are thread-safe. Times are the caller's, in seconds, and never run backwards; time in which nothing could
// be received should not count.
class LiveCoordinator {
 public:
  // before: the last plan that was published, by whomever: it is gone on with, unless it was done. Throws what reading
  // a model throws.
  LiveCoordinator(const RunConfiguration& configuration, const RunPlan& plan, const std::optional<LivePlan>& before);
  ~LiveCoordinator();

  // What they said last, as often as it is read: only what is new counts as a sign of life. What cannot be read is
  // counted. maps: what pack_map_reports() made.
  void receive_cloud(std::string_view status, double now_s);
  void receive_edge(const TierId& edge, std::string_view status, double now_s);
  void receive_robot(const RobotId& robot, std::string_view status, double now_s);
  void receive_maps(const TierId& edge, std::string_view maps);

  // Decides if it is time to. True: there is a new plan. Throws Error as Coordinator::decide.
  bool step(double now_s);

  // The next step() decides, whenever the last one did.
  void decide_soon();

  void use(const LiveOptions& options);  // as LiveEdge::use()

  LivePlan plan() const;  // number 0: no robot has come yet
  LiveCoordinatorCounts counts(double now_s) const;
  // {plan, since, final, done, method, expected_seconds, actual_seconds, edges, wires, overlaps, decisions}: of wires
  // and edges what is known and whence; the decisions that moved robots, kMostDecisions at most, and the last one.
  nlohmann::ordered_json report() const;
  static constexpr std::size_t kMostDecisions = 200;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// LiveEdge::map_reports() as one message of at most `most_bytes`; those that do not fit are left out.
std::string pack_map_reports(const std::vector<std::string>& reports, std::size_t most_bytes);

}  // namespace mapweave::runtime
