#pragma once
// What a coordinator receives, and what it answers (RecSLAM III-D). Byte forms: as exchange.h.

#include <mapweave/core/ids.h>
#include <mapweave/maps/map_summary.h>

#include <optional>
#include <string>
#include <string_view>
#include <variant>

namespace mapweave {

// Edge -> coordinator: a robot's map so far.
struct MapReport {
  RobotId robot;
  std::uint64_t scans = 0;
  MapSummary summary;
};
struct RobotComes {
  RobotId robot;
  std::optional<MapSummary> route;  // announced, before there is a map
  TierId edge;                      // where it is already; empty: nowhere
};
struct RobotGoes {  // it senses no more; what it sensed stays where it is, and counts
  RobotId robot;
};
struct EdgeIs {  // new, or changed
  TierId edge;
  double bytes_per_s = 0.0;               // edge -> cloud
  double speed = 1.0;                     // of its processor, as the latency model's
  std::optional<std::uint32_t> capacity;  // most robots; none: no bound
  std::optional<double> delay_s = {};     // edge -> cloud; none: the latency model's
};
struct EdgeGoes {
  TierId edge;
};
struct LinkIs {
  RobotId robot;
  TierId edge;
  double bytes_per_s = 0.0, delay_s = 0.0;
};
using CoordinatorEvent = std::variant<RobotComes, MapReport, RobotGoes, EdgeIs, EdgeGoes, LinkIs>;

// Coordinator -> robot and edges: where its data go from now on.
struct RobotMove {
  RobotId robot;
  TierId from, to;  // empty: nowhere; the robot maps on board
};

std::string encode(const CoordinatorEvent&);
std::string encode(const RobotMove&);
CoordinatorEvent decode_coordinator_event(std::string_view bytes, const std::string& where);
RobotMove decode_robot_move(std::string_view bytes, const std::string& where);

}  // namespace mapweave
