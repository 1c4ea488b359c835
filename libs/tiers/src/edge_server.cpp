#include <mapweave/tiers/edge_server.h>

#include "maps_in_doubt.h"
#include "part_of_map.h"

#include <mapweave/maps/map_update.h>
#include <mapweave/maps/merged_maps.h>

#include <algorithm>

namespace mapweave::tiers {
std::string first_update(const Map& map, const TierId& from, std::uint64_t sequence, bool in_floats) {
  MapUpdate update = difference(Map{}, map);
  update.origin = {from, map.id};
  update.sequence = sequence;
  update.in_floats = in_floats;
  return encode(update);
}

EdgeServer::EdgeServer(TierId edge, const std::vector<RobotId>& robots, fusion::FusionOptions options,
                       EdgeMapOptions sent)
    : edge_(edge),
      options_(std::move(options)),
      sent_options_(sent),
      awaited_(robots.begin(), robots.end()),
      models_(fusion::make_models(options_)) {}

EdgeServer::Effects EdgeServer::step(RobotOutcome outcome, WorkerPool& pool, Progress& progress) {
  if (awaited_.erase(outcome.robot) == 0)
    throw Error(ErrorCode::kBadInput, "robot '" + outcome.robot.str() + "' is not awaited here", "edge " + edge_.str());
  Effects effects;
  std::vector<Map> maps = std::move(outcome.apart);
  if (outcome.map) maps.insert(maps.begin(), std::move(*outcome.map));
  for (Map& map : maps) {
    std::string whole = first_update(map, edge_);
    effects.map_bytes += whole.size();
    if (!sent_options_.thin) effects.for_cloud.push_back(std::move(whole));
    const MapId id = map.id;
    sequence_[id] = 1;
    maps_.set(id, std::move(map));
  }
  if (!awaited_.empty()) return effects;

  effects.fused = true;
  if (maps_.empty()) return effects;
  fusion::FusionInput input = this->input();
  for (const auto& [id, map] : maps_) input.maps.push_back(map);
  result_ = fusion::fuse(input, options_, memo_, pool, progress);
  memo_.clear();
  models_->clear();  // the next who needs memory is the cloud

  if (sent_options_.thin) {
    send_thinned(effects);
    // What all scans could not decide here the cloud must not decide by some of them.
    const std::set<MapId> doubted = maps_in_doubt(result_);
    for (std::string& update : whole_maps({doubted.begin(), doubted.end()}).for_cloud)
      effects.for_cloud.push_back(std::move(update));
  }
  for (std::string& update : updates_of(result_.judgements)) effects.for_cloud.push_back(std::move(update));
  return effects;
}

// Maps that cannot be thinned are sent as they are.
void EdgeServer::send_thinned(Effects& effects) {
  for (const fusion::Component& component : result_.components) {
    std::vector<const Map*> members;
    for (const MapId& id : component.members) members.push_back(maps_.find(id));
    if ((members.size() > 1 && !component.merged) ||
        !std::all_of(members.begin(), members.end(), [](const Map* map) { return fusion::can_be_thinned(*map); })) {
      for (const Map* map : members) effects.for_cloud.push_back(first_update(*map, edge_));
      continue;
    }
    fusion::ThinnedMaps sent = fusion::thinned(component, members, sent_options_.thinning);
    thinning_.scans += sent.scans;
    thinning_.kept += sent.kept;
    thinning_.walls_left_out = std::max(thinning_.walls_left_out, sent.walls_left_out);
    for (Map& map : sent.maps) {
      effects.for_cloud.push_back(first_update(map, edge_, 1, true));
      const MapId id = map.id;
      thinned_.set(id, std::move(map));
    }
    if (sent.merged) effects.merged.push_back(encode(*sent.merged));
  }
}

EdgeServer::Effects EdgeServer::whole_maps(const std::vector<MapId>& maps) {
  Effects effects;
  for (const MapId& id : maps)
    if (const Map* map = maps_.find(id); map != nullptr && thinned_.erase(id))
      effects.for_cloud.push_back(first_update(*map, edge_, ++sequence_.at(id)));
  return effects;
}

const Map* EdgeServer::as_sent(const MapId& id) const {
  const Map* map = thinned_.find(id);
  return map != nullptr ? map : maps_.find(id);
}

EdgeServer::Effects EdgeServer::step(const RobotUpdates& sent, WorkerPool& pool, Progress& progress) {
  RobotOutcome outcome{sent.robot, std::nullopt, std::nullopt};
  for (const std::string& bytes : sent.updates) {
    Map map = map_in(bytes, "a map of robot " + sent.robot.str());
    if (!outcome.map)
      outcome.map = std::move(map);
    else
      outcome.apart.push_back(std::move(map));
  }
  return step(std::move(outcome), pool, progress);
}

// A judgement travels with the first of the maps here that it is about; one of contents that the cloud does not have
// is of no use there.
std::vector<std::string> EdgeServer::updates_of(const std::vector<Judgement>& judgements) {
  std::map<MapId, MapUpdate> updates;
  const auto is_known_otherwise = [&](const SubmapId& id, const Hash& content) {
    for (const auto& entry : thinned_)
      if (const Submap* submap = entry.second.submaps.find(id)) return submap->content != content;
    return false;
  };
  for (const Judgement& judgement : judgements) {
    if (is_known_otherwise(judgement.a, judgement.content_a) || is_known_otherwise(judgement.b, judgement.content_b))
      continue;
    for (const auto& [id, map] : maps_)
      if (holds(map, judgement.a) || holds(map, judgement.b)) {
        updates[id].judgements.push_back(judgement);
        break;
      }
  }
  std::vector<std::string> encoded;
  for (auto& [id, update] : updates) {
    update.origin = {edge_, id};
    update.base = sequence_.at(id);
    update.sequence = ++sequence_.at(id);
    encoded.push_back(encode(update));
  }
  return encoded;
}

JudgingWork EdgeServer::work_of(const JudgingTask& task) const {
  JudgingWork work{decode_pairs_to_judge(task.pairs, "what edge " + edge_.str() + " is to judge"), {}};
  std::set<MapId> needed;
  for (const PairToJudge& pair : work.pairs) {
    if (!maps_.contains(pair.a) && !maps_.contains(pair.b))
      throw Error(ErrorCode::kBadInput, "neither map '" + pair.a.str() + "' nor '" + pair.b.str() + "' is here",
                  "edge " + edge_.str());
    needed.insert({pair.a, pair.b});
  }
  for (const MapId& id : needed)
    if (const Map* map = as_sent(id)) work.maps.push_back(*map);
  for (const std::string& bytes : task.updates) {
    Map map = map_in(bytes, "a map sent to edge " + edge_.str());
    if (needed.count(map.id) != 0 && !maps_.contains(map.id)) work.maps.push_back(std::move(map));
  }
  if (work.maps.size() != needed.size())
    throw Error(ErrorCode::kBadInput, "a map to be judged was not sent along", "edge " + edge_.str());
  return work;
}

EdgeServer::Effects EdgeServer::step(const JudgingTask& task, WorkerPool& pool, Progress& progress) {
  return step(judge(work_of(task), options_, models_, pool, progress));
}

EdgeServer::Effects EdgeServer::step(const std::vector<Judgement>& judgements) {
  Effects effects;
  effects.for_cloud = updates_of(judgements);
  return effects;
}

JudgingWork EdgeServer::first_work(const std::vector<const Map*>& maps, WorkerPool& pool) const {
  fusion::FusionInput first = input();
  for (const Map* map : maps) first.maps.push_back(*map);
  return tiers::first_work(std::move(first), options_, pool);
}

fusion::FusionInput EdgeServer::input() const {
  fusion::FusionInput input;
  input.by = edge_;
  input.priors = priors_;
  input.refused = refused_;
  input.models = models_;
  return input;
}

}  // namespace mapweave::tiers
