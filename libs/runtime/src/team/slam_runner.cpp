#include "plan/start_maps.h"
#include "results/robot_results.h"
#include "robots/map_robots.h"

#include <mapweave/core/format.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/runtime/batch_runner.h>

#include <algorithm>

namespace mapweave::runtime {
namespace {

// One robot's run: its own map, and where it begins with maps of sessions before, that map joined to them.
class SlamRun {
 public:
  SlamRun(const RunConfiguration& configuration, const RunPlan& plan, const RunSettings& settings, WorkerPool& pool,
          Progress& progress)
      : configuration_(configuration),
        given_(plan),
        settings_(settings),
        pool_(pool),
        progress_(progress),
        results_(settings.out, settings.force, configuration, pool, progress),
        starts_(read_start_maps(configuration, plan)) {
    report_.notes = starts_.notes;
    inputs_ = starts_.files;
    if (!starts_.maps.empty()) frame_request();  // says now what is wrong with it
  }

  Report run() {
    map();
    if (!robot_.outcome.map && robot_.outcome.trouble) throw *robot_.outcome.trouble;
    if (robot_.outcome.map) {
      if (!starts_.maps.empty()) join();
      write();
    }
    results_.commit("slam", effective(configuration_, given_), inputs_, report_);
    return std::move(report_);
  }

 private:
  void map();
  void join();
  void write();
  void write_joined();
  FrameRequest frame_request() const;
  std::vector<const Map*> own_maps() const;
  bool is_own(const MapId& map) const {
    return std::none_of(starts_.maps.begin(), starts_.maps.end(), [&](const Map& start) { return start.id == map; });
  }
  // Place of the component that its main map is in.
  std::size_t main_component() const;
  bool is_joined() const {
    if (team_.components.empty()) return false;
    const std::vector<MapId>& members = team_.components[main_component()].members;
    return std::any_of(members.begin(), members.end(), [&](const MapId& map) { return !is_own(map); });
  }

  const RunConfiguration& configuration_;
  const RunPlan& given_;
  const RunSettings& settings_;
  WorkerPool& pool_;
  Progress& progress_;
  Results results_;
  StartMaps starts_;
  Report report_;
  std::vector<InputFile> inputs_;
  RobotResult robot_;
  fusion::FusionResult team_;  // with the maps that it began with
  std::vector<TeamFrame> frames_;
};

void SlamRun::map() {
  RunPlan plan = given_;
  auto robots =
      map_robots(configuration_, plan, {nullptr, nullptr, &starts_}, {settings_.keep_going, true}, pool_, progress_);
  if (!robots.front()) acknowledge_interruption(report_, false);
  robot_ = std::move(*robots.front());
  const RobotReport& mapped = robot_.report;
  if (mapped.is_cut_short && !robot_.outcome.map) acknowledge_interruption(report_, false);
  report_.robots = {mapped};
  report_.robots.front().edge = TierId();
  report_.notes.insert(report_.notes.end(), robot_.notes.begin(), robot_.notes.end());
  if (mapped.is_cut_short) {
    report_.interrupted = true;
    report_.notes.push_back(
        format("robot %s: its log is cut short by an interruption after %.1f s; the map shows what came before",
               mapped.id.str().c_str(), mapped.log_seconds));
    const std::string where = format("after %.1f s of the log", mapped.log_seconds);
    if (starts_.maps.empty())
      results_.set_cut_short(where);
    else
      starts_.cut_short[robot_.outcome.map->id] = where;
  }
  report_.stages.push_back({TierId(), "mapping", mapped.wall_seconds});
  if (robot_.input) inputs_.push_back(*robot_.input);
  if (!robot_.outcome.map) return;
  report_.team.components = {{robot_.outcome.map->id}};
  for (const Map& map : robot_.outcome.apart) report_.team.components.push_back({map.id});
}

FrameRequest SlamRun::frame_request() const {
  return parse_frame(configuration_.team.frame,
                     with_names_of(starts_.given, starts_.maps, {given_.robots.front().id.str()}),
                     {ErrorCode::kBadInput, "team.frame"});
}

std::vector<const Map*> SlamRun::own_maps() const {
  std::vector<const Map*> maps;
  for (const Map& map : starts_.maps) maps.push_back(&map);
  maps.push_back(&*robot_.outcome.map);
  for (const Map& map : robot_.outcome.apart) maps.push_back(&map);
  return maps;
}

std::size_t SlamRun::main_component() const {
  for (std::size_t i = 0; i < team_.components.size(); ++i) {
    const std::vector<MapId>& members = team_.components[i].members;
    if (std::binary_search(members.begin(), members.end(), robot_.outcome.map->id)) return i;
  }
  MAPWEAVE_EXPECT(false, "every map that was fused is in a component");
  return 0;
}

void SlamRun::join() {
  const std::string& name = robot_.report.id.str();
  fusion::FusionInput input;
  input.by = TierId(name);
  for (const Map* map : own_maps()) input.maps.push_back(*map);
  input.priors = starts_.priors;
  input.refused = starts_.refused;
  input.vetoed = starts_.vetoed;
  try {
    fusion::Memo memo;
    team_ = fusion::fuse(input, configuration_.fusion, memo, pool_, progress_);
  } catch (const Interrupted&) {
    acknowledge_interruption(report_, true);
    report_.notes.push_back("interrupted while the map of " + name +
                            " was compared with the maps that the run began with: it has its own frame");
    return;
  }
  FrameChoice choice{frame_request(), starts_.given};
  choice.given.push_back(given_map(*robot_.outcome.map, name));
  for (const Map& map : robot_.outcome.apart) choice.given.push_back(given_map(map, map.id.str()));
  frames_ = choose_frames(choice, own_maps(), team_);
  report_.team = Results::report_of(input.by, team_, frames_);
  if (!is_joined())
    report_.notes.push_back("the map of " + name +
                            " stayed apart from the maps that the run began with: it has its own frame");
}

void SlamRun::write() {
  const std::string& name = robot_.report.id.str();
  if (!starts_.maps.empty()) results_.set_cut_short(starts_.cut_short);
  if (!is_joined()) {
    add_robot(results_, "", "robot " + name, MapOf::single, *robot_.outcome.map, robot_.cameras);
    results_.add_pose("", robot_.pose);
    return;
  }
  add_robot(results_, "robots/" + name, "robot " + name, MapOf::robot, *robot_.outcome.map, robot_.cameras);
  results_.add_pose("robots/" + name, robot_.pose);
  write_joined();
}

// At the top the map that it is joined to; what stayed apart of its own maps beside it, and of the others nothing.
void SlamRun::write_joined() {
  const std::size_t main = main_component();
  fusion::FusionResult mine = team_;
  std::vector<TeamFrame> frames = {frames_[main]};
  mine.components = {team_.components[main]};
  for (std::size_t i = 0; i < team_.components.size(); ++i) {
    const std::vector<MapId>& members = team_.components[i].members;
    if (i == main || std::none_of(members.begin(), members.end(), [&](const MapId& map) { return is_own(map); }))
      continue;
    mine.components.push_back(team_.components[i]);
    frames.push_back(frames_[i]);
  }
  KeptRequests requests = kept_requests(starts_.priors, configuration_.fusion);
  requests.refused = starts_.refused;
  requests.vetoed = vetoes_of(starts_.vetoed, own_maps(), team_);
  results_.set_own_maps(own_maps());
  results_.set_requests(std::move(requests));
  const std::string& name = robot_.report.id.str();
  results_.add_components(
      {TierId(), "", "apart-", "robot " + name + ", joined", std::move(frames), MapOf::team, true, false}, mine,
      {robot_.cameras}, report_);
  results_.put_trajectory_first(robot_.report.id);
}

}  // namespace

Report run_slam(const RunConfiguration& configuration, const RunPlan& plan, const RunSettings& settings,
                WorkerPool& pool, Progress& progress) {
  MAPWEAVE_EXPECT(plan.robots.size() == 1, "slam maps one robot");
  return SlamRun(configuration, plan, settings, pool, progress).run();
}

}  // namespace mapweave::runtime
