#pragma once
// What a run, a slam or a merge reports: for people, and as summary.json and merges.json (the contract of the command
// line).

#include <mapweave/core/exit_code.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/maps/judgement.h>
#include <mapweave/rig/fused_pose.h>
#include <mapweave/runtime/team_frame.h>
#include <mapweave/runtime/timeline.h>
#include <mapweave/tiers/coordinator.h>

#include <nlohmann/json_fwd.hpp>

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::runtime {

struct CameraReport {
  std::string label, kind;                          // for example "RGBD" and "rgbd"
  std::uint64_t frames = 0, tracked = 0, lost = 0;  // tracked: placed in the map; lost: not placed, after a tracked one
  std::uint64_t keyframes = 0, landmarks = 0, sessions = 0;
  struct Loop {
    double found_s, applied_s;  // data time since the first frame
  };
  std::vector<Loop> loops;
  double longest_loss_s = 0.0;
  std::uint64_t sent_bytes = 0, received_bytes = 0;  // bytes to and from the edge's camera map server
  struct Traffic {
    std::uint64_t second = 0;  // data time since the first frame of all cameras of the run
    std::uint64_t sent_bytes = 0, received_bytes = 0;
  };
  std::vector<Traffic> traffic;  // sent and received bytes by second, without empty seconds
  std::uint64_t passed_on_bytes =
      0;                       // bytes of its updates that its edge sent on to the cloud, and the cloud to other edges
  std::uint64_t borrowed = 0;  // most landmarks of other clients that one keyframe saw
  std::uint64_t forgotten = 0, kept = 0;  // keyframes without room; of those, kept by the server
  // Keyframes of others that it kept at most, and that it dropped for want of room; what it did by them itself.
  std::uint64_t shared_keyframes = 0, dropped_shared = 0, found_by_shared = 0, loops_on_shared = 0;
  // Of processor time. Frames that became keyframes hold tracking and mapping, others tracking alone; packing: decoding
  // and rectifying.
  double tracking_mean_ms = 0.0, tracking_p99_ms = 0.0, keyframe_mean_ms = 0.0, packing_mean_ms = 0.0;
  double readout_s = 0.0, inverse_depth_offset = 0.0;  // sensor parameters as estimated
};

// Several cameras in one map.
struct RigReport {
  std::vector<std::string> cameras;  // empty for a single camera
  std::uint64_t constraints = 0;
  double apart_before_m = 0.0, apart_after_m = 0.0;  // root mean square error of the constraints
  bool optimised = false;                            // maps differed by more than the threshold
};

using PoseReport = rig::FusedPoseReport;

struct RobotReport {
  RobotId id;
  TierId edge;  // empty for slam
  std::uint64_t scans = 0;
  std::vector<CameraReport> cameras;  // by label; empty where only the laser maps
  RigReport rig;                      // about its main map
  std::optional<PoseReport> pose;     // the robot's pose while it drove: robot.tum
  double log_seconds = 0.0;           // length of the log in data time
  double wall_seconds = 0.0;          // time from opening the log to the finished map
  double cpu_seconds = 0.0;           // processor time, with that of the helper process
  bool mapped = false;
  bool is_cut_short = false;     // cut short by an interruption: the map shows what came before
  std::optional<Error> trouble;  // why the stream ended early
  double real_time_factor() const { return wall_seconds > 0.0 ? log_seconds / wall_seconds : 0.0; }
};

// How maps merged at one tier.
struct FusionReport {
  TierId tier;
  std::vector<std::vector<MapId>> components;       // members, largest component first
  std::vector<TeamFrame> frames;                    // frame of each component; empty for slam
  std::vector<Table<MapId, Pose3>> team_from_maps;  // by component: poses of its members' map frames
  std::vector<Verdict> verdicts;
  std::vector<fusion::PairAudit> audits;
};

struct StageReport {
  TierId tier;
  std::string name;
  double seconds = 0.0;
};

// What the coordinator of a run decided.
struct CoordinationReport {
  std::string method, at;  // for example "default" at "cloud"
  std::vector<tiers::CoordinatorDecision> decisions;
  std::uint64_t summary_bytes = 0;  // size of the summaries of maps that it received
  double summary_s = 0.0;           // sum over decisions: arrival time of the slowest robot's summary
  double cpu_seconds = 0.0;
  double recorded_s = 0.0;  // data time until the last log ended
};

// Of rounds while robots drove; each round is in Work::rounds once the run has it.
struct RoundsReport {
  std::vector<RoundWork> rounds;
  std::map<std::size_t, Map> pictures;  // joint maps to be drawn, by round
  double recorded_s = 0.0;              // data time until the last log ended
  double cpu_seconds = 0.0;             // processor time of all rounds
};

struct Report {
  std::vector<RobotReport> robots;  // sorted by id
  std::vector<FusionReport> edges;  // sorted by id
  FusionReport team;
  std::vector<StageReport> stages;
  Work work;                         // only of run
  std::optional<Timeline> timeline;  // only of run, unless it was interrupted
  std::optional<CoordinationReport> coordination;
  std::optional<RoundsReport> rounds;
  std::vector<std::string> notes;  // for people: maps renamed, maps too large to draw
  std::string saved_at;            // where, if not where it was to be: it was interrupted, and an older result is there
  std::string picture;             // the one to look at first, within the folder; may be empty
  bool interrupted = false;
  double wall_seconds = 0.0;
  std::uint64_t peak_rss_bytes = 0;

  // 0, 4 where maps stayed apart, the code of the first robot's trouble, 130 (README, verbs).
  ExitCode exit_code() const;
};

nlohmann::ordered_json summary_json(const Report&);
nlohmann::ordered_json merges_json(const Report&);
// A verdict in one line: "alpha + beta: merged (probability 0.99, overlap 41 %, conflict 0.2 %, 3 places agree)", "...:
// kept apart: one saw through walls of the other (...)", "...: in one map, through gamma; not matched to each other by
// themselves: no place that both show was found".
std::string in_words(const Verdict&);
// What became of a prior: "the prior is contradicted: the maps lie 9.8 m and 2 degrees from where it puts them".
std::string in_words(const PriorCheck&);
// The short summary that a person reads at the end. `folder`: where the results are.
std::string in_words(const Report&, const std::string& folder);

}  // namespace mapweave::runtime
