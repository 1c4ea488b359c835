#include "live/cluster_run.h"
#include "plan/log_parts.h"
#include "plan/team_options.h"
#include "results/robot_results.h"
#include "robots/map_robots.h"
#include "robots/shared_cameras.h"
#include "team_run.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/runtime/merge_requests.h>
#include <mapweave/scheduling/overlap_estimate.h>

namespace mapweave::runtime {
namespace {

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

// The one that holds what the robot mapped; null where it left no map.
const fusion::Component* component_of(const fusion::FusionResult& team, const RobotId& robot) {
  for (const fusion::Component& component : team.components)
    if (const auto robots = component.map.robots(); std::binary_search(robots.begin(), robots.end(), robot))
      return &component;
  return nullptr;
}

// What robots get of the team's maps: the one that they are in.
void push(const fusion::FusionResult& team, const CloudEntry& cloud, Report& report) {
  for (const std::string& name : cloud.push_to) {
    if (const auto* component = component_of(team, RobotId(name)))
      report.work.pushes.push_back(
          {RobotId(name), tiers::first_update(component->map, cloud_tier()).size(), "robots/" + name + "/" + kNextRun});
    else
      report.notes.push_back("robot " + name + " left no map: it is sent no team's map");
  }
}

// By a robot's cameras: what their clients published while they mapped; else their maps, at the end.
std::uint64_t bytes_published(const RobotReport& robot, const RobotWork& work) {
  if (robot.cameras.empty()) return 0;
  std::uint64_t published = 0;
  for (const CameraReport& camera : robot.cameras) published += camera.sent_bytes;
  return published > 0 ? published : work.map_bytes;
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

// Of robots that did not come into one map: what the coordinator took them for last, before they had sensed all.
void add_estimates(const std::vector<tiers::CoordinatorDecision>& decisions, std::vector<OverlapOfRobots>& overlaps) {
  const auto last = std::find_if(decisions.rbegin(), decisions.rend(),
                                 [](const auto& decision) { return !decision.overlaps.empty(); });
  if (last == decisions.rend()) return;
  for (const auto& [a, b, degree] : last->overlaps)
    if (std::none_of(overlaps.begin(), overlaps.end(),
                     [&, &a = a, &b = b](const OverlapOfRobots& known) { return known.a == a && known.b == b; }))
      overlaps.push_back({a, b, degree});
}

tiers::RobotUpdates updates_of(const tiers::RobotOutcome& outcome) {
  tiers::RobotUpdates sent{outcome.robot, {}};
  const TierId robot(outcome.robot.str());
  if (outcome.map) sent.updates.push_back(tiers::first_update(*outcome.map, robot));
  for (const Map& map : outcome.apart) sent.updates.push_back(tiers::first_update(map, robot));
  return sent;
}

}  // namespace

TeamRun::TeamRun(const RunConfiguration& configuration, const RunPlan& plan, const RunSettings& settings,
                 WorkerPool& pool, Progress& progress)
    : configuration_(configuration),
      given_(plan),
      settings_(settings),
      pool_(pool),
      progress_(progress),
      results_(settings.out, settings.force, configuration, pool, progress),
      plan_(plan),
      starts_(read_start_maps(configuration, plan)),
      cloud_(tiers::CloudMerger(cloud_tier(), configuration.fusion)) {
  report_.notes = starts_.notes;
  inputs_ = starts_.files;
  cloud_.begin_with(starts_.maps);
  cloud_.set_vetoed(starts_.vetoed);
  frame_request();  // says now what is wrong with it
  if (settings.cluster == nullptr) return;
  expect_cluster(configuration, plan);
  results_.set_dense_maker([this](const std::vector<DenseRequest>& requests) {
    return draw_on_cluster(configuration_, requests, inputs_, *settings_.cluster, progress_);
  });
}

Report TeamRun::run() {
  const bool is_whole = map();
  const auto fuse = [this] {
    fuse_on_edges();
    judge_on_edges();
    finalize();
  };
  if (is_whole && !finished(fuse)) acknowledge_interruption(report_, is_any_mapped());
  write();
  return std::move(report_);
}

void TeamRun::take_robots(std::vector<std::optional<RobotResult>> robots) {
  take(std::move(robots));
  take_requests();
}

Report TeamRun::conclude(fusion::FusionResult team, const std::vector<std::string>& notes) {
  report_.notes.insert(report_.notes.end(), notes.begin(), notes.end());
  team_ = std::move(team);
  fuse_on_edges();
  look_back();
  write();
  return std::move(report_);
}

// False: an interruption left robots without maps.
bool TeamRun::map() {
  std::optional<CoordinatedRobots> coordinated;
  if (configuration_.coordinator.method) coordinated.emplace(configuration_, plan_);
  std::optional<FusionRounds> rounds;
  if (configuration_.cloud.rounds.are_on()) rounds.emplace(configuration_, plan_);
  auto robots =
      map_robots(configuration_, plan_,
                 {coordinated ? &*coordinated : nullptr, rounds ? &*rounds : nullptr, &starts_, settings_.cluster},
                 {settings_.keep_going, false}, pool_, progress_);
  if (coordinated) report_.coordination = coordinated->take_report();
  if (rounds) take(rounds->take_report());
  const bool any_forgot = std::any_of(robots.begin(), robots.end(), [](const auto& robot) {
    return robot && std::any_of(robot->report.cameras.begin(), robot->report.cameras.end(),
                                [](const CameraReport& camera) { return camera.forgotten > 0; });
  });
  if (const auto note = note_on_sharing(configuration_, plan_, any_forgot || !starts_.maps.empty()))
    report_.notes.push_back(*note);
  if (const auto note = note_on_senses(plan_)) report_.notes.push_back(*note);
  const bool is_whole = std::all_of(robots.begin(), robots.end(), [](const auto& robot) { return robot.has_value(); });
  take(std::move(robots));
  if (!is_whole) acknowledge_interruption(report_, is_any_mapped());
  for (const tiers::RobotOutcome& outcome : outcomes_)
    if (!is_any_mapped() && outcome.trouble && !settings_.keep_going) throw *outcome.trouble;  // every helper died
  take_requests();
  return is_whole;
}

void TeamRun::take(std::vector<std::optional<RobotResult>> robots) {
  for (std::size_t i = 0; i < robots.size(); ++i) {
    if (!robots[i]) continue;
    RobotResult& robot = *robots[i];
    report_.stages.push_back({plan_.robots[i].edge, "mapping " + plan_.robots[i].id.str(), robot.report.wall_seconds});
    report_.robots.push_back(std::move(robot.report));
    report_.work.robots.push_back(std::move(robot.work));
    report_.notes.insert(report_.notes.end(), robot.notes.begin(), robot.notes.end());
    if (robot.input) inputs_.push_back(*robot.input);
    outcomes_.push_back(std::move(robot.outcome));
    cameras_.push_back(std::move(robot.cameras));
    poses_.push_back(std::move(robot.pose));
  }
}

void TeamRun::take(RoundsReport rounds) {
  report_.work.rounds = std::move(rounds.rounds);
  report_.rounds = std::move(rounds);
  if (report_.work.rounds.empty())
    report_.notes.push_back(
        "there was no round: cloud.rounds fuses maps of lasers while they grow, and none drove so long; cameras' maps "
        "are merged as they grow where they share a map server (server.share)");
}

// Where robots began, and whose maps must not be matched.
void TeamRun::take_requests() {
  std::vector<StartedMap> started;
  for (const PlannedRobot& robot : plan_.robots) {
    if (robot.part && robot.part->number > 1) continue;
    for (const tiers::RobotOutcome& outcome : outcomes_)
      if (outcome.robot == robot.id && outcome.map)
        started.push_back({&*outcome.map, start_of(configuration_, requests_, robot.robot())});
  }
  priors_ = priors_of_starts(started);
  const auto of_parts = priors_of_parts(plan_, outcomes_);
  priors_.insert(priors_.end(), of_parts.begin(), of_parts.end());
  priors_.insert(priors_.end(), starts_.priors.begin(), starts_.priors.end());
  cloud_.set_priors(priors_);
  refused_ = refused_maps();
  cloud_.set_refused(refused_);
  if (const auto alone = start_alone(started)) report_.notes.push_back(*alone);
}

// All maps of the one robot with all of the other.
std::set<std::pair<MapId, MapId>> TeamRun::refused_maps() const {
  const auto maps_of = [&](const RobotId& robot) {
    std::vector<MapId> maps;
    for (const tiers::RobotOutcome& outcome : outcomes_) {
      if (outcome.robot != robot) continue;
      if (outcome.map) maps.push_back(outcome.map->id);
      for (const Map& map : outcome.apart) maps.push_back(map.id);
    }
    return maps;
  };
  std::set<std::pair<MapId, MapId>> refused = starts_.refused;
  for (const auto& [one, other] : refused_in(given_, requests_))
    for (const MapId& a : maps_of(one))
      for (const MapId& b : maps_of(other)) refused.insert(std::minmax(a, b));
  return refused;
}

FrameRequest TeamRun::frame_request() const {
  std::vector<std::string> names;
  for (const PlannedRobot& robot : plan_.robots) names.insert(names.end(), {robot.id.str(), robot.robot().str()});
  return parse_frame(configuration_.team.frame, with_names_of(starts_.given, starts_.maps, std::move(names)),
                     {ErrorCode::kBadInput, "team.frame"});
}

// The maps that it began with, then robots' own maps in the order in which robots are listed.
FrameChoice TeamRun::frame_choice() const {
  FrameChoice choice{frame_request(), starts_.given};
  for (const RobotEntry& entry : effective(configuration_, given_).robots)
    for (const tiers::RobotOutcome& outcome : outcomes_) {
      const auto planned = std::find_if(plan_.robots.begin(), plan_.robots.end(),
                                        [&](const PlannedRobot& robot) { return robot.id == outcome.robot; });
      if (planned->robot().str() != entry.id) continue;
      if (outcome.map) choice.given.push_back(given_map(*outcome.map, outcome.map->id.str()));
      for (const Map& map : outcome.apart) choice.given.push_back(given_map(map, map.id.str()));
    }
  return choice;
}

std::vector<const Map*> TeamRun::own_maps() const {
  std::vector<const Map*> maps;
  for (const Map& map : starts_.maps) maps.push_back(&map);
  for (const tiers::RobotOutcome& outcome : outcomes_) {
    if (outcome.map) maps.push_back(&*outcome.map);
    for (const Map& map : outcome.apart) maps.push_back(&map);
  }
  return maps;
}

void TeamRun::send_to_cloud(const std::vector<std::string>& updates, const std::string& from) {
  for (const std::string& update : updates) cloud_.receive(update, "update of " + from);
}

std::vector<RobotId> TeamRun::robots_of(const TierId& edge) const {
  std::vector<RobotId> members;
  for (const PlannedRobot& robot : plan_.robots)
    if (robot.edge == edge) members.push_back(robot.id);
  return members;
}

// Edges fuse what their robots left, and send it to the cloud, which fuses everything again.
void TeamRun::fuse_on_edges() {
  std::vector<tiers::EdgeServer> servers;
  for (const TierId& id : plan_.edges) {
    const std::vector<RobotId> members = robots_of(id);
    if (members.empty() || configuration_.mode == Mode::cloud_only) continue;  // the coordinator gave it none
    tiers::EdgeServer& server = servers.emplace_back(id, members, configuration_.fusion, configuration_.cloud.maps);
    server.set_priors(priors_);
    server.set_refused(refused_);
  }
  if (settings_.cluster != nullptr) judge_for_edges(servers);
  for (tiers::EdgeServer& server : servers) {
    const TierId id = server.id();
    const std::vector<RobotId> members = robots_of(id);
    MeteredEdge edge(std::move(server), edge_entry(configuration_, id).speed);
    for (std::size_t i = 0; i < outcomes_.size(); ++i) {
      if (std::find(members.begin(), members.end(), outcomes_[i].robot) == members.end()) continue;
      const auto effects = configuration_.mode == Mode::onboard ? edge.step(updates_of(outcomes_[i]), pool_, progress_)
                                                                : edge.step(outcomes_[i], pool_, progress_);
      report_.work.robots[i].map_bytes = effects.map_bytes;
      send_to_cloud(effects.for_cloud, "edge " + id.str());
      for (const std::string& merged : effects.merged) cloud_.receive_merged(merged, "edge " + id.str());
    }
    edges_.push_back(std::move(edge));
  }
  send_maps_of_robots();
}

// What each edge begins with, answered by workers.
void TeamRun::judge_for_edges(std::vector<tiers::EdgeServer>& servers) {
  std::vector<tiers::JudgingWork> work;
  for (const tiers::EdgeServer& server : servers) {
    const std::vector<RobotId> members = robots_of(server.id());
    std::vector<const Map*> maps;
    for (const tiers::RobotOutcome& outcome : outcomes_) {
      if (std::find(members.begin(), members.end(), outcome.robot) == members.end()) continue;
      if (outcome.map) maps.push_back(&*outcome.map);
      for (const Map& map : outcome.apart) maps.push_back(&map);
    }
    work.push_back(server.first_work(maps, pool_));
  }
  const auto judgements = judge_on_cluster(configuration_, work, *settings_.cluster, pool_, progress_);
  for (std::size_t i = 0; i < servers.size(); ++i) servers[i].know(judgements[i]);
}

// Of those without an edge; in mode cloud-only that is everyone.
void TeamRun::send_maps_of_robots() {
  for (std::size_t i = 0; i < outcomes_.size(); ++i) {
    if (configuration_.mode != Mode::cloud_only && !report_.work.robots[i].edge.empty()) continue;
    const std::string name = outcomes_[i].robot.str();
    const std::vector<std::string> updates = updates_of(outcomes_[i]).updates;
    send_to_cloud(updates, "robot " + name);
    report_.work.robots[i].map_bytes += bytes_of(updates);
  }
}

// Maps that lie on two edges are compared there, for the cloud; or by workers, as what else the cloud begins with.
void TeamRun::judge_on_edges() {
  std::set<TierId> names;
  for (const MeteredEdge& edge : edges_) names.insert(edge.id());
  std::map<TierId, tiers::JudgingTask> tasks;
  if (configuration_.cloud.edges_judge) tasks = cloud_.judging_tasks(names, pool_);
  std::map<TierId, std::vector<Judgement>> judgements;
  if (settings_.cluster != nullptr) judgements = judge_on_workers(tasks);
  for (MeteredEdge& edge : edges_) {
    const auto task = tasks.find(edge.id());
    if (task == tasks.end()) continue;
    const auto judged = judgements.find(edge.id());
    send_to_cloud((judged != judgements.end() ? edge.step(task->second, judged->second)
                                              : edge.step(task->second, pool_, progress_))
                      .for_cloud,
                  "edge " + edge.id().str());
  }
}

std::map<TierId, std::vector<Judgement>> TeamRun::judge_on_workers(const std::map<TierId, tiers::JudgingTask>& tasks) {
  std::vector<tiers::JudgingWork> work;
  std::set<TierId> names;
  for (const MeteredEdge& edge : edges_) {
    names.insert(edge.id());
    if (const auto task = tasks.find(edge.id()); task != tasks.end()) work.push_back(edge.edge().work_of(task->second));
  }
  // With edges that judge nothing, all of it is the cloud's.
  work.push_back(cloud_.first_work(configuration_.cloud.edges_judge ? names : std::set<TierId>(), pool_));
  const auto judgements = judge_on_cluster(configuration_, work, *settings_.cluster, pool_, progress_);
  cloud_.know(judgements.back());
  std::map<TierId, std::vector<Judgement>> of_edges;
  std::size_t number = 0;
  for (const auto& [edge, task] : tasks) of_edges[edge] = judgements[number++];
  return of_edges;
}

// What an edge merged and the cloud takes apart is merged anew, from the whole maps.
void TeamRun::merge_in_cloud() {
  const auto ask = [this](const TierId& id, const std::vector<MapId>& maps) {
    for (MeteredEdge& edge : edges_)
      if (edge.id() == id) send_to_cloud(edge.whole_maps(maps).for_cloud, "edge " + id.str());
  };
  team_ = tiers::seal_by_whole_maps(cloud_, ask, pool_, progress_);
  for (const std::string& note : cloud_.notes(team_)) report_.notes.push_back(note);
}

void TeamRun::finalize() {
  if (is_any_mapped()) merge_in_cloud();
  look_back();
}

// Frames, and what was done.
void TeamRun::look_back() {
  frames_ = choose_frames(frame_choice(), own_maps(), team_);
  report_work();
  const double recorded_s = report_.coordination ? report_.coordination->recorded_s
                            : report_.rounds     ? report_.rounds->recorded_s
                                                 : 0.0;
  report_.timeline = timeline({configuration_.mode, plan_.network, configuration_.processors, configuration_.cloud,
                               recorded_s, configuration_.seed},
                              report_.work);
  if (!report_.timeline->rounds) return;
  for (const std::string& note : notes_of(*report_.timeline->rounds)) report_.notes.push_back(note);
}

void TeamRun::report_work() {
  Work& work = report_.work;
  for (const MeteredEdge& edge : edges_) work.edges.push_back(edge.work());
  work.fusing_s = cloud_.fusing_s();
  work.planning_s = cloud_.planning_s();
  for (std::size_t i = 0; i < work.robots.size(); ++i)
    work.robots[i].sensed_bytes += bytes_published(report_.robots[i], work.robots[i]);
  push(team_, configuration_.cloud, report_);
  work.overlaps = overlaps_of(team_, outcomes_);
  if (report_.coordination) add_estimates(report_.coordination->decisions, work.overlaps);
}

void TeamRun::write() {
  for (std::size_t i = 0; i < outcomes_.size(); ++i) {
    const std::string name = outcomes_[i].robot.str();
    if (!outcomes_[i].map) continue;
    add_robot(results_, "robots/" + name, "robot " + name, MapOf::robot, *outcomes_[i].map, cameras_[i]);
    results_.add_pose("robots/" + name, poses_[i]);
  }
  results_.set_own_maps(own_maps());
  results_.set_cut_short(starts_.cut_short);
  KeptRequests requests = kept_requests(priors_, configuration_.fusion);
  requests.refused = refused_;
  requests.vetoed = vetoes_of(starts_.vetoed, own_maps(), team_);
  results_.set_requests(std::move(requests));
  write_edges();
  write_team();
  if (report_.rounds) results_.add_rounds(report_);
  results_.commit("run", effective(configuration_, given_), inputs_, report_);
}

void TeamRun::write_edges() {
  for (const MeteredEdge& edge : edges_) {
    const std::string name = edge.id().str();
    fusion::FusionResult fused = edge.result();
    const std::vector<TeamFrame> frames = choose_frames(frame_choice(), own_maps(), fused);
    report_.edges.push_back(Results::report_of(edge.id(), fused, frames));
    results_.add_components(
        {edge.id(), "edges/" + name, "edges/" + name + "/apart-", "edge " + name, frames, MapOf::edge}, fused, cameras_,
        report_);
  }
}

void TeamRun::write_team() {
  report_.team = Results::report_of(cloud_tier(), team_, frames_);
  results_.add_components(team_place(frames_), team_, cameras_, report_);
  results_.set_own_maps({});
  for (const PushWork& pushed : report_.work.pushes) {
    const std::string name = pushed.robot.str();
    fusion::FusionResult pushed_map;
    const fusion::Component* component = component_of(team_, pushed.robot);
    pushed_map.components = {*component};
    const TeamFrame& frame = frames_[static_cast<std::size_t>(component - team_.components.data())];
    results_.add_components({TierId(name),
                             "robots/" + name + "/team",
                             "",
                             "team, as robot " + name + " received it",
                             {frame},
                             MapOf::pushed},
                            pushed_map, cameras_, report_);
    results_.add_file(pushed.next_run, next_run_text(pushed.robot));
  }
}

Report run_batch(const RunConfiguration& configuration, const RunPlan& plan, const RunSettings& settings,
                 WorkerPool& pool, Progress& progress) {
  return TeamRun(configuration, plan, settings, pool, progress).run();
}

}  // namespace mapweave::runtime
