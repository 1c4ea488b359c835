#include <mapweave/core/error.h>
#include <mapweave/core/worker_pool.h>
#include <mapweave/laser/graph_mapper.h>

#include "graph_front_end.h"
#include "graph_loop_closer.h"

#include <algorithm>

namespace mapweave::laser {

struct GraphMapper::State {
  ClientId client;
  GraphMapperOptions options;
  std::optional<FrontEnd> front_end;  // once the first observation has named the session
  LoopCloser loops;
  Map map;  // in the local frame until finish()
  std::vector<SubmapId> frozen;
  std::size_t looked_at = 0;  // of `frozen`
  bool finished = false;

  State(ClientId c, const GraphMapperOptions& o) : client(c), options(o), loops(o) { map.id = MapId(c.robot.str()); }

  void look_for_loops() {
    for (const auto& [id, submap] : map.submaps)
      if (submap.frozen && (frozen.empty() || frozen.back() < id)) frozen.push_back(id);
    for (; looked_at < frozen.size(); ++looked_at) loops.add(*map.submaps.find(frozen[looked_at]), map);
  }

  // Every node as the submap it was matched in moved.
  Map moved() const {
    Map result = map;
    const auto& poses = loops.map_from_submap();
    if (poses.empty()) return result;
    std::size_t current = 0;
    std::vector<Pose2> map_from_local;
    for (std::size_t i = 0; i < poses.size(); ++i)
      map_from_local.push_back(compose(poses[i], inverse(planar(map.nodes.find(map.submaps.find(frozen[i])->anchor())->map_from_node))));
    for (auto& [id, node] : result.nodes) {
      while (current + 1 < poses.size() && !(id < map.submaps.find(frozen[current + 1])->anchor())) ++current;
      node.map_from_node = spatial(compose(map_from_local[current], planar(node.map_from_node)));
    }
    for (const auto& constraint : loops.loops()) result.constraints.set(constraint.id, constraint);
    return result;
  }
};

GraphMapper::GraphMapper(ClientId client, const GraphMapperOptions& options) : state_(std::make_unique<State>(client, options)) {}
GraphMapper::~GraphMapper() = default;

void GraphMapper::add(const LaserInput& input) {
  State& state = *state_;
  MAPWEAVE_EXPECT(!state.finished, "nothing is added after finish()");
  const Stamp stamp = std::visit([](const auto& one) { return one.stamp; }, input);
  if (!state.front_end) state.front_end.emplace(SessionId{state.client, stamp.ns}, state.options.front_end);
  if (const auto* odometry = std::get_if<OdometryInput>(&input)) {
    state.front_end->add_odometry(*odometry);
    return;
  }
  if (state.front_end->add_scan(std::get<ScanInput>(input), state.map) > 0) state.look_for_loops();
}

void GraphMapper::finish() {
  State& state = *state_;
  MAPWEAVE_EXPECT(!state.finished, "finish() is called once");
  state.finished = true;
  if (!state.front_end) return;
  state.front_end->finish(state.map);
  state.look_for_loops();
  state.loops.finish(state.map);
  state.map = state.moved();
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

Map GraphMapper::snapshot() const { return state_->finished ? state_->map : state_->moved(); }

}  // namespace mapweave::laser
