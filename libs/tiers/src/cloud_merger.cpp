#include <mapweave/core/error.h>
#include <mapweave/tiers/cloud_merger.h>
#include <mapweave/tiers/edge_server.h>

#include <algorithm>
#include <cstdint>
#include <iterator>

namespace mapweave::tiers {

CloudMerger::CloudMerger(TierId cloud, fusion::FusionOptions options)
    : cloud_(cloud),
      options_(std::move(options)),
      models_(fusion::make_models(options_)) {}

Receipt CloudMerger::receive(std::string_view bytes, const std::string& where) {
  MapUpdate update = decode_map_update(bytes, where);
  const Origin origin = update.origin;
  const auto known = inboxes_.find(origin.map);
  if (known != inboxes_.end() && known->second.receipt().origin.tier != origin.tier)
    throw Error(ErrorCode::kBadInput,
                "map '" + origin.map.str() + "' comes from '" + origin.tier.str() + "' and from '" +
                    known->second.receipt().origin.tier.str() + "'",
                where, "each robot ships to exactly one edge");
  UpdateInbox fresh(origin);
  UpdateInbox& inbox = known != inboxes_.end() ? known->second : fresh;
  for (const MapUpdate& stored : inbox.receive(std::move(update), bytes.size(), where))
    for (const Judgement& judgement : stored.judgements) memo_.emplace(judgement.id, judgement);
  if (known == inboxes_.end()) return inboxes_.emplace(origin.map, std::move(fresh)).first->second.receipt();
  return inbox.receipt();
}

std::vector<Receipt> CloudMerger::receipts() const {
  std::vector<Receipt> all;
  for (const auto& [id, inbox] : inboxes_) all.push_back(inbox.receipt());
  return all;
}

std::map<TierId, Errand> CloudMerger::errands(const std::set<TierId>& edges, WorkerPool& pool) const {
  struct Work {
    std::uint64_t size;
    MapId a, b;
    TierId at_a, at_b;
  };
  std::vector<Work> work;
  for (const auto& [a, b] : fusion::first_pairs(input(), options_, pool)) {
    const UpdateInbox &of_a = inboxes_.at(a), &of_b = inboxes_.at(b);
    const TierId at_a = of_a.receipt().origin.tier, at_b = of_b.receipt().origin.tier;
    if (at_a == at_b || edges.count(at_a) == 0 || edges.count(at_b) == 0) continue;
    work.push_back({std::uint64_t{of_a.map().nodes.size()} * of_b.map().nodes.size(), a, b, at_a, at_b});
  }
  std::stable_sort(work.begin(), work.end(), [](const Work& one, const Work& other) { return one.size > other.size; });
  std::map<TierId, Errand> errands;
  std::map<TierId, std::uint64_t> load;
  std::map<TierId, std::set<MapId>> lent;
  for (const Work& pair : work) {
    const bool first = load[pair.at_a] <= load[pair.at_b];
    const TierId &judge = first ? pair.at_a : pair.at_b, &owner = first ? pair.at_b : pair.at_a;
    const MapId& other = first ? pair.b : pair.a;
    load[judge] += pair.size;
    errands[judge].pairs.emplace_back(pair.a, pair.b);
    if (lent[judge].insert(other).second) errands[judge].updates.push_back(first_update(inboxes_.at(other).map(), owner));
  }
  return errands;
}

fusion::FusionInput CloudMerger::input() const {
  fusion::FusionInput input;
  input.by = cloud_;
  input.priors = priors_;
  input.models = models_;
  for (const auto& [id, inbox] : inboxes_) {
    if (const Receipt receipt = inbox.receipt(); receipt.awaited > 0)
      throw Error(ErrorCode::kMissing, "update " + std::to_string(receipt.awaited) + " of map '" + id.str() + "' never came",
                  "tier " + receipt.origin.tier.str(), "send it again");
    input.maps.push_back(inbox.map());
  }
  return input;
}

fusion::FusionResult CloudMerger::seal(WorkerPool& pool, Progress& progress) {
  return fusion::fuse(input(), options_, memo_, pool, progress);
}

}  // namespace mapweave::tiers
