#pragma once
// What an edge or a cloud shows over ROS: maps, transforms, diagnostics, and services on its maps.

#include "ros_node.h"

#include <mapweave/runtime/live_preview.h>
#include <mapweave/runtime/run_configuration.h>
#include <nlohmann/json_fwd.hpp>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace mapweave::ros_nodes {

struct TierOfTeam {
  std::string name;              // of an edge; the cloud is called cloud
  std::vector<RobotId> robots;   // whose own maps it publishes
  bool shows_team_frame = true;  // team -> ROBOT/map; else ROBOT/map -> TIER/team, since another tier shows it
};

// Services, below the tier's name: save_map (map_msgs/SaveMap: a folder for map.png, map.pgm, map.yaml, map.pcd and
// trajectories), load_map (nav_msgs/LoadMap: a YAML file of map_server, which is returned and shown as loaded_map),
// static_map (nav_msgs/GetMap: the largest map so far). A thread of its own draws maps.
class TierTopics {
 public:
  using Status = std::function<nlohmann::ordered_json()>;
  using Preview = std::function<std::shared_ptr<const runtime::LivePreview>()>;
  // The configuration, the plan, and what the functions need must outlive it.
  TierTopics(RosNode& node, const runtime::RunConfiguration& configuration, const runtime::RunPlan& plan,
             TierOfTeam tier, Preview preview);
  ~TierTopics();

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::ros_nodes
