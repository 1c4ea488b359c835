#pragma once
// A team's run, from its robots to the folder of results: all in one process (batch_runner.cpp), or the end of a run
// whose robots and edges were programs of their own (live/live_cloud.cpp).

#include "given_maps.h"
#include "metered_tiers.h"
#include "plan/start_maps.h"
#include "results/results.h"

#include <mapweave/runtime/batch_runner.h>
#include <mapweave/runtime/live_requests.h>
#include <mapweave/runtime/robot_task.h>

#include <algorithm>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace mapweave::runtime {

// Each step leaves what the next one takes, in the order of the robots' names. Not thread-safe.
class TeamRun {
 public:
  TeamRun(const RunConfiguration& configuration, const RunPlan& plan, const RunSettings& settings, WorkerPool& pool,
          Progress& progress);

  // All of it.
  Report run();

  // Where others mapped and merged, step by step: every robot of the plan; what edges send to the cloud, which seals;
  // then the folder. What the edges merged is made once more, from the robots' maps, to be drawn.
  void take_robots(std::vector<std::optional<RobotResult>> robots);
  // Before that, where a coordinator has given robots to other edges than the configuration.
  void place(const RunPlan& plan) { plan_ = plan; }
  void set_requests(LiveRequests requests) { requests_ = std::move(requests); }
  MeteredCloud& cloud() { return cloud_; }
  Report conclude(fusion::FusionResult team, const std::vector<std::string>& notes);

 private:
  bool map();
  void fuse_on_edges();
  void judge_for_edges(std::vector<tiers::EdgeServer>& servers);
  void judge_on_edges();
  std::map<TierId, std::vector<Judgement>> judge_on_workers(const std::map<TierId, tiers::JudgingTask>& tasks);
  void merge_in_cloud();
  void finalize();
  void look_back();
  void write();

  bool is_any_mapped() const {
    return std::any_of(outcomes_.begin(), outcomes_.end(), [](const auto& outcome) { return outcome.map.has_value(); });
  }
  std::vector<RobotId> robots_of(const TierId& edge) const;
  void take(std::vector<std::optional<RobotResult>> robots);
  void take(RoundsReport rounds);
  void take_requests();
  FrameRequest frame_request() const;
  std::set<std::pair<MapId, MapId>> refused_maps() const;
  FrameChoice frame_choice() const;
  std::vector<const Map*> own_maps() const;
  void send_to_cloud(const std::vector<std::string>& updates, const std::string& from);
  void send_maps_of_robots();
  void report_work();
  void write_edges();
  void write_team();

  const RunConfiguration& configuration_;
  const RunPlan& given_;
  const RunSettings& settings_;
  WorkerPool& pool_;
  Progress& progress_;
  Results results_;
  RunPlan plan_;  // with the edges that a coordinator chose
  StartMaps starts_;
  LiveRequests requests_;
  Report report_;
  std::vector<InputFile> inputs_;
  std::vector<tiers::RobotOutcome> outcomes_;
  std::vector<CamerasOutcome> cameras_;  // of the outcomes
  std::vector<rig::FusedTrajectory> poses_;
  std::vector<fusion::MapPrior> priors_;
  std::set<std::pair<MapId, MapId>> refused_;
  std::vector<MeteredEdge> edges_;
  MeteredCloud cloud_;
  fusion::FusionResult team_;
  std::vector<TeamFrame> frames_;  // of its components
};

}  // namespace mapweave::runtime
