#include <mapweave/core/error.h>
#include <mapweave/tiers/cloud_merger.h>

namespace mapweave::tiers {

CloudMerger::CloudMerger(TierId cloud, fusion::FusionOptions options) : cloud_(cloud), options_(std::move(options)) {}

Receipt CloudMerger::Collected::receipt() const { return {{tier, map.id}, stored, waiting.empty() ? 0 : stored + 1}; }

Receipt CloudMerger::receive(std::string_view bytes, const std::string& where) {
  MapUpdate update = decode_map_update(bytes, where);
  const auto known = collected_.find(update.origin.map);
  if (known != collected_.end() && known->second.tier != update.origin.tier)
    throw Error(
        ErrorCode::kBadInput,
        "map '" + update.origin.map.str() + "' comes from '" + update.origin.tier.str() + "' and from '" + known->second.tier.str() + "'",
        where, "each robot ships to exactly one edge");
  if (update.sequence == 0 || update.base >= update.sequence)
    throw Error(ErrorCode::kBadInput,
                "update " + std::to_string(update.sequence) + " says that it builds on update " + std::to_string(update.base) +
                    "; updates count from 1",
                where);

  Collected fresh;
  fresh.tier = update.origin.tier;
  fresh.map.id = update.origin.map;
  if (known == collected_.end() && update.sequence == 1) store(fresh, update);  // throws before the origin is known
  Collected& collected = known != collected_.end() ? known->second : collected_.emplace(update.origin.map, std::move(fresh)).first->second;
  if (update.sequence <= collected.stored) return collected.receipt();  // came before
  if (update.sequence == collected.stored + 1)
    store(collected, update);
  else if (collected.waiting.size() < kMaxWaiting)  // else it will be repeated
    collected.waiting.emplace(update.sequence, std::move(update));
  while (!collected.waiting.empty() && collected.waiting.begin()->first == collected.stored + 1)
    store(collected, collected.waiting.extract(collected.waiting.begin()).mapped());
  return collected.receipt();
}

void CloudMerger::store(Collected& collected, const MapUpdate& update) {
  collected.map = updated(collected.map, update);  // throws before anything has changed
  collected.map.id = update.origin.map;
  collected.stored = update.sequence;
  for (const Judgement& judgement : update.judgements) memo_.emplace(judgement.id, judgement);
}

std::vector<Receipt> CloudMerger::receipts() const {
  std::vector<Receipt> all;
  for (const auto& [id, collected] : collected_) all.push_back(collected.receipt());
  return all;
}

fusion::FusionResult CloudMerger::seal(WorkerPool& pool, Progress& progress) {
  fusion::FusionInput input;
  input.by = cloud_;
  for (const auto& [id, collected] : collected_) {
    if (!collected.waiting.empty())
      throw Error(ErrorCode::kMissing, "update " + std::to_string(collected.stored + 1) + " of map '" + id.str() + "' never came",
                  "tier " + collected.tier.str(), "send it again");
    input.maps.push_back(collected.map);
  }
  return fusion::fuse(input, options_, memo_, pool, progress);
}

}  // namespace mapweave::tiers
