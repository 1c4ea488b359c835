#pragma once
// One merge of a camera map server's maps, and what it leaves to the next one.

#include "team_view.h"

#include <mapweave/fusion/split_rigs.h>
#include <mapweave/tiers/visual_server.h>

namespace mapweave::tiers {

// Owned by the work too, which may outlive the server.
struct MapMerge {
  // Maps as they were, and their names at the server.
  using Snapshots = std::vector<std::pair<MapId, std::shared_ptr<const Map>>>;
  static std::vector<Map> copies(const Snapshots& snapshots);
  // The maps of robots that must not be matched to each other, among those of the input.
  static void refuse(const std::set<std::pair<RobotId, RobotId>>& robots, fusion::FusionInput& input);

  fusion::FusionInput input;  // without maps
  rig::RigOptions rig;
  std::vector<LandmarkId> forgotten;  // by those who made them; ascending
  std::set<std::pair<RobotId, RobotId>> refused = {};
  Stamp due;
  fusion::Memo memo;  // of what was judged
  // To the next one: judgements that stand, and where the maps lie.
  std::vector<Judgement> kept_judgements;
  std::vector<fusion::PreviousMerge> teams;
  std::vector<std::string> notes;                     // why cameras of one robot stay apart
  std::size_t keyframes = 0, adjusted_keyframes = 0;  // merged; and when all were adjusted last
  std::shared_ptr<const TeamView> view;

  void run(const MapMerge* last, Snapshots maps, const ServerOptions& options, fusion::FusionOptions fusion_options,
           WorkerPool& pool);

 private:
  void leave_to_the_next(const fusion::FusionResult& result);
};

}  // namespace mapweave::tiers
