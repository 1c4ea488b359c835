#pragma once
// What is known of a deployment's wires and processors: as it was measured; else as the configuration has it; else,
// where others of the kind were measured, like these, so that what nobody measured looks neither better nor worse.

#include "plan/planned_links.h"

#include <mapweave/scheduling/latency_model.h>

#include <map>
#include <optional>
#include <utility>

namespace mapweave::runtime {

enum class Known { measured, configured, like_others };
const char* to_text(Known known);  // "measured", "configured", "like others"

struct Expected {
  double value = 0.0;
  Known known = Known::configured;
};

class Measures {
 public:
  Measures(const RunConfiguration& configuration, const RunPlan& plan, const scheduling::LatencyModel& model);

  void take_wire(const RobotId& robot, const TierId& edge, double bytes_per_s);
  void take_wire_to_cloud(const TierId& edge, double bytes_per_s);
  // Scans that the edge has mapped, and wall time for them, since its program began.
  void take_mapping(const TierId& edge, double scans, double seconds);

  Expected wire(const RobotId& robot, const TierId& edge) const;  // bytes/s
  Expected wire_to_cloud(const TierId& edge) const;               // bytes/s
  Expected speed(const TierId& edge) const;                       // as EdgeResources
  scheduling::EdgeResources resources(const TierId& edge) const;
  const scheduling::EdgeResources& planned(const TierId& edge) const { return edges_.at(edge).planned; }
  double delay_s(const RobotId& robot, const TierId& edge) const;

 private:
  struct Edge {
    scheduling::EdgeResources planned;
    double slam_s_per_scan = 0.0;  // at speed 1; 0: robots map
    std::optional<double> bytes_per_s, speed;
    double scans = 0.0, seconds = 0.0;  // where the speed's last measure ended
  };
  const NetworkOptions& network_;
  std::map<TierId, Edge> edges_;
  std::map<RobotId, std::map<TierId, double>> wires_;
};

}  // namespace mapweave::runtime
