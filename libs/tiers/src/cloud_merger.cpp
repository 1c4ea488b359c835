#include <mapweave/core/error.h>
#include <mapweave/tiers/cloud_merger.h>

namespace mapweave::tiers {

CloudMerger::CloudMerger(TierId cloud, fusion::FusionOptions options) : cloud_(cloud), options_(std::move(options)) {}

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

fusion::FusionResult CloudMerger::seal(WorkerPool& pool, Progress& progress) {
  fusion::FusionInput input;
  input.by = cloud_;
  for (const auto& [id, inbox] : inboxes_) {
    if (const Receipt receipt = inbox.receipt(); receipt.awaited > 0)
      throw Error(ErrorCode::kMissing, "update " + std::to_string(receipt.awaited) + " of map '" + id.str() + "' never came",
                  "tier " + receipt.origin.tier.str(), "send it again");
    input.maps.push_back(inbox.map());
  }
  return fusion::fuse(input, options_, memo_, pool, progress);
}

}  // namespace mapweave::tiers
