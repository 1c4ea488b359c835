#pragma once
// The edge's role: keeps the maps of its robots, fuses them (RecSLAM's preparative fusion) and sends to the cloud: of
// maps that it merged each place once, with what it found between them. Its commitments are provisional: the cloud may
// take a merge back, and asks for the whole maps then. A state machine: no thread, no clock, no file.

#include <mapweave/fusion/fuse.h>
#include <mapweave/fusion/thinning.h>
#include <mapweave/tiers/judging_task.h>
#include <mapweave/tiers/robot_slam.h>

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace mapweave::tiers {

// A map with all it holds as its tier's first update, encoded; with a higher number it takes the place of those before.
// in_floats: as MapUpdate::in_floats.
std::string first_update(const Map&, const TierId& from, std::uint64_t sequence = 1, bool in_floats = false);

// What a robot that maps on board sends when its recording has ended: its maps, each as a first update, encoded.
struct RobotUpdates {
  RobotId robot;
  std::vector<std::string> updates;
};

// What an edge sends of its robots' maps.
struct EdgeMapOptions {
  bool thin = true;  // false: the whole maps, each when its robot has ended
  fusion::ThinningOptions thinning;
};

// What was sent of maps that could be thinned.
struct ThinningCounts {
  std::size_t scans = 0, kept = 0;
  double walls_left_out = 0.0;  // the largest share of any component's
};

class EdgeServer {
 public:
  // `robots`: those that will ship to this edge.
  EdgeServer(TierId edge, const std::vector<RobotId>& robots, fusion::FusionOptions options, EdgeMapOptions sent = {});

  // Where maps lie to each other, for result(). Before the last robot ends.
  void set_priors(std::vector<fusion::MapPrior> priors) { priors_ = std::move(priors); }
  // Maps that must not be matched to each other, the lower id first. Before the last robot ends.
  void set_refused(std::set<std::pair<MapId, MapId>> refused) { refused_ = std::move(refused); }

  // What one event makes the edge do.
  struct Effects {
    std::vector<std::string> for_cloud;  // encoded MapUpdates, in the order of their sequence
    std::vector<std::string> merged;     // encoded MergedMaps, of maps among these
    std::size_t map_bytes = 0;           // of the robot's own maps as a whole
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
  // The same where somebody else judges: the work, and the answers.
  JudgingWork work_of(const JudgingTask&) const;
  Effects step(const std::vector<Judgement>&);

  // Before the last robot ends: what it will begin with when its robots have left these maps, and the answers. They
  // save time, and change nothing else.
  JudgingWork first_work(const std::vector<const Map*>& maps, WorkerPool&) const;
  void know(const std::vector<Judgement>& judgements) {
    for (const Judgement& judgement : judgements) memo_.emplace(judgement.id, judgement);
  }

  // Its maps of these as a whole, for who has them thinned.
  Effects whole_maps(const std::vector<MapId>& maps);

  TierId id() const { return edge_; }
  const ThinningCounts& thinning() const { return thinning_; }
  const Table<MapId, Map>& maps() const { return maps_; }  // the store: every robot's own map
  const fusion::FusionResult& result() const {
    return result_;
  }  // empty before all robots have ended, and where none left a map

 private:
  void send_thinned(Effects& effects);
  const Map* as_sent(const MapId& id) const;
  fusion::FusionInput input() const;  // without maps

  TierId edge_;
  fusion::FusionOptions options_;
  EdgeMapOptions sent_options_;
  std::vector<fusion::MapPrior> priors_;
  std::set<std::pair<MapId, MapId>> refused_;
  std::vector<std::string> updates_of(const std::vector<Judgement>&);
  std::set<RobotId> awaited_;
  std::map<MapId, std::uint64_t> sequence_;  // of the last update about each map
  Table<MapId, Map> maps_;
  Table<MapId, Map> thinned_;  // as the cloud has them
  ThinningCounts thinning_;
  fusion::Memo memo_;
  std::shared_ptr<matching::ModelCache> models_;
  fusion::FusionResult result_;
};

}  // namespace mapweave::tiers
