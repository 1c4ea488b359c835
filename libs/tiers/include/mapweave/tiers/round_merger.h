#pragma once
// A tier's part in fusing while robots drive (RecSLAM III-C): it keeps the maps as they are so far, fuses them again
// and again as previews, and sends up what is new. The final map knows nothing of it. A state machine: no thread, no
// clock, no file.

#include <mapweave/fusion/fuse.h>
#include <mapweave/tiers/growing_map.h>
#include <mapweave/tiers/update_inbox.h>

#include <map>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

namespace mapweave::tiers {

// What a tier sends up after a round: each thing once.
struct RoundNews {
  std::vector<std::string> updates;  // encoded MapUpdates of its robots' maps
  std::vector<std::string> merged;   // encoded MergedMaps: matches that were found since the last round
  bool is_anew = false;              // what it said of merges before holds no longer
  std::uint64_t bytes() const;
};

class RoundMerger {
 public:
  RoundMerger(TierId tier, fusion::FusionOptions options);

  void set_priors(std::vector<fusion::MapPrior> priors) { priors_ = std::move(priors); }
  // The next preview looks for all again.
  void look_again() { is_anew_ = has_news_ = true; }
  // Pairs of maps that are never matched to each other; the lower id first. Where they change, all is looked for again.
  void set_refused(std::set<std::pair<MapId, MapId>> refused);
  // The map so far (growing_part) of a robot that is mapped here.
  void put(const Map& part);
  // An encoded MapUpdate of a growing map. The first one of another sender than before takes the place of what was
  // known; a later one of a sender who has the map no longer is left out. Throws
  // Error (kCorrupt, kBadInput) as UpdateInbox does.
  void receive(std::string_view update, const std::string& where);
  // All that a tier below says. Throws the same.
  void receive(const RoundNews& news, const TierId& from);
  void forget(const MapId&);  // it is elsewhere now

  const Map* map(
      const MapId&) const;  // as it is so far; null where none is known. Until the next call that is not const
  bool has_news() const { return has_news_; }  // since the last fuse()
  // A preview of the maps that are large enough. What was merged the last time is taken as it was, unless what is new
  // contradicts it, or what it rests on was taken back; all is looked for again once there are twice as many submaps.
  // Pure in what was received so far, round by round: the same for any number of threads.
  const fusion::FusionResult& fuse(WorkerPool&, Progress&);
  const fusion::FusionResult& result() const { return result_; }  // of the last fuse()
  std::vector<MapId> maps() const;                                // sorted
  RoundNews news();                                               // for the tier above: what is new since the last call

 private:
  using MatchKey = std::tuple<SubmapId, SubmapId, Hash>;
  struct Known {
    TierId from;
    std::optional<UpdateInbox> inbox;  // of what came over a wire
    Map own;                           // else
    GrowingMapSender up;
    const Map& map() const { return inbox ? inbox->map() : own; }
  };
  Known& known(const MapId& map, const TierId& from);
  void look_again_for(const MapId& map);
  void look_again_for(const TierId& edge);
  fusion::FusionInput input();
  std::set<std::pair<MapId, MapId>> apart_below(const std::vector<MergedMaps>& seeds) const;

  TierId tier_;
  fusion::FusionOptions options_;
  std::vector<fusion::MapPrior> priors_;
  std::set<std::pair<MapId, MapId>> refused_;
  std::map<MapId, Known> known_;
  std::map<TierId, std::vector<MergedMaps>> below_;  // what edges found
  std::vector<MergedMaps> merged_;                   // of the last result
  std::set<MatchKey> sent_;
  std::size_t searched_submaps_ = 0;  // when all was looked for the last time
  bool has_news_ = false, is_anew_ = false;
  fusion::Memo memo_;
  std::shared_ptr<matching::ModelCache> models_;
  std::shared_ptr<fusion::KeptSights> sights_;
  fusion::FusionResult result_;
};

}  // namespace mapweave::tiers
