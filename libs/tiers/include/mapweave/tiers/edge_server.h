#pragma once
// The edge's role: keeps the maps of its robots, fuses them (RecSLAM's preparative fusion) and sends to the cloud. Its
// commitments are provisional: what travels are the robots' own maps and the judgements made here. A state machine: no
// thread, no clock, no file.

#include <mapweave/fusion/fuse.h>
#include <mapweave/tiers/judging_task.h>
#include <mapweave/tiers/robot_slam.h>

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace mapweave::tiers {

// A map with all it holds as its tier's first update, encoded.
std::string first_update(const Map&, const TierId& from);

// What a robot that maps on board sends when its recording has ended: its maps, each as a first update, encoded.
struct RobotUpdates {
  RobotId robot;
  std::vector<std::string> updates;
};

class EdgeServer {
 public:
  // `robots`: those that will ship to this edge.
  EdgeServer(TierId edge, const std::vector<RobotId>& robots, fusion::FusionOptions options);

  // Where maps lie to each other, for result(). Before the last robot ends.
  void set_priors(std::vector<fusion::MapPrior> priors) { priors_ = std::move(priors); }

  // What one event makes the edge do.
  struct Effects {
    std::vector<std::string> for_cloud;  // encoded MapUpdates, in the order of their sequence
    std::size_t map_bytes = 0;           // of these, what are the robot's own maps
    bool fused = false;                  // all robots have ended: result() is there
  };
  // A robot's stream has ended. Throws Error(kBadInput) for a robot that is not this edge's, or that has ended already.
  // The edge's result does not depend on the order in which robots end.
  Effects step(RobotOutcome, WorkerPool&, Progress&);
  // The same of a robot that maps on board. Throws what decoding an update throws, too.
  Effects step(const RobotUpdates&, WorkerPool&, Progress&);

  // After it has fused: what the cloud asks for. Throws what decoding an update throws, and Error(kBadInput) for a pair
  // of which it holds no map.
  Effects step(const JudgingTask&, WorkerPool&, Progress&);

  TierId id() const { return edge_; }
  const Table<MapId, Map>& maps() const { return maps_; }  // the store: every robot's own map
  const fusion::FusionResult& result() const {
    return result_;
  }  // empty before all robots have ended, and where none left a map

 private:
  TierId edge_;
  fusion::FusionOptions options_;
  std::vector<fusion::MapPrior> priors_;
  std::vector<std::string> updates_of(const std::vector<Judgement>&);
  std::set<RobotId> awaited_;
  std::map<MapId, std::uint64_t> sequence_;  // of the last update about each map
  Table<MapId, Map> maps_;
  std::shared_ptr<matching::ModelCache> models_;
  fusion::FusionResult result_;
};

}  // namespace mapweave::tiers
