#include "live_cloud_state.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/runtime/merge_requests.h>
#include <mapweave/tiers/subjects.h>

#include <algorithm>

namespace mapweave::runtime {

namespace subject = tiers::subject;

void LiveCloud::State::merge() {
  std::unique_lock lock(mutex);
  const auto after_a_period = [&] { return in_seconds(options.preview_period_s); };
  auto next = after_a_period();
  const auto has_work = [&] {
    return ends || has_new_plan || has_new_options || (seals_now && phase == Phase::collecting) ||
           std::any_of(edges.begin(), edges.end(), [](const auto& e) { return !e.second.said.empty(); });
  };
  while (!ends && phase != Phase::done) {
    changed.wait_until(lock, next, has_work);
    if (ends) return;
    has_new_plan = false;
    if (std::exchange(has_new_options, false)) next = std::min(next, after_a_period());
    lock.unlock();
    try {
      take_said();
      while (advance()) {}
      const bool is_due = Clock::now() >= next;
      if (is_due && phase == Phase::collecting) preview();
      lock.lock();
      if (is_due) next = after_a_period();
    } catch (...) {
      lock.lock();
      trouble = std::current_exception();
      changed.notify_all();
      return;
    }
  }
}

void LiveCloud::State::take_said() {
  for (auto& [id, edge] : edges) {
    std::deque<Said> said;
    bool is_forgotten = false;
    {
      const std::lock_guard lock(mutex);
      said = std::exchange(edge.said, {});
      is_forgotten = std::exchange(edge.is_forgotten, false);
    }
    if (is_forgotten) {
      edge.news = {};
      for (const PlannedRobot& robot : site.plan.robots)
        if (robot.edge == id && !is_coordinated) rounds.forget(MapId(robot.id.str()));
    }
    for (Said& one : said) {
      try {
        take(id, edge, std::move(one));
      } catch (const Error& error) {
        log(LogLevel::warning, "what edge " + id.str() + " sent is left out: " + error.what());
        const std::lock_guard lock(mutex);
        ++counts.unreadable;
      }
    }
  }
}

void LiveCloud::State::begin_finals(const TierId& id, Edge& edge, const std::string& names) {
  std::vector<RobotId> members;
  for (const PlannedRobot& robot : plan.robots)
    if (("\n" + names).find("\n" + robot.id.str() + "\n") != std::string::npos) members.push_back(robot.id);
  if (static_cast<std::size_t>(std::count(names.begin(), names.end(), '\n')) != members.size())
    throw Error(ErrorCode::kBadInput, "it has robots that the configuration does not have", "edge " + id.str());
  for (const RobotId& robot : members) {
    maps.erase(robot);
    records.erase(robot);
  }
  edge.finals.clear();
  const std::lock_guard lock(mutex);
  edge.members = std::move(members);
  edge.has_fused = false;
}

// Of an edge that merges anew because it was given other robots. False: it is something else.
bool LiveCloud::State::take_final(const TierId& id, Edge& edge, Said& said) {
  if (said.subject == subject::kFinalBegin && is_coordinated) {
    edge.is_late = phase != Phase::collecting;
    if (!edge.is_late) begin_finals(id, edge, said.bytes);
    return true;
  }
  if (!edge.is_late) return false;
  edge.is_late = said.subject != subject::kFused;
  return true;
}

void LiveCloud::State::take(const TierId& id, Edge& edge, Said said) {
  const std::string& what = said.subject;
  if (take_final(id, edge, said)) return;
  if (what == subject::kPreviewUpdate) {
    edge.news.updates.push_back(std::move(said.bytes));
  } else if (what == subject::kPreviewMerged) {
    edge.news.merged.push_back(std::move(said.bytes));
  } else if (what == subject::kPreviewEnd) {
    tiers::RoundNews news = std::exchange(edge.news, {});
    news.is_anew = said.bytes == "anew";
    if (phase == Phase::collecting) rounds.receive(news, id);
  } else if (what == subject::kFinalUpdate || what == subject::kMerged) {
    edge.finals.emplace_back(what, std::move(said.bytes));
  } else if (what == subject::kRobotMap || what == subject::kRobotReport) {
    take_robot(id, edge, said);
  } else if (what == subject::kFused) {
    const std::lock_guard lock(mutex);
    edge.has_fused = true;
  } else if (what == subject::kJudged) {
    edge.has_judged = true;
  } else if (what == subject::kWholeMaps) {
    edge.sent_whole.insert(said.bytes);
  } else {
    throw Error(ErrorCode::kBadInput, "an edge does not say '" + what + "'");
  }
}

namespace {

// Whose map it is: of the robot's name, or "NAME.1" and so on where its cameras left several.
bool is_map_of(const MapId& map, const RobotId& robot) {
  const std::string& name = robot.str();
  if (map.str() == name) return true;
  return map.str().size() > name.size() + 1 && map.str().compare(0, name.size() + 1, name + ".") == 0 &&
         map.str().find_first_not_of("0123456789", name.size() + 1) == std::string::npos;
}

}  // namespace

void LiveCloud::State::take_robot(const TierId& id, const Edge& edge, const Said& said) {
  const std::string where = "edge " + id.str();
  const auto expect_its = [&](const RobotId& robot) {
    const auto planned = std::find_if(site.plan.robots.begin(), site.plan.robots.end(),
                                      [&](const PlannedRobot& one) { return one.id == robot; });
    const bool is_its = is_coordinated
                            ? std::find(edge.members.begin(), edge.members.end(), robot) != edge.members.end()
                            : planned != site.plan.robots.end() && planned->edge == id;
    if (!is_its) throw Error(ErrorCode::kBadInput, "robot '" + robot.str() + "' is not its own", where);
  };
  if (said.subject == subject::kRobotReport) {
    RobotRecord record = decode_robot_record(said.bytes, where);
    expect_its(record.robot);
    const RobotId robot = record.robot;
    records.insert_or_assign(robot, std::move(record));
    return;
  }
  const MapUpdate update = decode_map_update(said.bytes, where);
  const PlannedRobot* owner = nullptr;
  for (const PlannedRobot& robot : site.plan.robots)
    if (is_map_of(update.origin.map, robot.id) && (owner == nullptr || update.origin.map.str() == robot.id.str()))
      owner = &robot;
  expect_its(owner != nullptr ? owner->id : RobotId(update.origin.map.str()));
  Map map;
  map.id = update.origin.map;
  maps[owner->id].insert_or_assign(map.id, updated(std::move(map), update));
}

// For previews; the final map takes them as a whole.
void LiveCloud::State::take_requests() {
  const std::lock_guard lock(mutex);
  std::vector<StartedMap> started;
  for (const PlannedRobot& robot : plan.robots)
    if (const Map* map = rounds.map(MapId(robot.id.str())))
      started.push_back({map, start_of(site.configuration, asked_for, robot.id)});
  rounds.set_priors(priors_of_starts(started));
  if (!std::exchange(has_new_requests, false)) return;
  rounds.look_again();
  std::set<std::pair<MapId, MapId>> refused;
  for (const auto& [a, b] : refused_in(plan, asked_for)) refused.insert(std::minmax(MapId(a.str()), MapId(b.str())));
  rounds.set_refused(std::move(refused));
}

void LiveCloud::State::preview() {
  take_requests();
  if (!rounds.has_news()) return;
  const std::unique_ptr<Progress> silent = make_silent_progress();
  std::vector<std::vector<MapId>> joint;
  std::vector<std::string> apart;
  std::map<RobotId, Stamp> newest;
  std::shared_ptr<const LivePreview> next;
  try {
    const fusion::FusionResult& result = rounds.fuse(site.pool, *silent);
    for (const fusion::Component& component : result.components)
      if (component.members.size() > 1) joint.push_back(component.members);
    for (const Verdict& verdict : result.verdicts)
      if (verdict.decision != Decision::accepted && !verdict.in_one_map)
        apart.push_back(verdict.a.str() + " + " + verdict.b.str() + ": " + in_words(verdict));
    newest = newest_scans(rounds);
    if (keeps_previews) next = preview_of(rounds, counts.previews + 1);
  } catch (const Interrupted&) {  // whoever interrupted it ends this
    return;
  }
  const std::lock_guard lock(mutex);
  if (joint != counts.joint)
    for (const std::vector<MapId>& members : joint) {
      std::string names;
      for (const MapId& id : members) names += (names.empty() ? "" : " + ") + id.str();
      site.progress.say("the cloud's preview: one map of " + names);
    }
  ++counts.previews;
  shown = std::move(next);
  counts.joint = std::move(joint);
  counts.apart = std::move(apart);
  counts.maps = rounds.maps().size();
  counts.newest_scans = std::move(newest);
}

void LiveCloud::State::ask(const TierId& edge, std::vector<std::pair<std::string, std::string>> words) {
  const std::lock_guard lock(mutex);
  auto& requests = edges.at(edge).requests;
  std::move(words.begin(), words.end(), std::back_inserter(requests));
  changed.notify_all();
}

bool LiveCloud::State::have_judged() const {
  return std::all_of(asked.begin(), asked.end(), [&](const TierId& id) { return edges.at(id).has_judged; });
}

bool LiveCloud::State::have_sent_wanted() const {
  return std::all_of(wanted.begin(), wanted.end(),
                     [&](const auto& entry) { return edges.at(entry.first).sent_whole.count(entry.second) != 0; });
}

// In the order of edges, as one process would.
void LiveCloud::State::give_finals() {
  for (auto& [id, edge] : edges)
    for (const auto& [what, bytes] : std::exchange(edge.finals, {})) try {
        if (gone.count(id) != 0) break;
        if (what == subject::kMerged)
          team.cloud().receive_merged(bytes, "edge " + id.str());
        else
          team.cloud().receive(bytes, "update of edge " + id.str());
      } catch (const Error& error) {
        log(LogLevel::warning, "what edge " + id.str() + " sent is left out: " + error.what());
        const std::lock_guard lock(mutex);
        ++counts.unreadable;
      }
}

std::vector<std::optional<RobotResult>> LiveCloud::State::robots() {
  std::vector<std::optional<RobotResult>> results;
  for (const PlannedRobot& robot : plan.robots) {
    const auto record = records.find(robot.id);
    std::vector<Map> own;
    if (const auto found = maps.find(robot.id); found != maps.end())
      for (auto& entry : found->second) own.push_back(std::move(entry.second));
    RobotRecord none;
    none.robot = robot.id;
    none.trouble = Error(ErrorCode::kMissing, "its map never came", "edge " + robot.edge.str(),
                         "let its robot and its edge end before the cloud does");
    if (record == records.end()) notes.push_back("robot " + robot.id.str() + ": its map never came from its edge");
    results.push_back(result_of(record == records.end() ? std::move(none) : record->second, std::move(own), robot,
                                site.configuration));
    if (record != records.end() && record->second.lost_scans > 0)
      notes.push_back("robot " + robot.id.str() + ": " + std::to_string(record->second.lost_scans) + " of " +
                      std::to_string(record->second.scans + record->second.lost_scans) + " scans were lost on the way");
  }
  return results;
}

// One step to the end, if it can be made.
bool LiveCloud::State::advance() {
  bool has_all = true, is_forced = false;
  {
    const std::lock_guard lock(mutex);
    if (is_coordinated)
      has_all = newest_plan.is_final && std::none_of(newest_plan.edge_of.begin(), newest_plan.edge_of.end(),
                                                     [](const auto& place) { return place.second.empty(); });
    for (const auto& [id, edge] : edges) has_all = has_all && (!is_needed(id) || has_its_finals(id, edge));
    is_forced = seals_now;
  }
  switch (phase) {
    case Phase::collecting:
      if (!has_all && !is_forced) return false;
      begin_sealing();
      phase = Phase::judging;
      return true;
    case Phase::judging:
      if (!have_judged() && !is_forced) return false;
      give_finals();
      seal();
      phase = Phase::completing;
      return true;
    case Phase::completing:
      if (!have_sent_wanted() && !is_forced) return false;
      give_finals();
      if (team.cloud().is_newer_than_sealed() && !maps.empty()) {
        seal();
        return true;
      }
      finish();
      phase = Phase::done;
      return false;
    case Phase::done: break;
  }
  return false;
}

void LiveCloud::State::begin_sealing() {
  std::set<TierId> fused;
  {
    const std::lock_guard lock(mutex);
    counts.is_sealing = true;  // from here on no request is taken
    for (const auto& [id, edge] : edges)
      if (edge.has_fused && (!is_coordinated || has_its_finals(id, edge))) fused.insert(id);
    if (is_coordinated)
      for (PlannedRobot& robot : plan.robots)
        if (const auto edge = newest_plan.edge_of.find(robot.id); edge != newest_plan.edge_of.end())
          robot.edge = edge->second;
  }
  for (const auto& entry : edges)
    if (fused.count(entry.first) == 0 && is_coordinated) gone.insert(entry.first);
  team.place(plan);
  team.set_requests(asked_for);
  site.progress.say("the cloud: all maps are here; it merges them");
  give_finals();
  team.take_robots(robots());
  if (!site.configuration.cloud.edges_judge) return;
  for (const auto& [id, task] : team.cloud().judging_tasks(fused, site.pool)) {
    std::vector<std::pair<std::string, std::string>> words{{subject::kJudgeMap, ""}};
    for (const std::string& update : task.updates) words.emplace_back(subject::kJudgeMap, update);
    words.emplace_back(subject::kJudge, task.pairs);
    ask(id, std::move(words));
    asked.insert(id);
  }
}

// As tiers::seal_by_whole_maps(), a step at a time.
void LiveCloud::State::seal() {
  wanted.clear();
  if (maps.empty()) return;
  sealed = team.cloud().seal(site.pool, site.progress);
  for (const auto& [id, whole] : team.cloud().wanted_as_whole(sealed)) {
    std::string& names = wanted[id];
    for (const MapId& map : whole) names += map.str() + "\n";
    ask(id, {{subject::kWanted, names}});
  }
}

void LiveCloud::State::finish() {
  for (std::string& note : team.cloud().notes(sealed)) notes.push_back(std::move(note));
  Report done = team.conclude(std::move(sealed), notes);
  for (const auto& entry : edges) ask(entry.first, {{subject::kDone, ""}});
  const std::lock_guard lock(mutex);
  counts.is_done = true;
  report = std::move(done);
  changed.notify_all();
}

}  // namespace mapweave::runtime
