#include "live_edge_state.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/laser/engines.h>
#include <mapweave/maps/coordination.h>
#include <mapweave/runtime/merge_requests.h>
#include <mapweave/runtime/metrics.h>
#include <mapweave/scheduling/overlap_estimate.h>
#include <mapweave/tiers/subjects.h>

#include <algorithm>

namespace mapweave::runtime {

namespace subject = tiers::subject;

namespace {

constexpr double kBetweenMaps_s = 0.2;
constexpr int kMapCost = 10;  // reading a robot's map so far takes at most a tenth of its thread's time

std::shared_ptr<const Map> named(Map map, const RobotId& robot) {
  if (map.empty()) return nullptr;
  map.id = MapId(robot.str());
  return std::make_shared<const Map>(std::move(map));
}

Map nodes_of(const Map& map) {
  Map nodes;
  for (const auto& [id, node] : map.nodes)
    if (node.payload != nullptr) nodes.nodes.set(id, node);
  return nodes;
}

}  // namespace

// False: the edge ends.
bool LiveEdge::State::await_work(Robot& robot, std::unique_lock<std::mutex>& lock) {
  const auto is_there = [&] { return ends || !robot.queue.empty(); };
  while (robot.has_news && !changed.wait_until(lock, robot.reads_again, is_there)) read_map(robot, lock);
  changed.wait(lock, is_there);
  return !ends;
}

// What was mapped lately, for previews and for who looks.
void LiveEdge::State::read_map(Robot& robot, std::unique_lock<std::mutex>& lock) {
  if (!robot.has_news || Clock::now() < robot.reads_again) return;
  lock.unlock();
  robot.has_news = false;
  const Clock::time_point before = Clock::now();
  std::shared_ptr<const Map> map;
  try {
    map = named(tiers::growing_part(robot.slam->map_so_far()), robot.planned->id);
  } catch (const Interrupted&) {  // whoever interrupted it ends this
  }
  const Clock::time_point now = Clock::now();
  lock.lock();
  const double period_s = std::min(kBetweenMaps_s, options.preview_period_s);
  robot.reads_again =
      now + std::max(std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(period_s)),
                     kMapCost * (now - before));
  if (map) robot.so_far = robot.own = std::move(map);
}

void LiveEdge::State::map(Robot& robot) {
  std::unique_lock lock(mutex);
  while (await_work(robot, lock)) {
    auto [sensed, bytes] = std::move(robot.queue.front());
    robot.queue.pop_front();
    const SessionId session = *robot.session;
    lock.unlock();
    const bool is_scan = std::holds_alternative<PackedScan>(sensed.body),
               is_lost = std::holds_alternative<LostScan>(sensed.body);
    std::optional<tiers::RobotOutcome> outcome;
    const Clock::time_point before = Clock::now();
    if (!robot.has_outcome) try {  // else its report is on its way: nothing changes it
        if (robot.began == Clock::time_point{}) begin(robot, session, std::holds_alternative<MappedPart>(sensed.body));
        outcome = step(robot, std::move(sensed), bytes);
      } catch (const Error& error) {  // its engine cannot be started, or what it mapped is not sound
        outcome = tiers::RobotOutcome{robot.planned->id, std::nullopt, error};
      } catch (const Interrupted& interrupted) {
        outcome = tiers::RobotOutcome{
            robot.planned->id, std::nullopt,
            Error(ErrorCode::kHelperFailed, interrupted.message(), "robot " + robot.planned->id.str())};
      }
    std::shared_ptr<const Map> whole;
    if (outcome) {
      complete(robot, *outcome);
      if (outcome->map && keeps_previews) whole = named(nodes_of(*outcome->map), robot.planned->id);
    }
    robot.has_news = robot.has_news && !robot.has_outcome;
    lock.lock();
    robot.queue_bytes -= bytes;
    ++robot.mapped;
    robot.scans += is_scan ? 1 : 0;
    if (is_scan) counts.mapping_s += std::chrono::duration<double>(Clock::now() - before).count();
    robot.lost_scans += is_lost ? 1 : 0;
    if (outcome) {
      if (whole) robot.own = std::move(whole);
      if (robot.on_board.record && !robot.on_board.maps.empty())
        robot.so_far = named(tiers::growing_part(robot.on_board.maps.front()), robot.planned->id);
      robot.outcome = std::move(outcome);
      robot.has_ended = true;
      site.progress.say(
          "edge " + edge.str() + ": robot " + robot.planned->id.str() + " has ended; " +
          (robot.on_board.record ? "it mapped on board" : std::to_string(robot.scans) + " scans are mapped"));
    }
    changed.notify_all();
    read_map(robot, lock);
  }
}

void LiveEdge::State::begin(Robot& robot, const SessionId& session, bool is_on_board) const {
  robot.began = Clock::now();
  robot.record.sensor = session.client.sensor.str();
  if (is_on_board) return;
  const RunConfiguration& configuration = configuration_of(site.configuration, *robot.planned);
  auto mapper = laser::make_laser_mapper({robot.planned->robot(), session.client.sensor}, configuration.laser,
                                         configuration.seed);
  robot.slam.emplace(robot.planned->id, std::move(mapper));
}

std::optional<tiers::RobotOutcome> LiveEdge::State::step(Robot& robot, Sensed sensed, std::size_t bytes) {
  RobotRecord& record = robot.record;
  const double before_s = thread_cpu_seconds();
  if (auto* part = std::get_if<MappedPart>(&sensed.body); part != nullptr && !robot.slam) {
    robot.on_board.add(std::move(*part), robot.planned->id);
    return std::nullopt;
  }
  if (robot.on_board.record) {
    const auto* end = std::get_if<StreamEnd>(&sensed.body);
    if (end == nullptr) throw Error(ErrorCode::kBadInput, "it maps on board and sends what it senses, too");
    return mapped_on_board(robot, end->trouble);
  }
  record.sensed_bytes += bytes;
  if (std::holds_alternative<LostScan>(sensed.body)) ++record.lost_scans;
  if (std::holds_alternative<PackedScan>(sensed.body)) {
    ++record.scans;
    if (!robot.first_scan) robot.first_scan = sensed.stamp;
    robot.last_scan = sensed.stamp;
  }
  if (const auto* wheels = std::get_if<Pose3>(&sensed.body)) record.odometry.push_back({sensed.stamp, *wheels});
  if (const auto* end = std::get_if<StreamEnd>(&sensed.body)) {
    record.notes = end->notes;
    record.log = end->log;
    record.log_sha256 = end->log_sha256;
  }
  std::optional<tiers::RobotOutcome> outcome;
  if (robot.slam) {
    // Odometry may place a scan that was held back; else it changes no map.
    robot.has_news = robot.has_news || std::holds_alternative<PackedScan>(sensed.body);
    outcome = robot.slam->step(std::move(sensed));
    for (const laser::LivePose& pose : robot.slam->take_live_poses()) {
      robot.has_news = true;
      if (pose.is_matched) record.live.push_back({pose.stamp, pose.map_from_robot});
    }
  }
  record.mapping_s += thread_cpu_seconds() - before_s;
  return outcome;
}

tiers::RobotOutcome LiveEdge::State::mapped_on_board(Robot& robot, const std::optional<Error>& trouble) const {
  robot.record = *robot.on_board.record;
  std::vector<Map>& maps = robot.on_board.maps;
  if (robot.record.has_laser_map) return result_of(robot.record, maps, *robot.planned, site.configuration).outcome;
  tiers::RobotOutcome outcome{robot.planned->id, std::nullopt, robot.record.trouble ? robot.record.trouble : trouble,
                              robot.record.helper_s};
  if (maps.empty()) return outcome;
  outcome.map = maps.front();
  outcome.apart.assign(std::make_move_iterator(maps.begin() + 1), std::make_move_iterator(maps.end()));
  maps.resize(1);  // for previews
  return outcome;
}

void LiveEdge::State::complete(Robot& robot, const tiers::RobotOutcome& outcome) {
  RobotRecord& record = robot.record;
  robot.has_outcome = true;
  if (robot.on_board.record) return;  // it said all itself
  if (robot.first_scan) record.log_s = seconds_between(*robot.first_scan, *robot.last_scan);
  record.wall_s = std::chrono::duration<double>(Clock::now() - robot.began).count();
  record.helper_s = outcome.helper_cpu_seconds;
  record.trouble = outcome.trouble;
  for (const std::string& note : outcome.notes)
    record.notes.push_back("robot " + robot.planned->id.str() + ": " + note);
}

bool LiveEdge::State::is_due_to_fuse() const {
  if (counts.is_fused || (is_coordinated && (!plan.is_final || plan.members(edge).empty()))) return false;
  return std::all_of(robots.begin(), robots.end(),
                     [](const auto& entry) { return entry.second.has_ended || !entry.second.is_member; });
}

void LiveEdge::State::merge() {
  std::unique_lock lock(mutex);
  const auto after_a_period = [&] { return in_seconds(options.preview_period_s); };
  auto next = after_a_period();
  while (!ends) {
    if (std::exchange(has_new_options, false)) next = std::min(next, after_a_period());
    const auto may_answer = [&] {
      return !requests.empty() && (counts.is_fused || members().empty() || requests.back().subject == subject::kDone);
    };
    changed.wait_until(lock, next, [&] { return ends || has_new_options || is_due_to_fuse() || may_answer(); });
    if (ends) return;
    try {
      if (is_due_to_fuse()) {
        lock.unlock();
        fuse_all();
        lock.lock();
      } else if (may_answer()) {
        const Said request = std::move(requests.front());
        requests.pop_front();
        lock.unlock();
        answer(request);
        lock.lock();
      } else if (Clock::now() >= next) {
        const bool is_fused = counts.is_fused;
        lock.unlock();
        if (!is_fused) preview();
        lock.lock();
        next = after_a_period();
      }
    } catch (const Interrupted&) {  // whoever interrupted it ends this
      if (!lock.owns_lock()) lock.lock();
      changed.wait_until(lock, next = after_a_period(), [&] { return ends.load(); });
    } catch (const std::exception& error) {
      if (!lock.owns_lock()) lock.lock();
      log(LogLevel::error, "edge " + edge.str() + ": " + error.what());
      counts.trouble = error.what();
      next = after_a_period();
      changed.wait_until(lock, next, [&] { return ends.load(); });
    }
  }
}

std::vector<fusion::MapPrior> LiveEdge::State::priors(const std::vector<const Map*>& maps) const {
  std::vector<StartedMap> started;
  const std::lock_guard lock(mutex);
  for (const Map* map : maps)
    for (const auto& [name, robot] : robots)
      if (map->id == MapId(name.str())) started.push_back({map, start_of(site.configuration, asked_for, name)});
  return priors_of_starts(started);
}

std::set<std::pair<MapId, MapId>> LiveEdge::State::refused() const {
  std::set<std::pair<MapId, MapId>> maps;
  const std::lock_guard lock(mutex);
  for (const auto& [a, b] : refused_in(site.plan, asked_for)) maps.insert(std::minmax(MapId(a.str()), MapId(b.str())));
  return maps;
}

void LiveEdge::State::read_parts() {
  const std::lock_guard lock(mutex);
  for (const auto& [name, robot] : robots)
    if (robot.is_member && robot.so_far) parts[name] = robot.so_far;
}

// What the coordinator is to know of them.
void LiveEdge::State::report_maps() {
  for (auto& [name, robot] : robots) {
    const Map* map = nullptr;
    std::uint64_t scans = 0;
    bool has_ended = false;
    {
      const std::lock_guard lock(mutex);
      if (!robot.is_member || robot.has_reported_end) continue;
      scans = robot.scans;
      has_ended = robot.has_ended;
      if (has_ended && robot.outcome && robot.outcome->map) map = &*robot.outcome->map;
    }
    const auto part = parts.find(name);
    if (map == nullptr && part != parts.end()) map = part->second.get();
    robot.has_reported_end = has_ended;
    if (map == nullptr || (map->nodes.size() == robot.reported_nodes && !has_ended)) continue;
    robot.reported_nodes = map->nodes.size();
    std::string report = encode(CoordinatorEvent(MapReport{name, scans, scheduling::summary_of(*map)}));
    const std::lock_guard lock(mutex);
    robot.map_report = std::move(report);
  }
}

void LiveEdge::State::preview() {
  bool is_anew = false, looks_again = false;
  std::vector<RobotId> gone;
  {
    const std::lock_guard lock(mutex);
    is_anew = std::exchange(begins_rounds, false);
    looks_again = std::exchange(has_new_requests, false);
    for (auto& [name, robot] : robots)
      if (std::exchange(robot.has_left, false) && parts.count(name) != 0) gone.push_back(name);
  }
  if (!rounds || is_anew) {
    rounds.emplace(edge, site.configuration.fusion);
    is_anew = true;
  }
  if (looks_again) rounds->look_again();
  for (const RobotId& robot : gone) {
    parts.erase(robot);
    rounds->forget(MapId(robot.str()));
  }
  read_parts();
  if (is_coordinated) report_maps();
  std::vector<const Map*> maps;
  for (const auto& [name, part] : parts) {
    rounds->put(*part);
    maps.push_back(part.get());
  }
  if (!rounds->has_news()) return;
  rounds->set_priors(priors(maps));
  rounds->set_refused(refused());
  const std::unique_ptr<Progress> silent = make_silent_progress();
  std::vector<std::vector<MapId>> joint;
  const fusion::FusionResult& result = rounds->fuse(site.pool, *silent);
  for (const fusion::Component& component : result.components)
    if (component.members.size() > 1) joint.push_back(component.members);
  std::map<RobotId, Stamp> newest = newest_scans(*rounds);
  std::shared_ptr<const LivePreview> next;
  if (keeps_previews) next = preview_of(*rounds, counts.previews + 1);
  const std::lock_guard lock(mutex);
  shown = std::move(next);
  ++counts.previews;
  counts.joint = std::move(joint);
  counts.newest_scans = std::move(newest);
  // What is new goes up later where much waits already.
  if (begins_rounds || cloud->waiting_bytes() >= site.options.wire.window_bytes()) {
    begins_rounds = begins_rounds || is_anew;
    return;
  }
  tiers::RoundNews news = rounds->news();
  for (std::string& update : news.updates) cloud->append(subject::kPreviewUpdate, std::move(update));
  for (std::string& merged : news.merged) cloud->append(subject::kPreviewMerged, std::move(merged));
  cloud->append(subject::kPreviewEnd, news.is_anew || is_anew ? "anew" : "");
  changed.notify_all();
}

void LiveEdge::State::say(const std::string& subject, std::string bytes) {
  const std::lock_guard lock(mutex);
  cloud->append(subject, std::move(bytes));
  changed.notify_all();
}

// What the cloud gets of them, in order.
std::vector<std::pair<std::string, std::string>> LiveEdge::State::fused(const std::vector<RobotId>& members) {
  std::vector<const Map*> maps;
  std::string names;
  for (const RobotId& name : members) {
    names += name.str() + "\n";
    if (const auto& outcome = robots.at(name).outcome; outcome->map) maps.push_back(&*outcome->map);
  }
  server.emplace(edge, members, site.configuration.fusion, site.configuration.cloud.maps);
  server->set_priors(priors(maps));
  server->set_refused(refused());
  std::vector<std::pair<std::string, std::string>> made;
  if (is_coordinated) made.emplace_back(subject::kFinalBegin, names);
  for (const RobotId& name : members) {
    Robot& robot = robots.at(name);
    tiers::EdgeServer::Effects effects = server->step(*robot.outcome, site.pool, site.progress);
    robot.record.map_bytes = effects.map_bytes;
    for (std::string& update : effects.for_cloud) made.emplace_back(subject::kFinalUpdate, std::move(update));
    for (std::string& merged : effects.merged) made.emplace_back(subject::kMerged, std::move(merged));
  }
  for (const RobotId& name : members) {
    Robot& robot = robots.at(name);
    std::vector<const Map*> own;
    if (robot.record.has_laser_map) {  // the cloud puts them together as well, and shows those of cameras
      for (const Map& map : robot.on_board.maps) own.push_back(&map);
    } else {
      if (robot.outcome->map) own.push_back(&*robot.outcome->map);
      for (const Map& map : robot.outcome->apart) own.push_back(&map);
    }
    for (const Map* map : own) made.emplace_back(subject::kRobotMap, tiers::first_update(*map, edge));
    made.emplace_back(subject::kRobotReport, encode(robot.record));
    if (!is_coordinated) robot.outcome.reset();  // the server has it; else it may have to merge anew
  }
  made.emplace_back(subject::kFused, "");
  return made;
}

void LiveEdge::State::fuse_all() {
  site.progress.say("edge " + edge.str() + ": all of its robots have ended; it merges their maps");
  std::vector<RobotId> of;
  {
    const std::lock_guard lock(mutex);
    of = members();
  }
  std::vector<std::pair<std::string, std::string>> made = fused(of);
  const std::lock_guard lock(mutex);
  if (members() != of) return;  // it has other robots by now
  for (auto& [subject, bytes] : made) cloud->append(subject, bytes);
  finals = std::move(made);
  counts.is_fused = true;
  changed.notify_all();
}

void LiveEdge::State::answer(const Said& request) {
  if (request.subject == subject::kDone) {
    const std::lock_guard lock(mutex);
    counts.is_done = true;
    changed.notify_all();
  } else if (!server) {
    log(LogLevel::warning, "edge " + edge.str() + " cannot answer the cloud: it has merged nothing");
  } else if (request.subject == subject::kJudgeMap) {
    if (request.bytes.empty())
      task = {};  // a task begins
    else
      task.updates.push_back(request.bytes);
  } else if (request.subject == subject::kJudge) {
    task.pairs = request.bytes;
    try {
      for (std::string& update : server->step(std::exchange(task, {}), site.pool, site.progress).for_cloud)
        say(subject::kFinalUpdate, std::move(update));
    } catch (const Error& error) {  // the cloud judges itself what nobody judged
      log(LogLevel::warning, "edge " + edge.str() + " cannot judge what the cloud asks: " + error.what());
    }
    say(subject::kJudged, "");
  } else if (request.subject == subject::kWanted) {
    std::vector<MapId> maps;
    for (std::size_t begin = 0; begin < request.bytes.size();) {
      const std::size_t end = std::min(request.bytes.find('\n', begin), request.bytes.size());
      const std::string name = request.bytes.substr(begin, end - begin);
      if (is_valid_name(name)) maps.emplace_back(name);
      begin = end + 1;
    }
    for (std::string& update : server->whole_maps(maps).for_cloud) say(subject::kFinalUpdate, std::move(update));
    say(subject::kWholeMaps, request.bytes);
  }
}

}  // namespace mapweave::runtime
