#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/core/worker_pool.h>
#include <mapweave/laser/graph_mapper.h>

#include "graph_front_end.h"
#include "graph_loop_closer.h"
#include "sweep_estimator.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace mapweave::laser {
namespace {

constexpr std::size_t kMostInputs = 200000;  // that are kept to be mapped again

std::string described(const SweepEstimator& estimator) {
  const SweepEstimate& estimate = estimator.estimate();
  const auto number = [](const Estimated& one, bool counts) {
    return std::to_string(std::lround(1e3 * one.value)) + " +- " + std::to_string(std::lround(1e3 * one.sigma)) +
           " ms" + (counts ? "" : " (counts as nothing)");
  };
  std::string text =
      "the laser takes " + number(estimate.sweep_s, estimator.sweep_s() != 0.0) + " from its first ray to its last";
  if (const auto& known = estimate.by_odometry)
    text += "; its scans are stamped " + number(known->delay_s, estimator.delay_s() != 0.0) + " late";
  return text + "; from " + std::to_string(estimate.pairs) + " pairs of scans";
}

// Where the front end put a scan.
struct PlacedScan {
  ScanInput input;
  Pose2 local_from_robot;
  bool is_matched;
};

// One pass over a stream: front end and loops.
struct Mapping {
  FrontEnd front_end;
  LaserLoopCloser loops;
  Map map;  // in the local frame
  std::vector<SubmapId> frozen;
  std::size_t looked_at = 0;  // of `frozen`
  // Of a laser that sweeps, until odometry says how the robot moved meanwhile; else until a believed inertial unit says
  // how it turned.
  std::optional<ScanInput> held_back;
  std::vector<PlacedScan> placed;  // by the last add()

  Mapping(const SessionId& session, const GraphMapperOptions& options)
      : front_end(session, options.front_end, options.sweep), loops(options) {
    map.id = MapId(session.client.robot.str());
  }

  void add(const LaserInput& input) {
    placed.clear();
    if (const auto* scan = std::get_if<ScanInput>(&input)) {
      place_held_back();
      held_back = *scan;
      place_if_ready();
    } else if (const auto* inertial = std::get_if<InertialInput>(&input)) {
      front_end.add_inertial(*inertial);
      if (held_back) place_if_ready();
    } else {
      const auto& odometry = std::get<OdometryInput>(input);
      front_end.add_odometry(odometry);
      if (held_back && seconds_between(held_back->stamp, odometry.stamp) >= front_end.needs_until_s(*held_back))
        place_held_back();
    }
  }

  void place_if_ready() {
    if (front_end.needs_until_s(*held_back) <= 0.0 && !front_end.awaits_inertial(*held_back)) place_held_back();
  }

  void place_held_back() {
    if (!held_back) return;
    const ScanInput input = std::move(*held_back);
    held_back.reset();
    if (front_end.add_scan(input, map) > 0) look_for_loops();
    placed.push_back({input, front_end.local_from_last(), front_end.last_is_matched()});
  }

  void finish() {
    place_held_back();
    front_end.finish(map);
    look_for_loops();
    loops.finish(map);
  }

  void look_for_loops() {
    for (const auto& [id, submap] : map.submaps)
      if (submap.frozen && (frozen.empty() || frozen.back() < id)) frozen.push_back(id);
    // Counted before: an interruption leaves a submap that was looked at in part, which finish() looks at again.
    while (looked_at < frozen.size()) loops.add(*map.submaps.find(frozen[looked_at++]), map);
  }

  // As the last frozen submap moved.
  Pose2 map_from_local() const {
    const auto& poses = loops.map_from_submap();
    if (poses.empty()) return {};
    const NodeId anchor = map.submaps.find(frozen[poses.size() - 1])->anchor();
    return compose(poses.back(), inverse(planar(map.nodes.find(anchor)->map_from_node)));
  }

  // Every node as the submap it was matched in moved.
  Map moved() const {
    Map result = map;
    const auto& poses = loops.map_from_submap();
    if (poses.empty()) return result;
    std::size_t current = 0;
    std::vector<Pose2> map_from_local;
    for (std::size_t i = 0; i < poses.size(); ++i)
      map_from_local.push_back(
          compose(poses[i], inverse(planar(map.nodes.find(map.submaps.find(frozen[i])->anchor())->map_from_node))));
    for (auto& [id, node] : result.nodes) {
      while (current + 1 < poses.size() && !(id < map.submaps.find(frozen[current + 1])->anchor())) ++current;
      node.map_from_node = spatial(compose(map_from_local[current], planar(node.map_from_node)));
    }
    for (const auto& constraint : loops.loops()) result.constraints.set(constraint.id, constraint);
    return result;
  }
};

}  // namespace

struct GraphMapper::State {
  ClientId client;
  GraphMapperOptions options;
  std::optional<SessionId> session;  // named by the first scan or odometry
  std::unique_ptr<Mapping> mapping;
  Map map;  // empty before finish()
  bool finished = false;
  SweepEstimator estimator;
  bool is_estimating;
  std::vector<LaserInput> inputs;  // all of them, while it is not known whether the laser sweeps
  std::shared_ptr<const ScanGeometry> unswept, with_sweep;  // a geometry as it comes, and with the estimated sweep
  std::vector<std::string> notes;                           // after finish()
  std::vector<LivePose> live;                               // not taken yet
  bool has_live = false;                                    // there was one

  State(ClientId c, const GraphMapperOptions& o)
      : client(c), options(o), estimator(o.sweep), is_estimating(o.sweep.estimate) {
    map.id = MapId(c.robot.str());
  }

  void add(const LaserInput& input) {
    if (!session) {
      if (std::holds_alternative<InertialInput>(input)) return;
      session = SessionId{client, std::visit([](const auto& one) { return one.stamp.ns; }, input)};
      mapping = std::make_unique<Mapping>(*session, options);
    }
    const auto* scan = std::get_if<ScanInput>(&input);
    const bool is_known = scan != nullptr && scan->scan.geometry->has_sweep();
    if (is_known || inputs.size() >= kMostInputs) {
      is_estimating = false;
      inputs = {};
    }
    if (is_estimating) inputs.push_back(input);
    mapping->add(swept(input));
    for (const PlacedScan& one : mapping->placed) {
      live.push_back({one.input.stamp, spatial(compose(mapping->map_from_local(), one.local_from_robot)),
                      one.is_matched || !has_live});
      has_live = true;
    }
    if (!is_estimating) return;
    if (const auto* odometry = std::get_if<OdometryInput>(&input))
      estimator.add_odometry(odometry->stamp, planar(odometry->odometry_from_robot));
    if (mapping->placed.empty()) return;
    for (const PlacedScan& one : mapping->placed)
      estimator.add(one.input.stamp, one.input.scan, one.local_from_robot, one.is_matched);
    if (estimator.is_decided()) restart();
  }

  void note_inertial() {
    const InertialCalibration& calibration = mapping->front_end.calibration();
    if (calibration.is_known())
      log(LogLevel::debug, "robot " + client.robot.str() + ": inertial unit " + calibration.described());
    if (const auto doubt = calibration.doubt()) notes.push_back("the inertial unit: " + *doubt);
  }

  void note_folds() {
    const std::size_t folding = mapping->loops.folding_loops();
    if (folding > 0)
      notes.push_back(std::to_string(folding) +
                      " loop closures between places that look alike are not used, since they would lead the robot "
                      "through walls; where one is right all the same, walls stand double");
  }

  // The sweep is known now. Where there is one, what was mapped without it is mapped again.
  void restart() {
    is_estimating = false;
    const std::vector<LaserInput> again = std::move(inputs);
    inputs = {};
    const bool is_needed = estimator.sweep_s() != 0.0 || estimator.delay_s() != 0.0;
    log(is_needed ? LogLevel::info : LogLevel::debug, "robot " + client.robot.str() + ": " + described(estimator));
    if (!is_needed) return;
    if (estimator.delay_s() != 0.0) options.sweep.delay_s = estimator.delay_s();
    mapping = std::make_unique<Mapping>(*session, options);
    for (const LaserInput& input : again) mapping->add(swept(input));
  }

  // A scan whose laser is known to sweep, as estimated.
  LaserInput swept(const LaserInput& input) {
    const auto* scan = std::get_if<ScanInput>(&input);
    if (scan == nullptr || is_estimating || estimator.sweep_s() == 0.0 || scan->scan.geometry->has_sweep() ||
        scan->scan.geometry->ray_count < 2)
      return input;
    if (unswept != scan->scan.geometry) {
      unswept = scan->scan.geometry;
      auto geometry = std::make_shared<ScanGeometry>(*unswept);
      // The delay is that of the middle of the sweep.
      geometry->first_ray_s = -0.5 * estimator.sweep_s();
      geometry->ray_step_s = estimator.sweep_s() / (geometry->ray_count - 1);
      with_sweep = std::move(geometry);
    }
    ScanInput result = *scan;
    result.scan.geometry = with_sweep;
    return result;
  }
};

GraphMapper::GraphMapper(ClientId client, const GraphMapperOptions& options)
    : state_(std::make_unique<State>(client, options)) {}
GraphMapper::~GraphMapper() = default;

void GraphMapper::add(const LaserInput& input) {
  MAPWEAVE_EXPECT(!state_->finished, "nothing is added after finish()");
  state_->add(input);
}

void GraphMapper::finish() {
  State& state = *state_;
  MAPWEAVE_EXPECT(!state.finished, "finish() is called once");
  state.finished = true;
  if (!state.mapping) return;
  if (state.is_estimating) {
    state.estimator.finish();
    state.restart();
  }
  state.mapping->finish();
  state.note_inertial();
  state.note_folds();
  state.map = state.mapping->moved();
  state.mapping.reset();
  graph::optimise(state.map, state.options.solve);
  WorkerPool pool(1);
  for (int round = 0; round < 2; ++round) {
    // Those of the round before are made anew; a log of hours has 100,000 and more, so no two copies are kept for long.
    std::vector<Constraint> all;
    for (auto& [id, constraint] : state.map.constraints)
      if (id.index == 0) all.push_back(std::move(constraint));
    state.map.constraints = {};
    {
      const auto again = matching::rematch(state.map, state.options.rematch, pool);
      all.insert(all.end(), again.begin(), again.end());
    }
    std::sort(all.begin(), all.end(), [](const Constraint& a, const Constraint& b) { return a.id < b.id; });
    state.map.constraints.reserve(all.size());
    for (auto& constraint : all) {
      const ConstraintId id = constraint.id;
      state.map.constraints.set(id, std::move(constraint));
    }
    all = {};
    graph::optimise(state.map, state.options.solve);
  }
}

std::vector<LivePose> GraphMapper::take_live_poses() { return std::exchange(state_->live, {}); }

std::vector<std::string> GraphMapper::notes() const { return state_->notes; }

Map GraphMapper::snapshot() const { return state_->mapping ? state_->mapping->moved() : state_->map; }

}  // namespace mapweave::laser
