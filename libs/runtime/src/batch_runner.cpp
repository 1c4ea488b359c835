#include "coordinated_robots.h"
#include "results.h"
#include "shared_cameras.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/runtime/batch_runner.h>
#include <mapweave/runtime/merge_requests.h>
#include <mapweave/runtime/metrics.h>
#include <mapweave/runtime/robot_task.h>
#include <mapweave/scheduling/overlap_estimate.h>
#include <mapweave/tiers/cloud_merger.h>
#include <mapweave/tiers/edge_server.h>

#include <algorithm>

namespace mapweave::runtime {
namespace {

// Bad input is somebody's to mend before half a team's map looks like a whole one; a helper that died is not.
bool ends_the_run(const RobotResult& robot, bool keep_going) {
  const auto& trouble = robot.outcome.trouble;
  return trouble && !keep_going && trouble->code() != ErrorCode::kHelperFailed;
}

// Every robot of the plan, nullopt for those that were interrupted. Throws the first trouble, unless it is to be lived
// with.
std::vector<std::optional<RobotResult>> map_robots(const RunConfiguration& configuration, const RunPlan& plan,
                                                   CoordinatedRobots* coordinated, bool keep_going, WorkerPool& pool,
                                                   Progress& progress) {
  std::atomic<bool> give_up{false};
  std::map<RobotId, CamerasOutcome> shared;
  std::map<RobotId, LaserOutcome> lasers;
  try {
    if (coordinated != nullptr) lasers = coordinated->map_lasers(keep_going, pool, progress);
    if (configuration.server.share != tiers::Sharing::none)
      shared = map_shared_cameras(configuration, plan, keep_going, pool, progress);
  } catch (const Interrupted&) {
    return std::vector<std::optional<RobotResult>>(plan.robots.size());
  }
  auto robots = pool.map(plan.robots.size(), [&](std::size_t i) -> std::optional<RobotResult> {
    try {
      const auto cameras = shared.find(plan.robots[i].id);
      const auto laser = lasers.find(plan.robots[i].id);
      RobotResult result =
          map_robot(plan.robots[i], configuration, keep_going, give_up, progress,
                    laser != lasers.end() ? std::optional(std::move(laser->second)) : std::nullopt,
                    cameras != shared.end() ? std::optional(std::move(cameras->second)) : std::nullopt);
      if (ends_the_run(result, keep_going)) give_up = true;
      return result;
    } catch (const Interrupted&) {
      return std::nullopt;
    }
  });
  for (const auto& robot : robots)
    if (robot && ends_the_run(*robot, keep_going)) throw *robot->outcome.trouble;
  return robots;
}

// Runs what an interruption may end; false when it did.
template <class Work>
bool finished(Work&& work) {
  try {
    throw_if_interrupted();
    work();
    return true;
  } catch (const Interrupted&) {
    return false;
  }
}

// What was finished is to be saved in peace: a further signal ends that too.
void acknowledge_interruption(Report& report, bool anything_finished) {
  report.interrupted = true;
  if (!anything_finished) throw Interrupted("interrupted before a map was finished; nothing was written");
  clear_interrupt();
}

// The one that holds what the robot mapped; null where it left no map.
const fusion::Component* component_of(const fusion::FusionResult& team, const RobotId& robot) {
  for (const fusion::Component& component : team.components)
    if (std::find(component.members.begin(), component.members.end(), MapId(robot.str())) != component.members.end())
      return &component;
  return nullptr;
}

// What robots get of the team's maps: the one that they are in.
void push(const fusion::FusionResult& team, const CloudEntry& cloud, Work& work) {
  for (const std::string& name : cloud.push_to)
    if (const auto* component = component_of(team, RobotId(name)))
      work.pushes.push_back({RobotId(name), tiers::first_update(component->map, cloud_tier()).size()});
}

// Of robots with lasers, by how the team's maps lie.
std::vector<OverlapOfRobots> overlaps_of(const fusion::FusionResult& team,
                                         const std::vector<tiers::RobotOutcome>& outcomes) {
  std::vector<OverlapOfRobots> overlaps;
  for (const fusion::Component& component : team.components) {
    struct Member {
      RobotId robot;
      Pose2 team_from_map;
      MapSummary summary;
    };
    std::vector<Member> members;
    for (const tiers::RobotOutcome& outcome : outcomes)
      if (const Pose3* there = outcome.map ? component.team_from_map.find(outcome.map->id) : nullptr)
        members.push_back({outcome.robot, planar(*there), scheduling::summary_of(*outcome.map)});
    for (auto a = members.begin(); a != members.end(); ++a)
      for (auto b = std::next(a); b != members.end(); ++b)
        if (const double degree =
                scheduling::overlap_degree(a->summary, b->summary, between(a->team_from_map, b->team_from_map));
            degree > 0.0)
          overlaps.push_back({a->robot, b->robot, degree});
  }
  return overlaps;
}

void add(Results& results, const std::string& folder, const std::string& title, bool dense, const Map& map,
         const CamerasOutcome& cameras) {
  const bool by_laser = cameras.maps.empty() || !map.submaps.empty();
  if (by_laser) results.add_map(folder, title, map);
  if (cameras.maps.empty()) return;
  results.add_cameras(by_laser ? (std::filesystem::path(folder) / "cameras").string() : folder, title,
                      dense && !by_laser, cameras);
  if (dense && by_laser) results.add_dense(folder, title, map, cameras);
}

}  // namespace

Report run_batch(const RunConfiguration& configuration, const RunPlan& given, const RunSettings& settings,
                 WorkerPool& pool, Progress& progress) {
  Results results(settings.out, settings.force, configuration, pool, progress);
  Report report;
  report.team.tier = cloud_tier();
  RunPlan plan = given;
  std::optional<CoordinatedRobots> coordinated;
  if (configuration.coordinator.method != Coordination::none) coordinated.emplace(configuration, plan);
  auto robots =
      map_robots(configuration, plan, coordinated ? &*coordinated : nullptr, settings.keep_going, pool, progress);
  if (coordinated) report.coordination = coordinated->take_report();

  bool anything = false, whole = true;
  for (const auto& robot : robots) {
    whole = whole && robot.has_value();
    anything = anything || (robot && robot->outcome.map);
  }
  if (!whole) acknowledge_interruption(report, anything);
  for (const auto& robot : robots)
    if (!anything && robot && robot->outcome.trouble && !settings.keep_going)
      throw *robot->outcome.trouble;  // every helper died

  std::vector<InputFile> inputs;
  std::vector<tiers::RobotOutcome> outcomes;
  std::vector<CamerasOutcome> cameras;  // of the outcomes
  for (std::size_t i = 0; i < robots.size(); ++i) {
    if (!robots[i]) continue;
    report.robots.push_back(robots[i]->report);
    report.stages.push_back(
        {plan.robots[i].edge, "mapping " + plan.robots[i].id.str(), robots[i]->report.wall_seconds});
    if (robots[i]->input) inputs.push_back(*robots[i]->input);
    outcomes.push_back(std::move(robots[i]->outcome));
    report.work.robots.push_back(robots[i]->work);
    cameras.push_back(std::move(robots[i]->cameras));
  }

  // Edges, where they join, fuse what their robots left and send it to the cloud, which fuses everything again.
  std::vector<tiers::EdgeServer> edges;
  tiers::CloudMerger cloud(cloud_tier(), configuration.fusion);
  std::vector<StartedMap> started;
  for (const tiers::RobotOutcome& outcome : outcomes)
    if (outcome.map) started.push_back({&*outcome.map, robot_entry(configuration, outcome.robot).start});
  const std::vector<fusion::MapPrior> priors = priors_of_starts(started);
  cloud.set_priors(priors);
  if (const auto alone = start_alone(started)) report.notes.push_back(*alone);
  fusion::FusionResult team;
  const auto fuse_at_edges = [&] {
    for (const TierId& id : plan.edges) {
      const double before_s = process_cpu_seconds();
      EdgeWork work{id};
      work.speed = edge_entry(configuration, id).speed;
      double receiving_s = 0.0;  // is the cloud's work
      std::vector<RobotId> members;
      for (const PlannedRobot& robot : plan.robots)
        if (robot.edge == id) members.push_back(robot.id);
      if (members.empty()) continue;  // the coordinator gave it none
      tiers::EdgeServer edge(id, members, configuration.fusion);
      edge.set_priors(priors);
      for (tiers::RobotOutcome& outcome : outcomes) {
        if (std::find(members.begin(), members.end(), outcome.robot) == members.end()) continue;
        const auto effects = edge.step(outcome, pool, progress);
        for (RobotWork& robot : report.work.robots)
          if (robot.id == outcome.robot) robot.map_bytes = effects.map_bytes;
        const double received_s = process_cpu_seconds();
        for (const std::string& update : effects.for_cloud) {
          cloud.receive(update, "update of edge " + id.str());
          work.bytes += update.size();
        }
        receiving_s += process_cpu_seconds() - received_s;
      }
      edges.push_back(std::move(edge));
      work.fusing_s = process_cpu_seconds() - before_s - receiving_s;
      report.work.fusing_s += receiving_s;
      report.work.edges.push_back(work);
    }
  };
  // What lies on two edges they compare for the cloud, which joins with what they say.
  const auto judge_at_edges = [&] {
    std::set<TierId> names;
    for (const tiers::EdgeServer& edge : edges) names.insert(edge.id());
    double before_s = process_cpu_seconds();
    const auto judging_tasks = cloud.judging_tasks(names, pool);
    report.work.fusing_s += process_cpu_seconds() - before_s;
    report.work.planning_s = report.work.fusing_s;
    for (std::size_t i = 0; i < edges.size(); ++i) {
      const auto judging_task = judging_tasks.find(edges[i].id());
      if (judging_task == judging_tasks.end()) continue;
      EdgeWork& work = report.work.edges[i];
      for (const std::string& update : judging_task->second.updates) work.sent_bytes += update.size();
      before_s = process_cpu_seconds();
      const auto effects = edges[i].step(judging_task->second, pool, progress);
      const double received_s = process_cpu_seconds();
      work.judging_s = received_s - before_s;
      for (const std::string& update : effects.for_cloud) {
        cloud.receive(update, "update of edge " + edges[i].id().str());
        work.judged_bytes += update.size();
      }
      report.work.fusing_s += process_cpu_seconds() - received_s;
    }
  };
  // Who has no edge sends to the cloud; in mode cloud-only that is everyone.
  const auto send_to_cloud = [&] {
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
      if (configuration.mode != Mode::cloud_only && !report.work.robots[i].edge.empty()) continue;
      const auto send_map = [&](const Map& map) {
        const std::string update = tiers::first_update(map, TierId(outcomes[i].robot.str()));
        cloud.receive(update, "update of robot " + outcomes[i].robot.str());
        report.work.robots[i].map_bytes += update.size();
      };
      if (outcomes[i].map) send_map(*outcomes[i].map);
      for (const Map& map : outcomes[i].apart) send_map(map);
    }
  };
  const auto fuse_all = [&] {
    if (configuration.mode != Mode::cloud_only) fuse_at_edges();
    send_to_cloud();
    if (configuration.cloud.edges_judge) judge_at_edges();
    const double before_s = process_cpu_seconds();
    if (anything) team = cloud.seal(pool, progress);
    report.work.fusing_s += process_cpu_seconds() - before_s;
    for (RobotWork& robot : report.work.robots) {
      const auto line = std::find_if(report.robots.begin(), report.robots.end(),
                                     [&](const RobotReport& r) { return r.id == robot.id; });
      if (line->cameras.empty()) continue;
      std::uint64_t published = 0;  // what clients published while they mapped; else their maps, at the end
      for (const CameraReport& camera : line->cameras) published += camera.sent_bytes;
      robot.sensed_bytes += published > 0 ? published : robot.map_bytes;
    }
    push(team, configuration.cloud, report.work);
    if (report.coordination && !report.coordination->decisions.empty())
      for (const auto& [a, b, degree] : report.coordination->decisions.back().overlaps)
        report.work.overlaps.push_back({a, b, degree});
    else
      report.work.overlaps = overlaps_of(team, outcomes);
    report.timeline = timeline({configuration.mode, plan.network, configuration.processors, configuration.cloud,
                                report.coordination ? report.coordination->recorded_s : 0.0, configuration.seed},
                               report.work);
  };
  if (whole && !finished(fuse_all)) acknowledge_interruption(report, anything);

  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    if (!outcomes[i].map) continue;
    const std::string name = outcomes[i].robot.str();
    add(results, "robots/" + name, "robot " + name, false, *outcomes[i].map, cameras[i]);
  }
  std::vector<const Map*> own_maps;
  for (const tiers::RobotOutcome& outcome : outcomes) {
    if (outcome.map) own_maps.push_back(&*outcome.map);
    for (const Map& map : outcome.apart) own_maps.push_back(&map);
  }
  results.set_own_maps(own_maps);
  results.set_requests(kept_requests(priors, configuration.fusion));
  for (const tiers::EdgeServer& edge : edges) {
    report.edges.push_back(Results::report_of(edge.id(), edge.result()));
    const std::string name = edge.id().str();
    results.add_components(edge.id(), "edges/" + name, "edges/" + name + "/apart-", "edge " + name, false,
                           edge.result(), cameras, report);
  }
  report.team = Results::report_of(cloud_tier(), team);
  results.add_components(cloud_tier(), "team", "team-", "team", true, team, cameras, report);
  results.set_own_maps({});
  for (const PushWork& pushed : report.work.pushes) {
    const std::string name = pushed.robot.str();
    fusion::FusionResult pushed_map;
    pushed_map.components = {*component_of(team, pushed.robot)};
    results.add_components(TierId(name), "robots/" + name + "/team", "", "team, as robot " + name + " received it",
                           false, pushed_map, cameras, report);
  }
  results.commit("run", effective(configuration, given), inputs, report);
  return report;
}

Report run_slam(const RunConfiguration& configuration, const RunPlan& plan, const RunSettings& settings,
                WorkerPool& pool, Progress& progress) {
  MAPWEAVE_EXPECT(plan.robots.size() == 1, "slam maps one robot");
  Results results(settings.out, settings.force, configuration, pool, progress);
  Report report;
  const auto robots = map_robots(configuration, plan, nullptr, settings.keep_going, pool, progress);
  if (!robots.front()) acknowledge_interruption(report, false);
  const RobotResult& robot = *robots.front();
  report.robots = {robot.report};
  report.robots.front().edge = TierId();
  report.stages.push_back({TierId(), "mapping", robot.report.wall_seconds});
  if (robot.outcome.map) {
    report.team.components = {{robot.outcome.map->id}};
    for (const Map& map : robot.outcome.apart) report.team.components.push_back({map.id});
    add(results, "", "robot " + robot.report.id.str(), true, *robot.outcome.map, robot.cameras);
  } else if (robot.outcome.trouble) {
    throw *robot.outcome.trouble;
  }
  std::vector<InputFile> inputs;
  if (robot.input) inputs.push_back(*robot.input);
  results.commit("slam", effective(configuration, plan), inputs, report);
  return report;
}

}  // namespace mapweave::runtime
