#pragma once
// When the map would have been complete, had each tier been a machine of its own and each wire what the configuration
// says (RecSLAM IV-A, equations 1 to 3). Work is what the run measured of itself, in processor time; wires are in
// virtual time. Never part of a sealed result.

#include <mapweave/core/ids.h>
#include <mapweave/runtime/tier_options.h>

#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::runtime {

// What was done, in seconds of one core of this machine, and what was sent.
struct RobotWork {
  RobotId id;
  TierId edge;
  double log_s = 0.0;                       // length of the log in data time
  double packing_s = 0.0, mapping_s = 0.0;  // time for its laser's scans; mapping includes unpacking
  double seeing_s = 0.0;                    // time of its cameras' clients, on the robot in every mode
  std::uint64_t sensed_bytes = 0, map_bytes = 0;
  // Of what its edge had mapped, sent to another one and mapped again there, from the beginning.
  double repeated_s = 0.0;
  std::uint64_t repeated_bytes = 0;
};
struct EdgeWork {
  TierId id;
  double fusing_s = 0.0;
  std::uint64_t bytes = 0;  // sent to the cloud: its robots' maps and what it merged of them
  double speed = 1.0;       // relative to ProcessorOptions::edge
  // Maps of other edges, sent to be compared with its own; the judgements that it returned.
  std::uint64_t sent_bytes = 0, judged_bytes = 0;
  double judging_s = 0.0;
  tiers::ThinningCounts thinning =
      {};  // scans of the maps sent before and after thinning; 0 where whole maps were sent
};
struct PushWork {
  RobotId robot;
  std::uint64_t bytes = 0;    // size of the team's map
  std::string next_run = {};  // the configuration that names it as the start of the robot's next run
};
// Overlap degree of two robots' maps, once they lie on each other; where there was a coordinator, as it thought
// at its last decision, since it predicts with these estimates.
struct OverlapOfRobots {
  RobotId a, b;
  double degree;
};
struct Work {
  std::vector<RobotWork> robots;  // sorted by id
  std::vector<EdgeWork> edges;    // sorted by id; none in mode cloud_only
  double fusing_s = 0.0;          // all fusing in the cloud
  double planning_s = 0.0;        // part of fusing_s before it knew what edges must compare
  std::vector<PushWork> pushes;
  std::vector<OverlapOfRobots> overlaps;
  std::vector<RoundWork> rounds;  // while robots drove
};

// All times are seconds since the recordings ended.
struct Timeline {
  struct RobotTimes {
    RobotId id;
    TierId edge;
    double packed_s = 0.0, arrived_s = 0.0,
           mapped_s = 0.0;  // onboard and cloud_only: mapped before it arrives; nothing is packed
    double load = 0.0;      // load of its core while it records: computing time over driving time
  };
  struct EdgeTimes {
    TierId id;
    double ready_s = 0.0, fused_s = 0.0,
           arrived_s = 0.0;  // ready: the last of its robots' maps is there; arrived: what it found of them, too
    double judged_s = 0.0;   // what it judged of maps on two edges is in the cloud; 0 where it judged nothing
  };
  struct Push {
    RobotId robot;
    double arrived_s = 0.0;
  };
  Mode mode = Mode::offload;
  std::vector<RobotTimes> robots;
  std::vector<EdgeTimes> edges;
  double total_s = 0.0;  // t_c
  std::vector<Push> pushes;
  double recorded_s = 0.0;  // TimelineOptions::recorded_s
  std::optional<RoundsTimeline> rounds;
};

struct TimelineOptions {
  Mode mode = Mode::offload;
  NetworkOptions network;
  ProcessorOptions processors;
  CloudEntry cloud;
  double recorded_s = 0.0;  // how long the wires have been there when the recordings end; traces begin with them
  std::uint64_t seed = 1;
};

// Robots without an edge map on board and send to the cloud, in every mode. Throws what reading a link's trace throws.
Timeline timeline(const TimelineOptions&, const Work&);

nlohmann::ordered_json timeline_json(const Timeline&, const Work&);
// What a run did, from its summary.json; `recorded_s` (may be null): TimelineOptions::recorded_s. Throws Error
// kMissing, kCorrupt or kBadInput, naming file and key.
Work read_work(const std::filesystem::path& summary, double* recorded_s);

}  // namespace mapweave::runtime
