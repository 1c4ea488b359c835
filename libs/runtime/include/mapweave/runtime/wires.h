#pragma once
// The channels of a deployment, whatever carries them, and what keeps them open.

#include <mapweave/runtime/live_cloud.h>
#include <mapweave/transport/board.h>

#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace mapweave::runtime {

constexpr std::size_t kLongestOfMaps = std::size_t{64} << 20;  // bytes of a message with a robot's whole map
// Subjects on a camera's wire that overtake the others: who was lost and asks where it is, and what says that something
// is stored, maps and what is shared. No map is one message there.
std::vector<std::vector<std::string>> urgent_of_cameras();

// All calls are thread-safe. What it returns may outlive it.
class Wires {
 public:
  virtual ~Wires() = default;

  // Ends that open a channel: for LiveRobot and LiveEdge.
  virtual Connect from_robot(const RobotId& robot, const TierId& edge) const = 0;
  virtual Connect from_camera(const RobotId& robot, int number, const TierId& edge) const = 0;  // as ConnectCamera
  virtual Connect from_edge(const TierId& edge) const = 0;
  // Ends that accept channels.
  virtual Connect at_edge(const RobotId& robot, const TierId& edge) const = 0;
  virtual Connect at_camera_map_server(const RobotId& robot, int number, const TierId& edge) const = 0;
  virtual Connect at_cloud(const TierId& edge) const = 0;

  // Where every program of the deployment says how it is (program_status), under the name that its user has or would
  // have ("robot-alpha", "edge-north", "cloud"). Made by edges, the cloud, and who has no accounts.
  virtual std::shared_ptr<transport::Board> board() const = 0;
  // Where the coordinator says which robot has which edge (LivePlan), under "coordinator"; it alone makes it.
  virtual std::shared_ptr<transport::Board> plans() const = 0;
};

// Channels that one program serves: each is made anew where it was closed. Not thread-safe.
class ServedWires {
 public:
  // serve: as LiveEdge's or LiveCloud's. Each wire has a name.
  explicit ServedWires(std::function<void(std::shared_ptr<transport::Channel>)> serve) : serve_(std::move(serve)) {}
  void add(const std::string& name, Connect accept) { wires_.try_emplace(name, Wire{std::move(accept), nullptr}); }
  void remove(const std::string& name);  // and close it
  void keep();                           // to be called now and then

 private:
  struct Wire {
    Connect accept;
    std::shared_ptr<transport::Channel> channel;
  };
  std::function<void(std::shared_ptr<transport::Channel>)> serve_;
  std::map<std::string, Wire> wires_;
};

// Wires of the cameras of an edge's robots, where they share while they drive: nobody says beforehand how many a robot
// has, so each has one more than have come. Not thread-safe.
class CameraWires {
 public:
  CameraWires(const Wires& wires, const TierId& edge, LiveEdge& server);
  void add(const RobotId& robot);
  void keep();  // to be called now and then

 private:
  struct RobotWires {
    explicit RobotWires(std::function<void(std::shared_ptr<transport::Channel>)> serve) : wires(std::move(serve)) {}
    ServedWires wires;
    std::size_t count = 0;
  };
  const Wires& wires_;
  const TierId edge_;
  LiveEdge& server_;
  std::map<RobotId, RobotWires> robots_;
  std::chrono::steady_clock::time_point next_{};
};

}  // namespace mapweave::runtime
