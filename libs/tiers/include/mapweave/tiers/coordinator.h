#pragma once
// The coordinator's role (RecSLAM III-D, IV): receives what robots' maps show and what edges and wires are like, and
// decides which robot's data go to which edge; again when the world changes, where that is worth it, and why. A state
// machine: no thread, no clock, no file.

#include <mapweave/maps/coordination.h>
#include <mapweave/scheduling/overlap_estimate.h>
#include <mapweave/scheduling/plan.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::tiers {

struct CoordinatorOptions {
  scheduling::PlanOptions plan;
  scheduling::CloudResources cloud;
  double hysteresis = 0.1;  // robots are moved where that saves more than this share of the expected time
};

// What it decided, and why.
struct CoordinatorDecision {
  double at_s = 0.0;
  std::vector<std::string> because;  // in words, in the order in which it was received
  bool is_new_plan = false;          // else robots stay, but for those that have no edge
  std::vector<RobotMove> moves;      // by robot
  std::map<RobotId, TierId> edge_of;
  // Of t_c (eq. 3) for what was sensed so far: as decided, had everybody stayed (those without an edge put where they
  // cost least), and what no plan undercuts.
  double expected_s = 0.0, staying_s = 0.0, lower_bound_s = 0.0;
  double cut_weight = 0.0, algorithm_s = 0.0;
  std::vector<scheduling::OverlapEstimator::Overlap> overlaps;  // as summaries reported them
  std::vector<RobotId>
      unknown;  // robots of which neither a map nor a route is known: what they share counts as nothing
};

class Coordinator {
 public:
  explicit Coordinator(CoordinatorOptions);

  // Robots and edges that were not named before come first; ContractViolation for a report or a link of one that is
  // unknown.
  void receive(CoordinatorEvent);
  // nullopt where nothing was received since the last decision that could change it. Pure in what was received, but for
  // algorithm_s. Throws Error what make_plan throws of a method that cannot do what is asked.
  std::optional<CoordinatorDecision> decide(double now_s);

  // Whether robots move only where their edge is gone, whatever else would save.
  void hold(bool holds) { holds_ = holds; }

  const std::map<RobotId, TierId>& edge_of() const { return edge_of_; }  // empty names: on board

 private:
  struct KnownRobot {
    std::optional<std::uint64_t> scans;
    bool is_known = false;  // its map, or its route
  };
  struct CandidatePlan {
    std::vector<std::uint32_t> edge_of;  // by robot of the problem
    double seconds = 0.0;
  };
  KnownRobot& known(const RobotId& robot);
  void take(RobotComes&);
  void take(MapReport&);
  void take(const RobotGoes&);
  void take(const EdgeIs&);
  void take(const EdgeGoes&);
  void take(const LinkIs&);
  scheduling::Problem problem(const std::vector<RobotId>& robots);
  std::vector<RobotId> those_with_room() const;
  CandidatePlan staying(const scheduling::Latency&) const;
  CandidatePlan planned(const scheduling::Latency&, CoordinatorDecision&) const;

  CoordinatorOptions options_;
  scheduling::OverlapEstimator overlaps_;
  std::map<RobotId, KnownRobot> robots_;
  std::map<TierId, scheduling::EdgeResources> edges_;
  std::map<std::pair<RobotId, TierId>, scheduling::RobotLink> links_;
  std::map<RobotId, TierId> edge_of_;
  std::vector<std::string> because_;
  bool holds_ = false;
};

}  // namespace mapweave::tiers
