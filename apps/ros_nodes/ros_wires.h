#pragma once
// The channels of a deployment over topics of ROS (live.broker: ros): two for each wire, of std_msgs/UInt8MultiArray,
// as mapweave_wires/EDGE/ROBOT/up and .../down. Boards are parameters of the master, which keeps what a program said
// after its end.

#include "ros_names.h"

#include <mapweave/runtime/run_configuration.h>
#include <mapweave/runtime/wires.h>

namespace mapweave::ros_nodes {

// Channels are made once there is a RosNode, whose thread receives for them.
class RosWires : public runtime::Wires {
 public:
  // Throws Error(kBadInput) for edges with brokers of their own, and for keys: topics know none.
  RosWires(const runtime::RunConfiguration& configuration, const runtime::RunPlan& plan);

  runtime::Connect from_robot(const RobotId& robot, const TierId& edge) const override;
  runtime::Connect from_camera(const RobotId& robot, int number, const TierId& edge) const override;
  runtime::Connect from_edge(const TierId& edge) const override;
  runtime::Connect at_edge(const RobotId& robot, const TierId& edge) const override;
  runtime::Connect at_camera_map_server(const RobotId& robot, int number, const TierId& edge) const override;
  runtime::Connect at_cloud(const TierId& edge) const override;
  std::shared_ptr<transport::Board> board() const override;
  std::shared_ptr<transport::Board> plans() const override;

 private:
  enum class Side { opens, accepts };
  runtime::Connect of_robot(const RobotId& robot, const TierId& edge, Side side) const;
  runtime::Connect of_camera(const RobotId& robot, int number, const TierId& edge, Side side) const;
  runtime::Connect of_cloud(const TierId& edge, Side side) const;

  RosNames edges_, robots_;
  std::size_t camera_queue_bytes_;
};

}  // namespace mapweave::ros_nodes
