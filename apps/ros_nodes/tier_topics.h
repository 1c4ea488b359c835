#pragma once
// What an edge or a cloud shows over ROS: maps, transforms, diagnostics, and services on its maps.

#include "robot_maps_publisher.h"
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
  std::vector<RobotId> robots;   // whose own maps it may publish
  bool shows_team_frame = true;  // team -> ROBOT/map; else ROBOT/map -> TIER/team, since another tier shows it
};

// Services, below the tier's name: save_map (map_msgs/SaveMap: a folder for map.png, map.pgm, map.yaml, map.pcd and
// trajectories), load_map (nav_msgs/LoadMap: a YAML file of map_server, which is returned and shown as loaded_map),
// static_map (nav_msgs/GetMap: the largest map so far). Threads of its own draw maps, one the robots' and one the
// tier's, each at a fifth of a processor at most.
class TierTopics {
 public:
  using Status = std::function<nlohmann::ordered_json()>;
  using Preview = std::function<std::shared_ptr<const runtime::LivePreview>()>;
  struct Maps {
    Preview preview;
    RobotMapsPublisher::MapOf of_robot;  // empty: it publishes none of robots
  };
  // The configuration, the plan, and what the functions need must outlive it.
  TierTopics(RosNode& node, const runtime::RunConfiguration& configuration, const runtime::RunPlan& plan,
             TierOfTeam tier, Maps maps);
  ~TierTopics();

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::ros_nodes
