#include "fusion_rounds.h"

#include "metered_tiers.h"
#include "plan/log_parts.h"

#include <mapweave/runtime/merge_requests.h>

#include <algorithm>
#include <cmath>

namespace mapweave::runtime {
namespace {

constexpr double kLook_s = 1.0;  // between two looks at whether there is new area

RoundWork::Fused described(const TierId& tier, const tiers::RoundMerger& merger) {
  RoundWork::Fused line;
  line.tier = tier;
  line.maps = merger.maps().size();
  for (const fusion::Component& component : merger.result().components)
    if (component.members.size() > 1) line.joint.push_back(component.members);
  for (const Verdict& verdict : merger.result().verdicts)
    if (verdict.decision != Decision::deferred && verdict.reason != Reason::excluded)
      line.pairs.push_back({verdict.a, verdict.b, verdict.decision, verdict.reason, verdict.probability});
  return line;
}

}  // namespace

void ChosenPictures::offer(std::size_t round, const Map& joint) {
  if (most_ == 0) return;
  maps_[round] = joint;
  if (maps_.size() <= most_) return;
  // The one whose neighbours lie nearest to each other goes; of a single one, the older.
  auto gone = maps_.begin();
  std::size_t narrowest = ~std::size_t{0};
  for (auto it = std::next(maps_.begin()); it != maps_.end() && std::next(it) != maps_.end(); ++it)
    if (const std::size_t gap = std::next(it)->first - std::prev(it)->first; gap < narrowest) {
      narrowest = gap;
      gone = it;
    }
  maps_.erase(gone);
}

double SeenArea::add_m2(const Map& part) {
  // As a coordinator's summaries: scans between add little, and one wrong reading must not add an area.
  constexpr double kCell_m = 0.25, kMoved_m = 0.4, kTurned_rad = 0.5, kFarthest_m = 100.0;
  const std::size_t before = cells_.size();
  for (const auto& [id, node] : part.nodes) {
    if (last_ && !(*last_ < id)) continue;
    const Pose2 pose = planar(node.map_from_node);
    if (last_ && std::hypot(pose.x - last_pose_.x, pose.y - last_pose_.y) < kMoved_m &&
        std::abs(wrap_angle(pose.phi - last_pose_.phi)) < kTurned_rad)
      continue;
    last_ = id;
    last_pose_ = pose;
    const double c = std::cos(pose.phi), s = std::sin(pose.phi);
    for (const ScanPoint& point : points_in_robot(std::get<PackedScan>(*node.payload))) {
      const double length_m = std::hypot(point.x, point.y);
      if (length_m > kFarthest_m) continue;
      for (double path_m = 0.0; path_m < length_m; path_m += kCell_m) {
        const double x = point.x * path_m / length_m, y = point.y * path_m / length_m;
        cells_.emplace(static_cast<std::int32_t>(std::floor((pose.x + c * x - s * y) / kCell_m)),
                       static_cast<std::int32_t>(std::floor((pose.y + s * x + c * y) / kCell_m)));
      }
    }
  }
  return kCell_m * kCell_m * static_cast<double>(cells_.size() - before);
}

FusionRounds::FusionRounds(const RunConfiguration& configuration, const RunPlan& plan)
    : configuration_(configuration),
      plan_(plan),
      options_(configuration.cloud.rounds),
      cloud_(cloud_tier(), configuration.fusion),
      pictures_(static_cast<std::size_t>(configuration.cloud.rounds.pictures)) {}

double FusionRounds::next_s(double due_s) const {
  double step_s = options_.period_s > 0.0 ? options_.period_s : kLook_s;
  if (options_.new_area_m2 > 0.0) step_s = std::min(step_s, kLook_s);
  return step_s * (1.0 + std::max(std::round(looked_s_ / step_s), std::floor(due_s / step_s)));
}

void FusionRounds::read_maps(double now_s, LasersInStep& lasers, WorkerPool& pool) {
  const std::vector<Map> parts = pool.map(lasers.size(), [&](std::size_t i) {
    Map part = lasers.has_come(i, now_s) ? tiers::growing_part(lasers.task(i).map_so_far()) : Map();
    if (!part.empty()) part.id = MapId(lasers.robot(i).id.str());
    return part;
  });
  for (std::size_t i = 0; i < lasers.size(); ++i)
    if (!parts[i].empty()) robots_[lasers.robot(i).id].part = parts[i];
}

bool FusionRounds::is_due(double now_s, LasersInStep& lasers, WorkerPool& pool) {
  constexpr double kRounding_s = 1e-6;  // sums of periods are off by less
  const bool by_time = options_.period_s > 0.0 && now_s >= last_round_s_ + options_.period_s - kRounding_s;
  if (options_.new_area_m2 > 0.0 || by_time) read_maps(now_s, lasers, pool);
  if (options_.new_area_m2 > 0.0)
    for (auto& [id, robot] : robots_) new_area_m2_ += robot.seen.add_m2(robot.part);
  return by_time || (options_.new_area_m2 > 0.0 && new_area_m2_ >= options_.new_area_m2);
}

void FusionRounds::step(double now_s, LasersInStep& lasers, WorkerPool& pool) {
  looked_s_ = now_s;
  report_.recorded_s = now_s;
  const double before_s = process_cpu_seconds();
  if (is_due(now_s, lasers, pool)) {
    last_round_s_ = now_s;
    new_area_m2_ = 0.0;
    RoundWork round;
    round.at_s = now_s;
    for (std::size_t i = 0; i < lasers.size(); ++i)
      if (robots_.count(lasers.robot(i).id) != 0) send(lasers.robot(i), lasers.task(i), round);
    set_priors();
    fuse_on_edges(round, pool);
    fuse_in_cloud(round, pool);
    if (!round.fused.empty()) keep_picture(report_.rounds.size());
    report_.rounds.push_back(std::move(round));
  }
  report_.cpu_seconds += process_cpu_seconds() - before_s;
}

// Of a robot that maps on board what is new of its map; of another one its edge has the map, and what it sensed is
// counted.
void FusionRounds::send(const PlannedRobot& planned, LaserTask& task, RoundWork& round) {
  Robot& robot = robots_.at(planned.id);
  const MapId& map = robot.part.id;
  const TierId at = configuration_.mode == Mode::cloud_only ? TierId() : planned.edge;
  if (robot.is_known && robot.at != at) {
    robot.at.empty() ? cloud_.forget(map) : edges_.at(robot.at).forget(map);
    robot.is_known = false;
  }
  const bool is_new = !robot.is_known;
  robot.at = at;
  robot.is_known = true;
  if (!at.empty() && edges_.count(at) == 0) edges_.emplace(at, tiers::RoundMerger(at, configuration_.fusion));
  if (!at.empty() && configuration_.mode == Mode::offload) {
    const std::uint64_t sensed = task.sensed_bytes(), counted = is_new ? 0 : robot.sensed_bytes;
    if (sensed > counted) round.robots.push_back({planned.id, at, sensed - counted});
    robot.sensed_bytes = sensed;
    edges_.at(at).put(robot.part);
    return;
  }
  if (is_new) robot.sender.emplace(TierId(planned.id.str()));
  const auto update = robot.sender->next(robot.part);
  if (!update) return;
  round.robots.push_back({planned.id, at, update->size()});
  (at.empty() ? cloud_ : edges_.at(at)).receive(*update, "a round of robot " + planned.id.str());
}

// Where starts are known, and of parts of one log, which follow each other.
void FusionRounds::set_priors() {
  std::vector<StartedMap> started;
  std::vector<tiers::RobotOutcome> parts;
  for (const PlannedRobot& planned : plan_.robots) {
    const auto robot = robots_.find(planned.id);
    if (robot == robots_.end()) continue;
    if (planned.part) parts.push_back({planned.id, robot->second.part, std::nullopt});
    if (!planned.part || planned.part->number == 1)
      started.push_back({&robot->second.part, robot_entry(configuration_, planned.robot()).start});
  }
  std::vector<fusion::MapPrior> priors = priors_of_starts(started);
  const auto of_parts = priors_of_parts(plan_, parts);
  priors.insert(priors.end(), of_parts.begin(), of_parts.end());
  std::set<std::pair<MapId, MapId>> refused;
  for (const auto& [a, b] : plan_.refused) refused.insert(std::minmax(MapId(a.str()), MapId(b.str())));
  for (auto& [id, edge] : edges_) {
    edge.set_priors(priors);
    edge.set_refused(refused);
  }
  cloud_.set_priors(std::move(priors));
  cloud_.set_refused(std::move(refused));
}

void FusionRounds::fuse_on_edges(RoundWork& round, WorkerPool& pool) {
  const std::unique_ptr<Progress> silent = make_silent_progress();
  for (auto& [id, edge] : edges_) {
    if (!edge.has_news()) continue;
    double fusing_s = 0.0;
    const tiers::RoundNews news = metered(fusing_s, [&, &edge = edge] {
      edge.fuse(pool, *silent);
      return edge.news();
    });
    round.fused.push_back(described(id, edge));
    round.fused.back().fusing_s = fusing_s;
    round.fused.back().bytes = news.bytes();
    round.fused.back().speed = edge_entry(configuration_, id).speed;
    cloud_.receive(news, id);
  }
}

// Where all maps are on one edge, its preview is the cloud's.
void FusionRounds::fuse_in_cloud(RoundWork& round, WorkerPool& pool) {
  const auto has_all = [&](const auto& entry) { return entry.second.maps().size() == cloud_.maps().size(); };
  const auto only = std::find_if(edges_.begin(), edges_.end(), has_all);
  if (only == edges_.end()) {
    if (!cloud_.has_news()) return;
    const std::unique_ptr<Progress> silent = make_silent_progress();
    double fusing_s = 0.0;
    metered(fusing_s, [&] { cloud_.fuse(pool, *silent); });
    round.fused.push_back(described(cloud_tier(), cloud_));
    round.fused.back().fusing_s = fusing_s;
  } else if (!round.fused.empty()) {
    round.fused.push_back(described(cloud_tier(), only->second));
  }
}

// The largest joint map of the highest tier that has one.
void FusionRounds::keep_picture(std::size_t round) {
  const fusion::Component* largest = nullptr;
  const auto look = [&](const tiers::RoundMerger& merger) {
    for (const fusion::Component& component : merger.result().components)
      if (component.members.size() > (largest != nullptr ? largest->members.size() : 1)) largest = &component;
  };
  look(cloud_);
  for (const auto& entry : edges_) look(entry.second);
  if (largest != nullptr) pictures_.offer(round, largest->map);
}

RoundsReport FusionRounds::take_report() {
  report_.pictures = pictures_.take();
  return std::move(report_);
}

}  // namespace mapweave::runtime
