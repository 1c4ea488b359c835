#include "live_edge_state.h"

#include "plan/team_options.h"

#include <mapweave/core/files.h>
#include <mapweave/core/log.h>
#include <mapweave/core/stopwatch.h>
#include <mapweave/mapdb/update_journal.h>
#include <mapweave/tiers/subjects.h>
#include <mapweave/transport/in_process_channel.h>

#include <algorithm>

namespace mapweave::runtime {
namespace {

constexpr std::chrono::milliseconds kStep{20};
constexpr char kEdge[] = "edge";

std::unique_ptr<LiveMapServer> camera_map_server_of(const TierId& edge, const LiveSite& site) {
  const RunConfiguration& configuration = site.configuration;
  if (!shares_cameras(configuration)) return nullptr;
  std::optional<std::filesystem::path> journal;
  if (site.journal) {
    journal = journal_of_cameras(*site.journal);
    make_folder(journal->parent_path(), "name another folder in live.store");
  }
  auto server =
      std::make_unique<LiveMapServer>(edge, configuration.server, configuration.fusion, site.options.camera_map_server,
                                      journal, shared_rig_options(configuration, site.plan, edge));
  server->refuse(site.plan.refused);
  return server;
}

}  // namespace

LiveEdge::State::State(TierId id, const LiveSite& of, Connect connect)
    : edge(id),
      site(of),
      to_cloud(std::move(connect)),
      agreement(agreement_of(of.configuration)),
      began(now_ns()),
      options(of.options),
      is_coordinated(of.configuration.coordinator.method.has_value()),
      keeps_previews(of.keeps_previews || of.options.page_port != 0) {
  std::string names;
  for (const TierId& one : site.plan.edges) names += (names.empty() ? "" : ", ") + one.str();
  const bool is_known = std::find(site.plan.edges.begin(), site.plan.edges.end(), edge) != site.plan.edges.end();
  for (const PlannedRobot& planned : site.plan.robots) {
    if (planned.edge != edge && !(is_coordinated && is_known)) continue;
    Robot& robot = robots[planned.id];
    robot.planned = &planned;
    robot.is_member = planned.edge == edge;
  }
  if (robots.empty())
    throw Error(ErrorCode::kBadInput, "no robot has the edge '" + edge.str() + "'", {},
                "the edges of this configuration are: " + names);
  if (site.journal) journal.emplace(*site.journal);
  cameras = camera_map_server_of(edge, site);
  for (auto& [name, robot] : robots) robot.record.robot = name;
  cloud.emplace(SessionId{{RobotId(edge.str()), SensorId(kEdge)}, began}, agreement, "the cloud", site.options.wire,
                WireHooks{[](const Hello&) { return std::uint64_t{0}; },
                          [this](Said said) {
                            cloud->store(said.number);  // it asks again who began anew
                            requests.push_back(std::move(said));
                          },
                          [this] { begin_anew_with_cloud(); }});
  speaker = std::thread([this] { speak(); });
  merger = std::thread([this] { merge(); });
}

LiveEdge::State::~State() {
  {
    const std::lock_guard lock(mutex);
    ends = true;
    changed.notify_all();
  }
  speaker.join();
  merger.join();
  for (auto& [name, robot] : robots)
    if (robot.mapper.joinable()) robot.mapper.join();
  if (saver) saver->finish();
}

// Under another number of its run, so that nothing said before is taken for it.
void LiveEdge::State::begin_anew_with_cloud() {
  SessionId self = cloud->self();
  ++self.run;
  cloud->begin_anew(self);
  begins_rounds = true;
  for (const auto& [subject, bytes] : finals) cloud->append(subject, bytes);
}

void LiveEdge::State::replay() {
  try {
    if (journal)
      journal->replay([&](const mapdb::JournalEntry& entry) {
        if (entry.vetoed || ends) return;
        Sensed sensed = decode_sensed(entry.update, site.journal->string());
        std::unique_lock lock(mutex);
        const auto known = robots.find(sensed.robot);
        if (known == robots.end()) return;  // the configuration has no such robot any more
        Robot& robot = known->second;
        if (sensed.sequence != robot.taken + 1 || (robot.session && *robot.session != entry.from))
          throw Error(ErrorCode::kCorrupt,
                      "message " + std::to_string(sensed.sequence) + " of robot '" + sensed.robot.str() +
                          "' does not follow number " + std::to_string(robot.taken),
                      site.journal->string(), "begin another journal; robots that are still there send all again");
        robot.session = entry.from;
        robot.taken = robot.stored = sensed.sequence;
        keep(robot, std::move(sensed), entry.update.size());
        changed.wait(lock, [&] { return ends || robot.queue_bytes < options.edge_queue_bytes(); });
      });
  } catch (const std::exception& error) {
    log(LogLevel::error, "edge " + edge.str() + ": " + error.what());
    const std::lock_guard lock(mutex);
    counts.trouble = error.what();
  }
  const std::lock_guard lock(mutex);
  saver.emplace(std::move(journal), JournalSaver::kNeverLong, [] {});
}

void LiveEdge::State::keep(Robot& robot, Sensed sensed, std::size_t bytes) {
  robot.queue_bytes += bytes;
  robot.has_said_all = robot.has_said_all || std::holds_alternative<StreamEnd>(sensed.body);
  robot.queue.emplace_back(std::move(sensed), bytes);
  if (!robot.mapper.joinable()) robot.mapper = std::thread([this, &robot] { map(robot); });
  changed.notify_all();
}

std::uint64_t LiveEdge::State::greet(Link& link, const Hello& hello) {
  const SessionId& session = hello.session;
  const auto known = robots.find(session.client.robot);
  if (known == robots.end()) {
    std::string names;
    for (const auto& entry : robots) names += (names.empty() ? "" : ", ") + entry.first.str();
    throw Error(ErrorCode::kBadInput, "'" + session.client.robot.str() + "' is no robot of edge '" + edge.str() + "'",
                {}, "its robots are: " + names);
  }
  if (!counts.trouble.empty()) throw Error(ErrorCode::kCannotWrite, counts.trouble);
  Robot& robot = known->second;
  if (robot.session && *robot.session != session)
    throw Error(ErrorCode::kBadInput,
                "robot '" + session.client.robot.str() + "' is here already, as " + to_string(*robot.session) +
                    "; this one is " + to_string(session),
                {}, "give one of the two another name, or begin a new deployment for a new recording");
  for (Link& other : links)
    if (&other != &link && other.robot == &robot && !other.is_closed && other.wire->is_open()) {
      log(LogLevel::warning, "edge " + edge.str() + ": robot " + session.client.robot.str() +
                                 " came on another wire; the one before is closed");
      other.is_closed = true;
    }
  if (link.robot != &robot) {  // a wire may say hello again
    const auto now = Clock::now();
    const bool is_soon =
        std::chrono::duration<double>(now - std::exchange(robot.begun_at, now)).count() < options.patience_s;
    robot.begun_soon = is_soon ? robot.begun_soon + 1 : 0;
    ++robot.begun;
  }
  robot.session = session;
  link.robot = &robot;
  return robot.stored;
}

void LiveEdge::State::take(Link& link, const Said& said) {
  Robot& robot = *link.robot;
  if (said.number <= robot.taken) return;  // on a wire before
  if (said.subject != tiers::subject::kSensed)
    throw Error(ErrorCode::kBadInput, "a robot does not say '" + said.subject + "'");
  Sensed sensed = decode_sensed(said.bytes, "what robot " + robot.planned->id.str() + " sensed");
  if (sensed.robot != robot.planned->id || sensed.sequence != said.number)
    throw Error(ErrorCode::kBadInput,
                "it says that it is of robot '" + sensed.robot.str() + "', number " + std::to_string(sensed.sequence));
  robot.taken = said.number;
  saver->save({{*robot.session, said.bytes}}, [this, &robot, number = said.number] {
    const std::lock_guard lock(stored_mutex);
    newly_stored.emplace_back(&robot, number);
    changed.notify_all();
  });
  keep(robot, std::move(sensed), said.bytes.size());
}

void LiveEdge::State::step(Clock::time_point now) {
  {
    const std::lock_guard lock(stored_mutex);
    for (const auto& [robot, number] : newly_stored) robot->stored = std::max(robot->stored, number);
    newly_stored.clear();
  }
  const std::size_t most = options.edge_queue_bytes();
  for (Link& link : links) {
    if (link.robot != nullptr) link.wire->store(link.robot->stored);
    if (!link.is_closed) link.wire->step(now, link.robot != nullptr && link.robot->queue_bytes >= most);
    if (link.robot != nullptr) link.robot->received_at = link.wire->received_at();
    link.is_closed = link.is_closed || !link.wire->is_open();
  }
  for (Link& link : links) {
    if (!link.is_closed) continue;
    link.wire->close();
    add_counts(link.wire->counts(), counts);
    if (link.robot != nullptr) add_counts(link.wire->health(), link.robot->wire_before);
  }
  links.remove_if([](const Link& link) { return link.is_closed; });
}

void LiveEdge::State::step_cloud(std::unique_lock<std::mutex>& lock, Clock::time_point now) {
  if (!cloud->is_open()) {
    lock.unlock();
    std::shared_ptr<transport::Channel> channel = to_cloud();
    if (channel) channel->set_listener([woken = woken] { woken->notify_all(); });
    lock.lock();
    if (channel && !channel->is_closed()) cloud->use(std::move(channel));
  }
  cloud->step(now, false);
  if (cloud->is_open() && cloud->is_dead(now)) cloud->close();  // the next one may get through
}

// What it merged for good holds no longer where it has other robots now.
void LiveEdge::State::take(const LivePlan& news) {
  const std::lock_guard lock(mutex);
  if (news.number <= plan.number || (news.is_done && plan.number == 0)) return;
  const std::vector<RobotId> before = members();
  plan = news;
  counts.is_done = counts.is_done || plan.is_done;
  for (auto& [name, robot] : robots) {
    const auto place = plan.edge_of.find(name);
    if (place == plan.edge_of.end()) continue;
    robot.has_left = robot.has_left || (robot.is_member && place->second != edge);
    robot.is_member = place->second == edge;
  }
  changed.notify_all();
  const std::vector<RobotId> now = members();
  if (now == before) return;
  std::string names;
  for (const RobotId& robot : now) names += (names.empty() ? "" : ", ") + robot.str();
  log(LogLevel::info, "edge " + edge.str() + ": its robots are now " + (names.empty() ? "none" : names) + " (plan " +
                          std::to_string(plan.number) + ")");
  counts.is_fused = false;
  finals.clear();
}

std::vector<RobotId> LiveEdge::State::members() const {
  std::vector<RobotId> names;
  for (const auto& [name, robot] : robots)
    if (robot.is_member) names.push_back(name);
  return names;
}

void LiveEdge::State::say_who_is_missing() const {
  for (const auto& [name, robot] : robots) {
    const bool is_here = std::any_of(links.begin(), links.end(), [&robot = robot](const Link& link) {
      return link.robot == &robot && !link.is_closed;
    });
    if (!is_here && !robot.has_said_all && robot.is_member)
      log(LogLevel::warning, "edge " + edge.str() + " waits for robot " + name.str() + ": it is not on the wire");
  }
  if (!cloud->is_welcome() && !counts.is_done)
    log(LogLevel::warning, "edge " + edge.str() + ": the cloud does not answer; what is for it is kept");
}

void LiveEdge::State::speak() {
  replay();
  std::unique_lock lock(mutex);
  auto said = Clock::now();
  while (!ends) {
    const auto now = Clock::now();
    step(now);
    step_cloud(lock, now);
    if (std::chrono::duration<double>(now - said).count() >= options.patience_s) {
      said = now;
      say_who_is_missing();
    }
    changed.wait_for(lock, kStep);
  }
}

LiveEdge::LiveEdge(TierId edge, const LiveSite& site, Connect to_cloud)
    : state_(new State(edge, site, std::move(to_cloud))) {}
LiveEdge::~LiveEdge() = default;

std::shared_ptr<transport::Channel> LiveEdge::connect() {
  const auto channel = transport::make_in_process_channel({state_->site.options.edge_queue_bytes()});
  serve(channel.second);
  return channel.first;
}

void LiveEdge::use(const LiveOptions& options) {
  const std::lock_guard lock(state_->mutex);
  state_->options.take_while_running(options);
  state_->has_new_options = true;
  state_->keeps_previews = state_->site.keeps_previews || options.page_port != 0;
  state_->changed.notify_all();
}

void LiveEdge::serve(std::shared_ptr<transport::Channel> robot) {
  State& state = *state_;
  robot->set_listener([woken = state.woken] { woken->notify_all(); });
  const std::lock_guard lock(state.mutex);
  if (state.links.size() >= kMostLinks) return robot->close();
  State::Link& link = state.links.emplace_back();
  link.wire.emplace(SessionId{{RobotId(state.edge.str()), SensorId(kEdge)}, state.began}, state.agreement, "a robot",
                    state.site.options.wire,
                    WireHooks{[&state, &link](const Hello& hello) { return state.greet(link, hello); },
                              [&state, &link](const Said& said) { state.take(link, said); }});
  link.wire->use(std::move(robot));
}

void LiveEdge::serve_camera(const RobotId& robot, std::shared_ptr<transport::Channel> camera) {
  if (!state_->cameras) return camera->close();
  try {
    state_->cameras->serve(camera, robot);
  } catch (const Error& error) {
    log(LogLevel::warning, "edge " + state_->edge.str() + ": " + error.what());
    camera->close();
  }
}

std::size_t LiveEdge::cameras_of(const RobotId& robot) const {
  std::set<ClientId> cameras;
  if (state_->cameras)
    for (const ClientCounts& client : state_->cameras->counts().clients)
      if (client.session.client.robot == robot) cameras.insert(client.session.client);
  return cameras.size();
}

std::filesystem::path journal_of_cameras(const std::filesystem::path& journal) {
  return journal.parent_path() / "cameras" / journal.filename();
}

bool LiveEdge::follow(const LiveRequests& requests) {
  if (state_->cameras) state_->cameras->refuse(refused_in(state_->site.plan, requests));
  const std::lock_guard lock(state_->mutex);
  if (state_->counts.is_fused) return false;
  state_->asked_for = requests;
  state_->has_new_requests = true;
  return true;
}

void LiveEdge::follow(const LivePlan& plan) { state_->take(plan); }

std::vector<std::string> LiveEdge::map_reports() const {
  const std::lock_guard lock(state_->mutex);
  std::vector<std::string> reports;
  for (const auto& [name, robot] : state_->robots)
    if (robot.is_member && !robot.map_report.empty()) reports.push_back(robot.map_report);
  return reports;
}

std::shared_ptr<const LivePreview> LiveEdge::preview() const {
  const std::lock_guard lock(state_->mutex);
  return state_->shown;
}

std::shared_ptr<const Map> LiveEdge::map_so_far(const RobotId& robot) const {
  const std::lock_guard lock(state_->mutex);
  const auto known = state_->robots.find(robot);
  return known != state_->robots.end() && known->second.is_member ? known->second.own : nullptr;
}

LiveEdgeCounts LiveEdge::counts() const {
  const State& state = *state_;
  std::optional<ServerCounts> cameras;
  if (state.cameras) cameras = state.cameras->counts();
  const std::lock_guard lock(state.mutex);
  LiveEdgeCounts counts = state.counts;
  counts.cameras = std::move(cameras);
  counts.plan = state.plan.number;
  counts.bytes_per_s = state.cloud->bytes_per_s();
  counts.cloud_wire = state.cloud->health();
  counts.waiting_bytes = state.cloud->waiting_bytes();
  counts.is_cloud_on_wire = state.cloud->is_open() && state.cloud->is_welcome();
  if (state.cloud->other()) counts.cloud_silent_s = state.cloud->silent_s(Clock::now());
  for (const State::Link& link : state.links) {
    add_counts(link.wire->counts(), counts);
    if (link.robot == nullptr) counts.wire_troubles.insert(link.wire->health().trouble);
  }
  counts.wire_troubles.erase("");
  if (counts.trouble.empty() && state.saver) counts.trouble = state.saver->trouble();
  for (const auto& [name, robot] : state.robots) {
    if (!robot.is_member && !robot.session) continue;
    LiveEdgeCounts::RobotCounts& one = counts.robots.emplace_back();
    one.id = name;
    one.taken = robot.taken;
    one.stored = robot.stored;
    one.mapped = robot.mapped;
    one.scans = robot.scans;
    one.lost_scans = robot.lost_scans;
    one.queue_bytes = robot.queue_bytes;
    one.begun = robot.begun;
    one.begun_soon = robot.begun_soon;
    one.has_ended = robot.has_ended;
    one.has_said_all = robot.has_said_all;
    one.is_member = robot.is_member;
    one.silent_s = seconds_since(robot.received_at);
    for (const State::Link& link : state.links) {
      if (link.robot != &robot || link.is_closed) continue;
      one.is_on_wire = true;
      one.wire = link.wire->health();
    }
    add_counts(robot.wire_before, one.wire);
  }
  return counts;
}

}  // namespace mapweave::runtime
