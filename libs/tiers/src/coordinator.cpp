#include <mapweave/core/error.h>
#include <mapweave/core/format.h>
#include <mapweave/tiers/coordinator.h>

#include <algorithm>
#include <limits>
#include <utility>

namespace mapweave::tiers {
namespace {

using scheduling::EdgeResources;
using scheduling::Groups;
using scheduling::Latency;
using scheduling::Problem;

std::string in_words(const std::optional<std::uint32_t>& capacity) {
  return capacity ? std::to_string(*capacity) : "unlimited";
}
std::string in_words(const std::optional<double>& delay_s) { return delay_s ? format("%g s", *delay_s) : "default"; }

// "speed 1 -> 0.5, capacity 4 -> 2"; empty where nothing changed.
std::string changes(const EdgeResources& before, const EdgeResources& now) {
  std::string text;
  const auto add = [&](const std::string& change) { text += (text.empty() ? "" : ", ") + change; };
  if (before.bandwidth_bytes_per_s != now.bandwidth_bytes_per_s)
    add(format("bandwidth %g -> %g bytes/s", before.bandwidth_bytes_per_s, now.bandwidth_bytes_per_s));
  if (before.speed != now.speed) add(format("speed %g -> %g", before.speed, now.speed));
  if (before.delay_s != now.delay_s) add("delay " + in_words(before.delay_s) + " -> " + in_words(now.delay_s));
  if (before.capacity != now.capacity) add("capacity " + in_words(before.capacity) + " -> " + in_words(now.capacity));
  return text;
}

Groups robots_at(const std::vector<std::uint32_t>& edge_of, std::size_t edges) {
  Groups there(edges);
  for (std::uint32_t robot = 0; robot < edge_of.size(); ++robot) there[edge_of[robot]].push_back(robot);
  return there;
}

bool has_room(const EdgeResources& edge, std::size_t robots) { return !edge.capacity || robots < *edge.capacity; }

}  // namespace

Coordinator::Coordinator(CoordinatorOptions options) : options_(std::move(options)) {}

Coordinator::KnownRobot& Coordinator::known(const RobotId& robot) {
  const auto found = robots_.find(robot);
  MAPWEAVE_EXPECT(found != robots_.end(), "robot '" + robot.str() + "' came");
  return found->second;
}

void Coordinator::receive(CoordinatorEvent event) {
  std::visit([this](auto& one) { take(one); }, event);
}

void Coordinator::take(RobotComes& comes) {
  robots_[comes.robot].is_known = comes.route.has_value();
  edge_of_[comes.robot] = comes.edge;
  if (comes.route) overlaps_.put(comes.robot, std::move(*comes.route));
  because_.push_back("robot " + comes.robot.str() + " comes");
}

void Coordinator::take(MapReport& report) {
  KnownRobot& robot = known(report.robot);
  robot.scans = report.scans;
  if (report.summary.known() > 0) {
    robot.is_known = true;
    overlaps_.put(report.robot, std::move(report.summary));
  }
  const std::string why = "maps have grown";
  if (std::find(because_.begin(), because_.end(), why) == because_.end()) because_.push_back(why);
}

void Coordinator::take(const RobotGoes& goes) {
  known(goes.robot);
  because_.push_back("robot " + goes.robot.str() + " has sensed all");
}

void Coordinator::take(const EdgeIs& edge) {
  const EdgeResources resources{edge.edge, edge.bytes_per_s, edge.speed, edge.capacity, edge.delay_s};
  const auto before = edges_.find(edge.edge);
  if (before == edges_.end()) {
    because_.push_back("edge " + edge.edge.str() + " comes");
  } else {
    const std::string what = changes(before->second, resources);
    if (what.empty()) return;
    because_.push_back("edge " + edge.edge.str() + " changed: " + what);
  }
  edges_.insert_or_assign(edge.edge, resources);
}

void Coordinator::take(const EdgeGoes& goes) {
  if (edges_.erase(goes.edge) == 0) return;
  because_.push_back("edge " + goes.edge.str() + " goes");
  for (auto& [robot, edge] : edge_of_)
    if (edge == goes.edge) edge = TierId();
}

void Coordinator::take(const LinkIs& link) {
  known(link.robot);
  const auto key = std::make_pair(link.robot, link.edge);
  const auto before = links_.find(key);
  if (before != links_.end() && before->second.bytes_per_s == link.bytes_per_s &&
      before->second.delay_s == link.delay_s)
    return;
  if (before != links_.end())
    because_.push_back("link from " + link.robot.str() + " to " + link.edge.str() + " changed");
  links_.insert_or_assign(key, scheduling::RobotLink{link.bytes_per_s, link.delay_s});
}

// Where edges cannot hold everyone, who is on one stays first; the others map on board.
std::vector<RobotId> Coordinator::those_with_room() const {
  std::size_t room = 0;
  for (const auto& [id, edge] : edges_)
    room += std::min<std::size_t>(robots_.size(), edge.capacity.value_or(robots_.size()));
  std::vector<RobotId> chosen;
  for (const bool is_placed : {true, false})
    for (const auto& [robot, edge] : edge_of_)
      if (edge.empty() != is_placed && chosen.size() < room) chosen.push_back(robot);
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

Problem Coordinator::problem(const std::vector<RobotId>& robots) {
  Problem problem;
  problem.cloud = options_.cloud;
  std::map<RobotId, std::uint32_t> index;
  for (const RobotId& robot : robots) {
    index[robot] = static_cast<std::uint32_t>(problem.robots.size());
    problem.robots.push_back(robot);
    const auto& scans = robots_.at(robot).scans;
    problem.scans.push_back(scans ? std::optional(static_cast<double>(*scans)) : std::nullopt);
  }
  std::vector<scheduling::OverlapLink> shared;
  for (const auto& [a, b, degree] : overlaps_.overlaps())
    if (index.count(a) != 0 && index.count(b) != 0) shared.push_back({index[a], index[b], degree});
  problem.overlaps = scheduling::OverlapGraph(problem.robots.size(), shared);
  for (const auto& [id, edge] : edges_) {
    for (const RobotId& robot : robots)
      if (const auto link = links_.find({robot, id}); link != links_.end())
        problem.links[{index[robot], static_cast<std::uint32_t>(problem.edges.size())}] = link->second;
    problem.edges.push_back(edge);
  }
  for (const RobotId& robot : robots) {
    const auto at = std::find_if(problem.edges.begin(), problem.edges.end(),
                                 [&](const EdgeResources& edge) { return edge.id == edge_of_.at(robot); });
    const bool has_sensed = robots_.at(robot).scans.value_or(0) > 0;
    problem.edge_of.push_back(at != problem.edges.end() && has_sensed
                                  ? std::optional(static_cast<std::uint32_t>(at - problem.edges.begin()))
                                  : std::nullopt);
  }
  return problem;
}

// As it is; who has no edge goes where it costs least, among the edges with fewest robots that have room.
Coordinator::CandidatePlan Coordinator::staying(const Latency& latency) const {
  const Problem& problem = latency.problem();
  Groups there(problem.edges.size());
  std::vector<std::uint32_t> homeless;
  CandidatePlan result;
  result.edge_of.resize(problem.robots.size());
  for (std::uint32_t robot = 0; robot < problem.robots.size(); ++robot) {
    const TierId& at = edge_of_.at(problem.robots[robot]);
    const auto edge =
        std::find_if(problem.edges.begin(), problem.edges.end(), [&](const EdgeResources& e) { return e.id == at; });
    const auto place = static_cast<std::uint32_t>(edge - problem.edges.begin());
    if (edge == problem.edges.end() || !has_room(*edge, there[place].size())) {
      homeless.push_back(robot);
    } else {
      there[place].push_back(robot);
      result.edge_of[robot] = place;
    }
  }
  for (const std::uint32_t robot : homeless) {
    std::size_t fewest = std::numeric_limits<std::size_t>::max();
    for (std::size_t edge = 0; edge < there.size(); ++edge)
      if (has_room(problem.edges[edge], there[edge].size())) fewest = std::min(fewest, there[edge].size());
    double least = std::numeric_limits<double>::infinity();
    std::uint32_t chosen = 0;
    for (std::uint32_t edge = 0; edge < there.size(); ++edge) {
      if (there[edge].size() != fewest || !has_room(problem.edges[edge], fewest)) continue;
      auto with = there[edge];
      with.insert(std::lower_bound(with.begin(), with.end(), robot), robot);
      if (const double seconds = latency.edge_seconds(with, edge); seconds < least) {
        least = seconds;
        chosen = edge;
      }
    }
    there[chosen].insert(std::lower_bound(there[chosen].begin(), there[chosen].end(), robot), robot);
    result.edge_of[robot] = chosen;
  }
  result.seconds = latency.total_seconds(there);
  return result;
}

// The best plan there is, with edges exchanged between its groups where that costs nothing and moves fewer robots.
Coordinator::CandidatePlan Coordinator::planned(const Latency& latency, CoordinatorDecision& decision) const {
  const Problem& problem = latency.problem();
  const scheduling::Plan plan = make_plan(problem, options_.plan);
  decision.lower_bound_s = plan.lower_bound_seconds;
  decision.cut_weight = plan.cut_weight;
  decision.algorithm_s = plan.algorithm_seconds;
  CandidatePlan result{plan.edge_of, plan.predicted_seconds};
  const auto moved = [&](const std::vector<std::uint32_t>& edge_of) {
    std::size_t count = 0;
    for (std::size_t robot = 0; robot < edge_of.size(); ++robot)
      count += problem.edges[edge_of[robot]].id != edge_of_.at(problem.robots[robot]);
    return count;
  };
  constexpr std::uint32_t kMostEdges = 64;  // pairs of more are not tried
  const auto edges = static_cast<std::uint32_t>(problem.edges.size());
  for (std::uint32_t a = 0; edges <= kMostEdges && a < edges; ++a)
    for (std::uint32_t b = a + 1; b < edges; ++b) {
      std::vector<std::uint32_t> exchanged = result.edge_of;
      for (std::uint32_t& edge : exchanged) edge = edge == a ? b : edge == b ? a : edge;
      if (moved(exchanged) >= moved(result.edge_of)) continue;
      const Groups there = robots_at(exchanged, edges);
      const auto holds = [&](std::uint32_t edge) {
        return !problem.edges[edge].capacity || there[edge].size() <= *problem.edges[edge].capacity;
      };
      if (!holds(a) || !holds(b)) continue;
      constexpr double kRounding = 1e-9;
      if (const double seconds = latency.total_seconds(there); seconds <= result.seconds * (1.0 + kRounding))
        result = {std::move(exchanged), seconds};
    }
  return result;
}

std::optional<CoordinatorDecision> Coordinator::decide(double now_s) {
  if (because_.empty()) return std::nullopt;
  CoordinatorDecision decision;
  decision.at_s = now_s;
  decision.because = std::exchange(because_, {});
  std::map<RobotId, TierId> chosen;
  for (const auto& [robot, edge] : edge_of_) chosen[robot] = TierId();
  if (const std::vector<RobotId> robots = those_with_room(); !robots.empty()) {
    const Problem problem = this->problem(robots);
    const Latency latency(problem, options_.plan.model);
    const CandidatePlan plan = planned(latency, decision), stay = staying(latency);
    const bool is_first =
        std::all_of(edge_of_.begin(), edge_of_.end(), [](const auto& entry) { return entry.second.empty(); });
    decision.is_new_plan = is_first || (!holds_ && plan.seconds < stay.seconds * (1.0 - options_.hysteresis));
    decision.staying_s = stay.seconds;
    decision.overlaps = overlaps_.overlaps();
    for (const RobotId& robot : robots)
      if (!robots_.at(robot).is_known) decision.unknown.push_back(robot);
    const CandidatePlan& taken = decision.is_new_plan ? plan : stay;
    decision.expected_s = taken.seconds;
    if (!decision.is_new_plan) decision.cut_weight = scheduling::cut_weight(problem.overlaps, taken.edge_of);
    for (std::size_t robot = 0; robot < robots.size(); ++robot)
      chosen[robots[robot]] = problem.edges[taken.edge_of[robot]].id;
  }
  for (const auto& [robot, edge] : chosen)
    if (edge_of_.at(robot) != edge) decision.moves.push_back({robot, edge_of_.at(robot), edge});
  edge_of_ = decision.edge_of = std::move(chosen);
  return decision;
}

}  // namespace mapweave::tiers
