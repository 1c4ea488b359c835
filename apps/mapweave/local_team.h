#pragma once
// All programs of a deployment in one: a broker, the cloud, the edges and the robots, which talk through the broker as
// they would on machines of their own.

#include "configuration.h"
#include "starting_robot.h"

#include <mapweave/runtime/live_cloud.h>
#include <mapweave/runtime/live_status.h>
#include <mapweave/runtime/nats_wires.h>
#include <mapweave/transport/broker.h>

#include <nlohmann/json_fwd.hpp>

#include <functional>
#include <list>
#include <map>
#include <memory>
#include <vector>

namespace mapweave::app {

// Not thread-safe.
class LocalTeam {
 public:
  // has_log: as StartingRobot's. store: a folder for the broker and for journals, with which a team that was killed
  // goes on. The plan's sensors need not be chosen. Throws what LiveEdge, LiveCloud and the broker throw.
  LocalTeam(runtime::RunConfiguration configuration, runtime::RunPlan plan, const std::filesystem::path& store,
            const runtime::RunSettings& results, Progress& progress,
            const std::function<bool(const RobotId&)>& has_log = nullptr);
  ~LocalTeam();

  const runtime::RunConfiguration& configuration() const { return configuration_; }
  const runtime::RunPlan& plan() const { return plan_; }
  runtime::LiveCloud& cloud() { return *cloud_; }
  const runtime::LiveCloud& cloud() const { return *cloud_; }
  runtime::LiveEdge& edge(const TierId& name) { return *edges_.at(name); }
  const std::list<StartingRobot>& robots() const { return robots_; }  // as they are planned

  void look();   // now and then: keeps wires, starts robots. Throws as StartingRobot::look
  void end();    // all robots end
  void leave();  // nothing more is said for any robot: another team goes on
  nlohmann::ordered_json status(const std::string& program, const runtime::StatusTerms&) const;

 private:
  transport::Broker broker_;
  runtime::RunConfiguration configuration_;
  runtime::RunPlan plan_;
  WorkerPool merging_;
  std::unique_ptr<runtime::NatsWires> wires_;
  std::unique_ptr<runtime::LiveCloud> cloud_;
  std::map<TierId, std::unique_ptr<runtime::LiveEdge>> edges_;
  std::vector<runtime::ServedWires> served_;
  std::vector<runtime::CameraWires> cameras_;
  std::list<StartingRobot> robots_;
};

}  // namespace mapweave::app
