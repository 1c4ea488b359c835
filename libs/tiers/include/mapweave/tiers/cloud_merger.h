#pragma once
// The cloud's role: collects the robots' maps from every edge and commits over all of them (RecSLAM's global fusion).
// Edges' judgements are a memo, their commitments are not asked. A state machine: no thread, no clock, no file.

#include <mapweave/fusion/fuse.h>
#include <mapweave/tiers/judging_task.h>
#include <mapweave/tiers/update_inbox.h>

#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace mapweave::tiers {

class CloudMerger {
 public:
  CloudMerger(TierId cloud, fusion::FusionOptions options);

  // Where maps lie to each other, for seal().
  void set_priors(std::vector<fusion::MapPrior> priors) { priors_ = std::move(priors); }
  // Pairs of maps never to be matched to each other, the lower id first.
  void set_refused(std::set<std::pair<MapId, MapId>> refused) { refused_ = std::move(refused); }
  // Judgements not to be believed.
  void set_vetoed(std::set<Hash> vetoed) { vetoed_ = std::move(vetoed); }
  // Maps of sessions before, which are whole already: no tier sends them. Their ids are no tier's maps'.
  void begin_with(std::vector<Map> maps) { starts_ = std::move(maps); }
  // An encoded MapUpdate. Updates of one origin may come in any order and more than once. Throws Error (kCorrupt,
  // kBadInput) for one that cannot be decoded, that does not fit what it builds on (this one, or one that waited for
  // it), or that names a map of another tier; nothing is stored of it then.
  Receipt receive(std::string_view bytes, const std::string& where);
  // Encoded MergedMaps of an edge. Throws Error(kCorrupt) for what cannot be decoded. It counts until seal() takes the
  // maps apart and one of them comes as a whole.
  void receive_merged(std::string_view bytes, const std::string& where);
  // Every origin, in order: the sender repeats what is awaited.
  std::vector<Receipt> receipts() const;
  // What edges can judge for seal(): of the pairs that it begins with those of maps that came from two of them, shared
  // out so that the products of their nodes are even. Others (of robots that map on board) are left to seal().
  std::map<TierId, JudgingTask> judging_tasks(const std::set<TierId>& edges, WorkerPool&) const;
  // Of the other pairs that seal() begins with those of which a map came from none of these edges, and the answers.
  JudgingWork first_work(const std::set<TierId>& edges, WorkerPool&) const;
  void know(const std::vector<Judgement>& judgements) {
    for (const Judgement& judgement : judgements) memo_.emplace(judgement.id, judgement);
  }
  // Fuses all maps. Throws Error(kMissing) while an update is awaited. Neither the order in which updates came nor the
  // judgements among them change a byte.
  fusion::FusionResult seal(WorkerPool&, Progress&);
  // After seal(), by edge: maps that it merged and that the cloud took apart; and thinned maps that stayed apart from
  // another one, though they may lie to each other as a verdict says. They stay so unless they are sent as a whole
  // and sealed again. Each map is named once.
  std::map<TierId, std::vector<MapId>> wanted_as_whole(const fusion::FusionResult&);
  // Since seal() whole maps came in place of thinned ones.
  bool is_newer_than_sealed() const { return is_newer_; }
  // For people: which edges sent wanted maps; which of these no edge sent, since it is gone, so that they stay thinned.
  // After the last seal().
  std::vector<std::string> notes(const fusion::FusionResult&) const;

 private:
  fusion::FusionInput input() const;
  TierId edge_of(const MapId&) const;

  TierId cloud_;
  fusion::FusionOptions options_;
  std::vector<fusion::MapPrior> priors_;
  std::set<std::pair<MapId, MapId>> refused_;
  std::set<Hash> vetoed_;
  std::vector<Map> starts_;
  std::map<MapId, UpdateInbox> inboxes_;
  std::vector<MergedMaps> merged_;
  std::set<MapId> came_whole_;   // in place of thinned ones
  std::set<MapId> taken_apart_;  // of what edges had merged
  std::set<MapId> asked_;        // wanted as a whole
  bool is_newer_ = false;        // than what was sealed
  fusion::Memo memo_;
  std::shared_ptr<matching::ModelCache> models_;
};

// Seals, and seals again as long as whole maps come: wanted by the last result, which no map is twice. `ask`, called
// with an edge and its maps, lets the cloud receive them. Returns the last result.
template <class Cloud, class Ask>
fusion::FusionResult seal_by_whole_maps(Cloud& cloud, Ask&& ask, WorkerPool& pool, Progress& progress) {
  fusion::FusionResult result;
  do {
    result = cloud.seal(pool, progress);
    for (const auto& [edge, maps] : cloud.wanted_as_whole(result)) ask(edge, maps);
  } while (cloud.is_newer_than_sealed());
  return result;
}

}  // namespace mapweave::tiers
