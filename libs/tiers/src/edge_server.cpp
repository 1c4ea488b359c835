#include <mapweave/tiers/edge_server.h>

#include <mapweave/maps/map_update.h>

namespace mapweave::tiers {
namespace {

constexpr std::uint64_t kMapSequence = 1, kJudgementsSequence = 2;

}  // namespace

std::string first_update(const Map& map, const TierId& from) {
  MapUpdate update = difference(Map{}, map);
  update.origin = {from, map.id};
  update.sequence = kMapSequence;
  return encode(update);
}

EdgeServer::EdgeServer(TierId edge, const std::vector<RobotId>& robots, fusion::FusionOptions options)
    : edge_(edge), options_(std::move(options)), awaited_(robots.begin(), robots.end()) {}

EdgeServer::Effects EdgeServer::step(RobotOutcome outcome, WorkerPool& pool, Progress& progress) {
  if (awaited_.erase(outcome.robot) == 0)
    throw Error(ErrorCode::kBadInput, "robot '" + outcome.robot.str() + "' is not awaited here", "edge " + edge_.str());
  Effects effects;
  std::vector<Map> maps = std::move(outcome.apart);
  if (outcome.map) maps.insert(maps.begin(), std::move(*outcome.map));
  for (Map& map : maps) {
    effects.for_cloud.push_back(first_update(map, edge_));
    effects.map_bytes += effects.for_cloud.back().size();
    const MapId id = map.id;
    maps_.set(id, std::move(map));
  }
  if (!awaited_.empty()) return effects;

  effects.fused = true;
  if (maps_.empty()) return effects;
  fusion::FusionInput input;
  input.by = edge_;
  for (const auto& [id, map] : maps_) input.maps.push_back(map);
  fusion::Memo memo;
  result_ = fusion::fuse(input, options_, memo, pool, progress);

  // A judgement travels with the map that its first submap belongs to.
  for (const auto& [id, map] : maps_) {
    MapUpdate update;
    update.origin = {edge_, id};
    update.sequence = kJudgementsSequence;
    update.base = kMapSequence;
    for (const Judgement& judgement : result_.judgements)
      if (holds(map, judgement.a)) update.judgements.push_back(judgement);
    if (!update.judgements.empty()) effects.for_cloud.push_back(encode(update));
  }
  return effects;
}

}  // namespace mapweave::tiers
