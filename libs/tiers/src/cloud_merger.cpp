#include <mapweave/core/error.h>
#include <mapweave/tiers/cloud_merger.h>
#include <mapweave/tiers/edge_server.h>

#include "maps_in_doubt.h"
#include "part_of_map.h"

#include <algorithm>
#include <cstdint>
#include <iterator>

namespace mapweave::tiers {
namespace {

std::string quoted(const std::vector<MapId>& maps) {
  std::string names;
  for (const MapId& id : maps) names += (names.empty() ? "'" : ", '") + id.str() + "'";
  return names;
}

// The edge left scans out.
bool is_thinned(const Map& map) {
  return std::any_of(map.nodes.begin(), map.nodes.end(),
                     [](const auto& entry) { return entry.second.payload == nullptr; });
}

}  // namespace

CloudMerger::CloudMerger(TierId cloud, fusion::FusionOptions options)
    : cloud_(cloud), options_(std::move(options)), models_(fusion::make_models(options_)) {}

Receipt CloudMerger::receive(std::string_view bytes, const std::string& where) {
  MapUpdate update = decode_map_update(bytes, where);
  const Origin origin = update.origin;
  const auto known = inboxes_.find(origin.map);
  if (known != inboxes_.end() && known->second.receipt().origin.tier != origin.tier)
    throw Error(ErrorCode::kBadInput,
                "map '" + origin.map.str() + "' comes from '" + origin.tier.str() + "' and from '" +
                    known->second.receipt().origin.tier.str() + "'",
                where, "each robot ships to exactly one edge");
  if (known != inboxes_.end() && update.base == 0 && update.sequence > known->second.receipt().stored) {
    came_whole_.insert(origin.map);
    is_newer_ = true;
    if (taken_apart_.count(origin.map) != 0)
      merged_.erase(std::remove_if(merged_.begin(), merged_.end(),
                                   [&](const MergedMaps& merged) {
                                     return std::binary_search(merged.members.begin(), merged.members.end(),
                                                               origin.map);
                                   }),
                    merged_.end());
  }
  UpdateInbox fresh(origin);
  UpdateInbox& inbox = known != inboxes_.end() ? known->second : fresh;
  for (const MapUpdate& stored : inbox.receive(std::move(update), bytes.size(), where))
    for (const Judgement& judgement : stored.judgements) memo_.emplace(judgement.id, judgement);
  if (known == inboxes_.end()) return inboxes_.emplace(origin.map, std::move(fresh)).first->second.receipt();
  return inbox.receipt();
}

void CloudMerger::receive_merged(std::string_view bytes, const std::string& where) {
  merged_.push_back(decode_merged_maps(bytes, where));
}

std::map<TierId, std::vector<MapId>> CloudMerger::wanted_as_whole(const fusion::FusionResult& result) {
  std::map<TierId, std::vector<MapId>> wanted;
  const auto ask = [&](const MapId& id) {
    if (asked_.insert(id).second && came_whole_.count(id) == 0) wanted[edge_of(id)].push_back(id);
  };
  for (const std::vector<MapId>& members : result.reopened)
    for (const MapId& id : members) {
      taken_apart_.insert(id);
      ask(id);
    }
  for (const MapId& id : maps_in_doubt(result)) {
    const auto inbox = inboxes_.find(id);  // none: of a session before
    if (inbox != inboxes_.end() && is_thinned(inbox->second.map())) ask(id);
  }
  return wanted;
}

TierId CloudMerger::edge_of(const MapId& id) const { return inboxes_.at(id).receipt().origin.tier; }

std::vector<std::string> CloudMerger::notes(const fusion::FusionResult& result) const {
  std::set<TierId> senders;
  std::map<TierId, std::vector<MapId>> apart, in_doubt;
  const std::set<MapId> doubted = maps_in_doubt(result);
  for (const MapId& id : asked_)
    if (came_whole_.count(id) != 0)
      senders.insert(edge_of(id));
    else if (taken_apart_.count(id) != 0)
      apart[edge_of(id)].push_back(id);
    else if (doubted.count(id) != 0)
      in_doubt[edge_of(id)].push_back(id);
  std::vector<std::string> notes;
  for (const TierId& edge : senders)
    notes.push_back("edge " + edge.str() +
                    " sent whole maps: the cloud took a merge of thinned maps apart, or could not decide by them");
  for (const auto& [edge, maps] : apart)
    notes.push_back("edge " + edge.str() + " merged the maps " + quoted(maps) +
                    ", which the cloud took apart again, and did not send them as a whole: they stay as it thinned "
                    "them, with all poses, but of a place that several of them show one alone has the scans; merge the "
                    "robots' own maps instead, or let edges send whole maps (cloud.thin_maps=false)");
  for (const auto& [edge, maps] : in_doubt)
    notes.push_back("edge " + edge.str() + " did not send the maps " + quoted(maps) +
                    " as a whole, by which the cloud would have decided whether they fit others: they stay as it "
                    "thinned them, with all poses; merge the robots' own maps, or let edges send whole maps "
                    "(cloud.thin_maps=false)");
  return notes;
}

std::vector<Receipt> CloudMerger::receipts() const {
  std::vector<Receipt> all;
  for (const auto& [id, inbox] : inboxes_) all.push_back(inbox.receipt());
  return all;
}

std::map<TierId, JudgingTask> CloudMerger::judging_tasks(const std::set<TierId>& edges, WorkerPool& pool) const {
  struct Work {
    std::uint64_t size;
    fusion::FirstPair pair;
    TierId at_a, at_b;
  };
  std::vector<Work> work;
  for (fusion::FirstPair& pair : fusion::first_pairs(input(), options_, pool)) {
    if (inboxes_.count(pair.a) == 0 || inboxes_.count(pair.b) == 0) continue;  // no edge has a map of a session before
    const UpdateInbox &of_a = inboxes_.at(pair.a), &of_b = inboxes_.at(pair.b);
    const TierId at_a = of_a.receipt().origin.tier, at_b = of_b.receipt().origin.tier;
    if (at_a == at_b || edges.count(at_a) == 0 || edges.count(at_b) == 0) continue;
    work.push_back({std::uint64_t{of_a.map().nodes.size()} * of_b.map().nodes.size(), std::move(pair), at_a, at_b});
  }
  std::stable_sort(work.begin(), work.end(), [](const Work& one, const Work& other) { return one.size > other.size; });
  struct SentMap {
    TierId owner;
    bool is_whole = false;
    std::set<SubmapId> submaps;
  };
  std::map<TierId, std::vector<PairToJudge>> pairs;
  std::map<TierId, std::uint64_t> load;
  std::map<TierId, std::map<MapId, SentMap>> sent;
  for (Work& one : work) {
    const bool first = load[one.at_a] <= load[one.at_b];
    const TierId& judge = first ? one.at_a : one.at_b;
    load[judge] += one.size;
    SentMap& other = sent[judge][first ? one.pair.b : one.pair.a];
    other.owner = first ? one.at_b : one.at_a;
    other.is_whole = other.is_whole || one.pair.have_cameras;
    for (const fusion::SubmapPair& submaps : one.pair.submaps) other.submaps.insert(first ? submaps.b : submaps.a);
    pairs[judge].push_back(as_sent(one.pair));
  }
  std::map<TierId, JudgingTask> judging_tasks;
  for (const auto& [judge, asked] : pairs) judging_tasks[judge].pairs = encode(asked);
  for (const auto& [judge, maps] : sent)
    for (const auto& [id, what] : maps) {
      const Map& map = inboxes_.at(id).map();
      judging_tasks[judge].updates.push_back(
          first_update(what.is_whole ? map : part_of(map, what.submaps), what.owner));
    }
  return judging_tasks;
}

JudgingWork CloudMerger::first_work(const std::set<TierId>& edges, WorkerPool& pool) const {
  JudgingWork work = tiers::first_work(input(), options_, pool);
  const auto is_at_an_edge = [&](const MapId& id) {
    const auto inbox = inboxes_.find(id);
    return inbox != inboxes_.end() && edges.count(inbox->second.receipt().origin.tier) != 0;
  };
  work.pairs.erase(
      std::remove_if(work.pairs.begin(), work.pairs.end(),
                     [&](const PairToJudge& pair) { return is_at_an_edge(pair.a) && is_at_an_edge(pair.b); }),
      work.pairs.end());
  return work;
}

fusion::FusionInput CloudMerger::input() const {
  fusion::FusionInput input;
  input.by = cloud_;
  input.priors = priors_;
  input.refused = refused_;
  input.vetoed = vetoed_;
  input.models = models_;
  input.merged = merged_;
  input.maps = starts_;
  for (const auto& [id, inbox] : inboxes_) {
    if (const Receipt receipt = inbox.receipt(); receipt.awaited > 0)
      throw Error(ErrorCode::kMissing,
                  "update " + std::to_string(receipt.awaited) + " of map '" + id.str() + "' never came",
                  "tier " + receipt.origin.tier.str(), "send it again");
    input.maps.push_back(inbox.map());
  }
  return input;
}

fusion::FusionResult CloudMerger::seal(WorkerPool& pool, Progress& progress) {
  is_newer_ = false;
  return fusion::fuse(input(), options_, memo_, pool, progress);
}

}  // namespace mapweave::tiers
