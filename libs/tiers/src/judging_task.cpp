#include "part_of_map.h"

#include <mapweave/maps/map_update.h>
#include <mapweave/tiers/edge_server.h>

#include <algorithm>
#include <map>

namespace mapweave::tiers {
namespace {

fusion::FirstPair as_judged(const PairToJudge& sent) {
  fusion::FirstPair pair{sent.a, sent.b, {}, sent.have_cameras};
  for (const SubmapsToJudge& submaps : sent.submaps)
    pair.submaps.push_back(
        {submaps.a, submaps.b, {submaps.a_from_b, submaps.radius_m, submaps.yaw_rad, submaps.known_part}});
  return pair;
}

}  // namespace

// These submaps with their nodes.
Map part_of(const Map& map, const std::set<SubmapId>& submaps) {
  Map part;
  part.id = map.id;
  std::set<NodeId> nodes;
  for (const SubmapId& id : submaps) {
    const Submap& submap = *map.submaps.find(id);
    for (const auto& member : submap.submap_from_node) nodes.insert(member.first);
    part.submaps.set(id, submap);
  }
  for (const NodeId& id : nodes) part.nodes.set(id, *map.nodes.find(id));
  return part;
}

PairToJudge as_sent(const fusion::FirstPair& pair) {
  PairToJudge sent{pair.a, pair.b, {}, pair.have_cameras};
  for (const fusion::SubmapPair& submaps : pair.submaps) {
    const matching::WideWindow& window = submaps.a_from_b;
    sent.submaps.push_back({submaps.a, submaps.b, window.a_from_b, window.radius_m, window.yaw_rad, window.known_part});
  }
  return sent;
}

Map map_in(std::string_view bytes, const std::string& where) {
  const MapUpdate update = decode_map_update(bytes, where);
  Map map;
  map.id = update.origin.map;
  return updated(std::move(map), update);
}

JudgingWork first_work(fusion::FusionInput input, const fusion::FusionOptions& options, WorkerPool& pool) {
  JudgingWork work;
  for (const fusion::FirstPair& pair : fusion::first_pairs(input, options, pool)) work.pairs.push_back(as_sent(pair));
  work.maps = std::move(input.maps);
  return work;
}

std::vector<JudgingTask> shared_out(const JudgingWork& work, std::size_t most) {
  std::map<MapId, const Map*> maps;
  for (const Map& map : work.maps) maps.emplace(map.id, &map);
  const auto size_of = [&](const PairToJudge& pair) {
    return std::uint64_t{maps.at(pair.a)->nodes.size()} * maps.at(pair.b)->nodes.size();
  };
  std::vector<const PairToJudge*> pairs;
  for (const PairToJudge& pair : work.pairs) pairs.push_back(&pair);
  std::stable_sort(pairs.begin(), pairs.end(),
                   [&](const PairToJudge* one, const PairToJudge* other) { return size_of(*one) > size_of(*other); });
  struct Load {
    std::uint64_t size = 0;
    std::vector<PairToJudge> pairs;
  };
  std::vector<Load> loads(std::min(most, pairs.size()));
  for (const PairToJudge* pair : pairs) {
    Load& least = *std::min_element(loads.begin(), loads.end(),
                                    [](const Load& one, const Load& other) { return one.size < other.size; });
    least.size += size_of(*pair);
    least.pairs.push_back(*pair);
  }
  std::vector<JudgingTask> tasks;
  for (const Load& load : loads) {
    std::map<MapId, std::set<SubmapId>> needed;
    std::set<MapId> whole;
    for (const PairToJudge& pair : load.pairs) {
      if (pair.have_cameras) whole.insert({pair.a, pair.b});
      needed[pair.a];
      needed[pair.b];
      for (const SubmapsToJudge& submaps : pair.submaps) {
        needed[pair.a].insert(submaps.a);
        needed[pair.b].insert(submaps.b);
      }
    }
    JudgingTask& task = tasks.emplace_back();
    task.pairs = mapweave::encode(load.pairs);
    for (const auto& [id, submaps] : needed)
      task.updates.push_back(
          first_update(whole.count(id) != 0 ? *maps.at(id) : part_of(*maps.at(id), submaps), TierId("judging")));
  }
  return tasks;
}

JudgingWork work_of(const JudgingTask& task, const std::string& where) {
  JudgingWork work{decode_pairs_to_judge(task.pairs, where), {}};
  std::set<MapId> needed, there;
  for (const PairToJudge& pair : work.pairs) needed.insert({pair.a, pair.b});
  for (const std::string& bytes : task.updates) {
    work.maps.push_back(map_in(bytes, where));
    there.insert(work.maps.back().id);
  }
  if (there != needed || work.maps.size() != needed.size())
    throw Error(ErrorCode::kBadInput, "the maps that were sent along are not those to be judged", where);
  return work;
}

std::vector<Judgement> judge(JudgingWork work, const fusion::FusionOptions& options,
                             std::shared_ptr<matching::ModelCache> models, WorkerPool& pool, Progress& progress) {
  fusion::FusionInput input;
  input.maps = std::move(work.maps);
  input.models = std::move(models);
  std::vector<fusion::FirstPair> pairs;
  for (const PairToJudge& pair : work.pairs) pairs.push_back(as_judged(pair));
  fusion::Memo memo;
  return fusion::judge_pairs(input, pairs, options, memo, pool, progress);
}

std::string encode(const std::vector<Judgement>& judgements) {
  MapUpdate update;
  update.origin = {TierId("judging"), MapId("judged")};
  update.sequence = 1;
  update.judgements = judgements;
  return mapweave::encode(update);
}

std::vector<Judgement> decode_judgements(std::string_view bytes, const std::string& where) {
  return decode_map_update(bytes, where).judgements;
}

}  // namespace mapweave::tiers
