#include <mapweave/runtime/live_coordinator.h>

#include "measures.h"
#include "program_word.h"

#include "results/report_parts.h"
#include "robots/coordinated_robots.h"

#include <mapweave/core/log.h>
#include <mapweave/tiers/coordinator.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <deque>
#include <mutex>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::ordered_json;

// A program's words. The first that is found may be of a program that ended long ago, so that it says nothing.
struct Speaker {
  ProgramWord word;
  std::optional<std::int64_t> said_at_ns;
  std::optional<double> received_s;

  // False: it is no new one.
  bool receive(ProgramWord news, double now_s) {
    const bool is_new = said_at_ns && news.said_at_ns != *said_at_ns;
    said_at_ns = news.said_at_ns;
    if (!is_new) return false;
    received_s = now_s;
    word = std::move(news);
    return true;
  }
  std::optional<double> silent_s(double now_s) const {
    return received_s ? std::optional(now_s - *received_s) : std::nullopt;
  }
};

}  // namespace

struct LiveCoordinator::State {
  struct Edge {
    Speaker speaker;
    bool is_there = true;
  };
  struct Robot {
    Speaker speaker;
    bool has_come = false, has_gone = false, is_known = false;  // is_known: its map, or its route
    double came_s = 0.0;
    TierId at;
    std::optional<MapReport> report;  // not given to the coordinator yet
    std::uint64_t scans = 0;          // of the last report that counted
  };

  const RunConfiguration& configuration;
  const RunPlan& of;
  mutable std::mutex mutex;
  LiveOptions live;
  const tiers::CoordinatorOptions options;
  tiers::Coordinator coordinator;
  Measures measures;
  std::map<TierId, Edge> edges;
  std::map<RobotId, Robot> robots;
  Speaker cloud;
  std::optional<std::uint64_t> done_plan;  // by which the cloud, of whatever deployment, wrote the team's map
  LivePlan plan;
  double planned_s = 0.0, next_s = 0.0;
  std::optional<double> began_s, ended_s, actual_s;  // ended_s: all robots; actual_s: LiveCoordinatorCounts::actual_s
  bool is_urgent = false;
  std::deque<tiers::CoordinatorDecision> decisions;  // that moved robots
  std::optional<tiers::CoordinatorDecision> last;
  std::uint64_t decided = 0, moves = 0, unreadable = 0;

  State(const RunConfiguration& all, const RunPlan& planned, const std::optional<LivePlan>& before);
  void resume(const LivePlan& before);
  template <class Receive>
  void receive(const std::string& who, Receive&& receive_it);
  void take_maps(const TierId& edge, std::string_view maps);
  void come(const RobotId& robot, Robot& one, const TierId& edge, double now_s);
  bool is_blind(double now_s) const;
  void notice_robots(double now_s);
  void notice_edges(double now_s);
  void report_maps();
  void report_edges_and_wires();
  void decide(double now_s);
  void take(tiers::CoordinatorDecision decision, double now_s);
  bool has_ended(const RobotId& robot) const;
  bool have_all_ended() const;
  double longest_mapping_s() const;
  std::size_t edges_there() const {
    return static_cast<std::size_t>(
        std::count_if(edges.begin(), edges.end(), [](const auto& edge) { return edge.second.is_there; }));
  }
  bool step(double now_s);
};

LiveCoordinator::State::State(const RunConfiguration& all, const RunPlan& planned,
                              const std::optional<LivePlan>& before)
    : configuration(all),
      of(planned),
      live(all.live),
      options(coordinator_options(all, planned)),
      coordinator(options),
      measures(all, planned, options.plan.model) {
  for (const TierId& edge : of.edges) edges[edge];
  for (const PlannedRobot& robot : of.robots) robots[robot.id];
  report_edges_and_wires();
  if (before) resume(*before);
}

void LiveCoordinator::State::resume(const LivePlan& before) {
  plan.number = before.number;
  if (before.is_done) return;  // a deployment before this one
  try {
    expect_of(before, of);
  } catch (const Error& error) {
    return log(LogLevel::warning, "the plan that was made before is not gone on with: " + std::string(error.what()));
  }
  plan = before;
  for (const auto& [robot, edge] : plan.edge_of) come(robot, robots.at(robot), edge, 0.0);
}

template <class Receive>
void LiveCoordinator::State::receive(const std::string& who, Receive&& receive_it) {
  const std::lock_guard lock(mutex);
  try {
    receive_it();
  } catch (const Error& error) {
    if (unreadable++ == 0)
      log(LogLevel::warning, "what " + who + " says of itself cannot be read: " + std::string(error.what()));
  }
}

void LiveCoordinator::State::take_maps(const TierId& edge, std::string_view maps) {
  const std::string where = "the maps of edge " + edge.str();
  for (const std::string& bytes : unpacked(maps, where)) {
    const CoordinatorEvent event = decode_coordinator_event(bytes, where);
    const auto* report = std::get_if<MapReport>(&event);
    const auto robot = report == nullptr ? robots.end() : robots.find(report->robot);
    if (robot == robots.end()) throw Error(ErrorCode::kBadInput, "a report that is of no robot's map", where);
    // A new edge maps again from the beginning: what the one before showed counts until it has come so far.
    const auto place = plan.edge_of.find(report->robot);
    if (place != plan.edge_of.end() && place->second == edge && report->scans >= robot->second.scans)
      robot->second.report = *report;
  }
}

void LiveCoordinator::State::come(const RobotId& robot, Robot& one, const TierId& edge, double now_s) {
  RobotComes comes = announced(robot_entry(configuration, robot), robot, edge, configuration.coordinator.route_range_m);
  one.has_come = true;
  one.is_known = comes.route.has_value();
  one.came_s = now_s;
  coordinator.receive(std::move(comes));
  is_urgent = true;
}

// A robot that has come and shows nothing yet: it is soon known better where it belongs. Not for ever: some show
// nothing before their end.
bool LiveCoordinator::State::is_blind(double now_s) const {
  constexpr double kPeriods = 3.0;
  return std::any_of(robots.begin(), robots.end(), [&](const auto& one) {
    const Robot& robot = one.second;
    return robot.has_come && !robot.is_known &&
           now_s - robot.came_s < kPeriods * configuration.coordinator.overlap_period_s;
  });
}

void LiveCoordinator::State::notice_robots(double now_s) {
  for (const PlannedRobot& planned : of.robots) {
    Robot& robot = robots.at(planned.id);
    if (!robot.has_come && robot.speaker.received_s) come(planned.id, robot, planned.edge, now_s);
    if (!robot.has_come || robot.has_gone || !has_ended(planned.id)) continue;
    robot.has_gone = true;
    coordinator.receive(RobotGoes{planned.id});
  }
}

// An edge counts as lost only once another one can take its robots; never while the cloud makes the final map,
// which has all that it needs of it, or waits for it.
void LiveCoordinator::State::notice_edges(double now_s) {
  if (!began_s) began_s = now_s;
  for (auto& [name, edge] : edges) {
    const double silent_s = edge.speaker.silent_s(now_s).value_or(now_s - *began_s);
    const bool is_lost = silent_s > live.lost_after_s;
    if (is_lost && edge.is_there && edges_there() > 1 && !cloud.word.is_sealing) {
      edge.is_there = false;
      is_urgent = true;
      coordinator.receive(EdgeGoes{name});
      log(LogLevel::warning, "edge " + name.str() + " has said nothing for " + std::to_string(std::lround(silent_s)) +
                                 " s: its robots are given to others");
    } else if (!is_lost && !edge.is_there) {
      edge.is_there = true;
      is_urgent = true;
    }
  }
}

void LiveCoordinator::State::report_maps() {
  for (auto& [name, robot] : robots) {
    if (!robot.report || !robot.has_come) continue;
    robot.scans = robot.report->scans;
    robot.is_known = robot.is_known || robot.report->summary.known() > 0;
    // All that it sensed would be sent and mapped again elsewhere.
    robot.report->scans = std::max(robot.report->scans, static_cast<std::uint64_t>(robot.speaker.word.scans));
    coordinator.receive(std::move(*robot.report));
    robot.report.reset();
  }
}

void LiveCoordinator::State::report_edges_and_wires() {
  for (const auto& [name, edge] : edges) {
    if (!edge.is_there) continue;
    const scheduling::EdgeResources is = measures.resources(name);
    coordinator.receive(EdgeIs{name, is.bandwidth_bytes_per_s, is.speed, is.capacity, is.delay_s});
    for (const auto& [robot, one] : robots)
      if (one.has_come)
        coordinator.receive(LinkIs{robot, name, measures.wire(robot, name).value, measures.delay_s(robot, name)});
  }
}

void LiveCoordinator::State::decide(double now_s) {
  if (std::none_of(robots.begin(), robots.end(), [](const auto& robot) { return robot.second.has_come; })) return;
  coordinator.hold(plan.is_final || is_blind(now_s));
  if (std::optional<tiers::CoordinatorDecision> decision = coordinator.decide(now_s - *began_s))
    take(std::move(*decision), now_s);
}

void LiveCoordinator::State::take(tiers::CoordinatorDecision decision, double now_s) {
  ++decided;
  last = decision;
  if (decision.edge_of != plan.edge_of || plan.edge_of.empty()) {
    ++plan.number;
    if (plan.since == 0) plan.since = plan.number;
    plan.edge_of = decision.edge_of;
    planned_s = now_s;
  }
  if (decision.moves.empty()) return;
  moves += decision.moves.size();
  if (decisions.size() == kMostDecisions) decisions.pop_front();
  decisions.push_back(std::move(decision));
}

bool LiveCoordinator::State::has_ended(const RobotId& robot) const {
  const auto place = plan.edge_of.find(robot);
  if (place == plan.edge_of.end() || place->second.empty()) return false;
  const Edge& edge = edges.at(place->second);
  return edge.is_there && edge.speaker.word.ended.count(robot.str()) != 0;
}

bool LiveCoordinator::State::have_all_ended() const {
  return std::all_of(robots.begin(), robots.end(), [this](const auto& robot) { return has_ended(robot.first); });
}

// Of the edges that map for good.
double LiveCoordinator::State::longest_mapping_s() const {
  double longest_s = 0.0;
  for (const auto& [name, edge] : edges)
    if (edge.is_there && !plan.members(name).empty()) longest_s = std::max(longest_s, edge.speaker.word.mapping_s);
  return longest_s;
}

bool LiveCoordinator::State::step(double now_s) {
  const std::uint64_t before = plan.number;
  if (plan.is_done) return false;
  if (plan.since > 0 && done_plan.value_or(0) >= plan.since) {
    plan.is_done = true;
    ++plan.number;
    if (ended_s) actual_s = longest_mapping_s() + now_s - *ended_s;
    return true;
  }
  notice_edges(now_s);
  notice_robots(now_s);
  if (is_urgent || now_s >= next_s) {
    is_urgent = false;
    next_s = now_s + configuration.coordinator.overlap_period_s;
    report_maps();
    report_edges_and_wires();
    decide(now_s);
  }
  if (!plan.is_final && plan.since > 0 && have_all_ended()) {
    plan.is_final = true;
    ++plan.number;
    planned_s = now_s;
    ended_s = now_s;
  }
  return plan.number != before;
}

LiveCoordinator::LiveCoordinator(const RunConfiguration& configuration, const RunPlan& plan,
                                 const std::optional<LivePlan>& before)
    : state_(new State(configuration, plan, before)) {}
LiveCoordinator::~LiveCoordinator() = default;

void LiveCoordinator::receive_cloud(std::string_view status, double now_s) {
  state_->receive("the cloud", [&] {
    ProgramWord word = decode_program_word(status, "the cloud");
    if (word.is_done) state_->done_plan = word.plan;
    state_->cloud.receive(std::move(word), now_s);
  });
}

void LiveCoordinator::receive_edge(const TierId& edge, std::string_view status, double now_s) {
  const std::string who = "edge " + edge.str();
  state_->receive(who, [&] {
    Speaker& speaker = state_->edges.at(edge).speaker;
    if (!speaker.receive(decode_program_word(status, who), now_s)) return;
    double scans = 0.0;
    for (const ProgramWord::Link& link : speaker.word.links) {
      scans += link.scans;
      if (link.bytes_per_s) state_->measures.take_wire_to_cloud(edge, *link.bytes_per_s);
    }
    state_->measures.take_mapping(edge, scans, speaker.word.mapping_s);
  });
}

void LiveCoordinator::receive_robot(const RobotId& robot, std::string_view status, double now_s) {
  const std::string who = "robot " + robot.str();
  state_->receive(who, [&] {
    State::Robot& one = state_->robots.at(robot);
    if (!one.speaker.receive(decode_program_word(status, who), now_s)) return;
    for (const ProgramWord::Link& link : one.speaker.word.links) {
      const auto edge = std::find_if(state_->edges.begin(), state_->edges.end(),
                                     [&](const auto& known) { return known.first.str() == link.name; });
      if (edge == state_->edges.end()) continue;
      one.at = edge->first;
      if (link.bytes_per_s) state_->measures.take_wire(robot, edge->first, *link.bytes_per_s);
    }
  });
}

void LiveCoordinator::receive_maps(const TierId& edge, std::string_view maps) {
  state_->receive("edge " + edge.str(), [&] { state_->take_maps(edge, maps); });
}

void LiveCoordinator::use(const LiveOptions& options) {
  const std::lock_guard lock(state_->mutex);
  state_->live.take_while_running(options);
}

void LiveCoordinator::decide_soon() {
  const std::lock_guard lock(state_->mutex);
  state_->is_urgent = true;
}

bool LiveCoordinator::step(double now_s) {
  const std::lock_guard lock(state_->mutex);
  return state_->step(now_s);
}

LivePlan LiveCoordinator::plan() const {
  const std::lock_guard lock(state_->mutex);
  return state_->plan.since > 0 ? state_->plan : LivePlan();
}

LiveCoordinatorCounts LiveCoordinator::counts(double now_s) const {
  const State& state = *state_;
  const std::lock_guard lock(state.mutex);
  LiveCoordinatorCounts counts;
  if (state.plan.since > 0) counts.plan = state.plan;
  counts.plan_age_s = now_s - state.planned_s;
  counts.decisions = state.decided;
  counts.moves = state.moves;
  counts.unreadable = state.unreadable;
  counts.cloud_silent_s = state.cloud.silent_s(now_s);
  if (state.last) counts.expected_s = state.last->expected_s;
  counts.actual_s = state.actual_s;
  if (!state.decisions.empty()) counts.last = in_words(state.decisions.back(), "nowhere: no edge has room");
  for (const auto& [name, edge] : state.edges) {
    const Expected speed = state.measures.speed(name), bytes = state.measures.wire_to_cloud(name);
    counts.edges.push_back({name, edge.is_there, edge.speaker.silent_s(now_s), counts.plan.members(name), speed.value,
                            bytes.value, to_text(speed.known), to_text(bytes.known)});
  }
  for (const auto& [name, robot] : state.robots) {
    LiveCoordinatorCounts::RobotCounts& one = counts.robots.emplace_back();
    one.id = name;
    one.at = robot.at;
    one.has_come = robot.has_come;
    one.has_ended = state.has_ended(name);
    one.silent_s = robot.speaker.silent_s(now_s);
    const auto place = counts.plan.edge_of.find(name);
    if (place == counts.plan.edge_of.end() || place->second.empty()) continue;
    one.edge = place->second;
    for (const ProgramWord::Link& link : state.edges.at(one.edge).speaker.word.links) {
      if (link.name != name.str()) continue;
      one.scans = static_cast<std::uint64_t>(link.scans);
      one.queue_bytes = static_cast<std::uint64_t>(link.queue_bytes);
    }
  }
  return counts;
}

nlohmann::ordered_json LiveCoordinator::report() const {
  const State& state = *state_;
  const std::lock_guard lock(state.mutex);
  Json edges = Json::array(), wires = Json::array(), overlaps = Json::array(), decisions = Json::array();
  for (const auto& [name, edge] : state.edges) {
    const Expected speed = state.measures.speed(name), bytes = state.measures.wire_to_cloud(name);
    Json robots = Json::array();
    for (const RobotId& robot : state.plan.members(name)) robots.push_back(robot.str());
    edges.push_back({{"id", name.str()},
                     {"is_there", edge.is_there},
                     {"robots", std::move(robots)},
                     {"speed", speed.value},
                     {"speed_is", to_text(speed.known)},
                     {"bytes_per_second", bytes.value},
                     {"bytes_per_second_is", to_text(bytes.known)}});
    for (const auto& [robot, one] : state.robots) {
      if (!one.has_come) continue;
      const Expected wire = state.measures.wire(robot, name);
      wires.push_back({{"robot", robot.str()},
                       {"edge", name.str()},
                       {"bytes_per_second", wire.value},
                       {"bytes_per_second_is", to_text(wire.known)}});
    }
  }
  if (state.last)
    for (const auto& [a, b, degree] : state.last->overlaps)
      overlaps.push_back({{"a", a.str()}, {"b", b.str()}, {"degree", degree}});
  for (const tiers::CoordinatorDecision& decision : state.decisions) decisions.push_back(json_of(decision));
  if (state.last && state.last->moves.empty()) decisions.push_back(json_of(*state.last));
  return {{"plan", state.plan.number},
          {"since", state.plan.since},
          {"final", state.plan.is_final},
          {"done", state.plan.is_done},
          {"method", coordination_method(state.configuration)},
          {"expected_seconds", state.last ? Json(state.last->expected_s) : Json()},
          {"actual_seconds", state.actual_s ? Json(*state.actual_s) : Json()},
          {"edges", std::move(edges)},
          {"wires", std::move(wires)},
          {"overlaps", std::move(overlaps)},
          {"decisions", std::move(decisions)}};
}

std::string pack_map_reports(const std::vector<std::string>& reports, std::size_t most_bytes) {
  return packed(reports, most_bytes);
}

}  // namespace mapweave::runtime
