#pragma once
// Fusion in rounds while robots drive (RecSLAM III-C): at times of the team, edges fuse the laser maps that their
// robots have so far, and the cloud what edges have. Previews: no final map knows of them. The same for any number of
// threads, but for the times that are measured.

#include "robots/lasers_in_step.h"

#include <mapweave/runtime/report.h>
#include <mapweave/tiers/round_merger.h>

#include <map>
#include <optional>
#include <set>
#include <vector>

namespace mapweave::runtime {

// Joint maps that are drawn: so many at most, spread over the rounds, the first and the last one among them.
class ChosenPictures {
 public:
  explicit ChosenPictures(std::size_t most) : most_(most) {}
  void offer(std::size_t round, const Map& joint);
  std::map<std::size_t, Map> take() { return std::move(maps_); }

 private:
  std::size_t most_;
  std::map<std::size_t, Map> maps_;  // by round
};

// Cells of a quarter of a metre that one robot saw, in its own map's frame.
class SeenArea {
 public:
  double add_m2(const Map& part);  // what is new

 private:
  std::optional<NodeId> last_;
  Pose2 last_pose_;
  std::set<std::pair<std::int32_t, std::int32_t>> cells_;
};

class FusionRounds {
 public:
  // Plan and configuration must outlive it; the plan names the edge that each robot is on now.
  FusionRounds(const RunConfiguration&, const RunPlan&);

  // When it looks next, where the next record is due then.
  double next_s(double due_s) const;
  void step(double now_s, LasersInStep& lasers, WorkerPool&);

  RoundsReport take_report();

 private:
  struct Robot {
    TierId at;  // edge; empty: the cloud
    bool is_known = false;
    std::optional<tiers::GrowingMapSender> sender;  // of a robot that maps on board
    std::uint64_t sensed_bytes = 0;                 // that were counted
    Map part;
    SeenArea seen;
  };
  bool is_due(double now_s, LasersInStep& lasers, WorkerPool& pool);
  void read_maps(double now_s, LasersInStep& lasers, WorkerPool& pool);
  void send(const PlannedRobot& planned, LaserTask& task, RoundWork& round);
  void set_priors();
  void fuse_on_edges(RoundWork& round, WorkerPool&);
  void fuse_in_cloud(RoundWork& round, WorkerPool&);
  void keep_picture(std::size_t round);

  const RunConfiguration& configuration_;
  const RunPlan& plan_;
  const RoundOptions& options_;
  double looked_s_ = 0.0, last_round_s_ = 0.0, new_area_m2_ = 0.0;
  std::map<RobotId, Robot> robots_;
  std::map<TierId, tiers::RoundMerger> edges_;
  tiers::RoundMerger cloud_;
  ChosenPictures pictures_;
  RoundsReport report_;
};

}  // namespace mapweave::runtime
