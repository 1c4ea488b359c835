#include <mapweave/tiers/round_merger.h>

#include <algorithm>
#include <numeric>

namespace mapweave::tiers {
namespace {

constexpr std::size_t kLeastScans = 10;         // of a submap that still grows, to be looked at
constexpr std::size_t kSearchAgain = 2;         // times as many submaps: then all is looked for again
constexpr int kCandidates = 2, kMostPairs = 8;  // of a preview: places that are most alike; others come the next time

std::tuple<SubmapId, SubmapId, Hash> key_of_match(const MatchedSubmaps& match) {
  return {match.from, match.to, match.judgement};
}

bool share_members(const MergedMaps& one, const MergedMaps& other) {
  return std::any_of(one.members.begin(), one.members.end(), [&](const MapId& id) {
    return std::binary_search(other.members.begin(), other.members.end(), id);
  });
}

void add(const MergedMaps& other, MergedMaps& to) {
  std::vector<MapId> members;
  std::set_union(to.members.begin(), to.members.end(), other.members.begin(), other.members.end(),
                 std::back_inserter(members));
  to.members = std::move(members);
  std::set<std::tuple<SubmapId, SubmapId, Hash>> matches;
  for (const MatchedSubmaps& match : to.matches) matches.insert(key_of_match(match));
  for (const MatchedSubmaps& match : other.matches)
    if (matches.insert(key_of_match(match)).second) to.matches.push_back(match);
  std::set<Hash> judgements;
  for (const Judgement& judgement : to.judgements) judgements.insert(judgement.id);
  for (const Judgement& judgement : other.judgements)
    if (judgements.insert(judgement.id).second) to.judgements.push_back(judgement);
  for (const MergedGroups& groups : other.merges) {
    const auto is_same = [&](const MergedGroups& one) { return one.one == groups.one && one.other == groups.other; };
    if (std::none_of(to.merges.begin(), to.merges.end(), is_same)) to.merges.push_back(groups);
  }
}

// Groups that have a map in common as one.
std::vector<MergedMaps> united(const std::vector<MergedMaps>& given) {
  std::vector<MergedMaps> groups;
  for (const MergedMaps& one : given) {
    MergedMaps group = one;
    for (std::size_t i = groups.size(); i-- > 0;)
      if (share_members(groups[i], group)) {
        MergedMaps first = std::move(groups[i]);
        groups.erase(groups.begin() + static_cast<std::ptrdiff_t>(i));
        add(group, first);
        group = std::move(first);
      }
    groups.push_back(std::move(group));
  }
  return groups;
}

bool are_among(const std::vector<MapId>& some, const std::vector<MapId>& all) {
  return std::includes(all.begin(), all.end(), some.begin(), some.end());
}

bool joins_any_of(const std::set<std::pair<MapId, MapId>>& pairs, const MergedMaps& merged) {
  const auto has = [&](const MapId& map) {
    return std::binary_search(merged.members.begin(), merged.members.end(), map);
  };
  return std::any_of(pairs.begin(), pairs.end(), [&](const auto& pair) { return has(pair.first) && has(pair.second); });
}

std::size_t bytes_in(const std::vector<std::string>& messages) {
  return std::accumulate(messages.begin(), messages.end(), std::size_t{0},
                         [](std::size_t sum, const std::string& message) { return sum + message.size(); });
}

}  // namespace

std::uint64_t RoundNews::bytes() const {
  return bytes_in(updates) + bytes_in(merged) + (updates.empty() && merged.empty() && !is_anew ? 0U : 1U);
}

RoundMerger::RoundMerger(TierId tier, fusion::FusionOptions options)
    : tier_(tier),
      options_(std::move(options)),
      models_(fusion::make_models(options_)),
      sights_(fusion::make_sights()) {
  options_.candidates_per_submap = std::min(options_.candidates_per_submap, kCandidates);
  options_.most_pairs = std::min(options_.most_pairs, kMostPairs);
}

RoundMerger::Known& RoundMerger::known(const MapId& map, const TierId& from) {
  const auto found = known_.find(map);
  if (found != known_.end() && found->second.from == from) return found->second;
  if (found != known_.end()) forget(map);
  return known_.emplace(map, Known{from, std::nullopt, {}, GrowingMapSender(tier_)}).first->second;
}

void RoundMerger::forget(const MapId& map) {
  if (known_.erase(map) == 0) return;
  look_again_for(map);
}

// What was merged with it is looked for again.
void RoundMerger::look_again_for(const MapId& map) {
  const auto has_it = [&](const MergedMaps& merged) {
    return std::binary_search(merged.members.begin(), merged.members.end(), map);
  };
  merged_.erase(std::remove_if(merged_.begin(), merged_.end(), has_it), merged_.end());
  has_news_ = true;
}

// What an edge found between its maps is looked for again.
void RoundMerger::look_again_for(const TierId& edge) {
  const auto is_of_edge = [&](const MapId& id) {
    const auto member = known_.find(id);
    return member != known_.end() && member->second.from == edge;
  };
  const auto has_several = [&](const MergedMaps& merged) {
    return std::count_if(merged.members.begin(), merged.members.end(), is_of_edge) > 1;
  };
  merged_.erase(std::remove_if(merged_.begin(), merged_.end(), has_several), merged_.end());
  has_news_ = true;
}

void RoundMerger::set_refused(std::set<std::pair<MapId, MapId>> refused) {
  if (refused == refused_) return;
  refused_ = std::move(refused);
  look_again();
}

void RoundMerger::put(const Map& part) {
  Known& here = known(part.id, tier_);
  if (!continues(here.own, part) && !here.own.empty()) look_again_for(part.id);
  const auto last_of = [](const Map& map) { return map.nodes.empty() ? NodeId() : map.nodes.back().first; };
  has_news_ = has_news_ || here.own.nodes.size() != part.nodes.size() || last_of(here.own) != last_of(part);
  here.own = part;
}

void RoundMerger::receive(std::string_view bytes, const std::string& where) {
  MapUpdate update = decode_map_update(bytes, where);
  const auto before = known_.find(update.origin.map);
  const bool is_first = update.base == 0;
  // Said before the map went elsewhere: who has it begins anew.
  if (!is_first && (before == known_.end() || before->second.from != update.origin.tier)) return;
  Known& there = known(update.origin.map, update.origin.tier);
  if (!there.inbox)
    there.inbox.emplace(update.origin);
  else if (is_first)
    look_again_for(update.origin.map);
  there.inbox->receive(std::move(update), bytes.size(), where);
  has_news_ = true;
}

void RoundMerger::receive(const RoundNews& news, const TierId& from) {
  const std::string where = "a round of edge " + from.str();
  for (const std::string& update : news.updates) receive(update, where);
  if (news.is_anew) {
    below_.erase(from);
    look_again_for(from);
  }
  for (const std::string& bytes : news.merged) {
    MergedMaps merged = decode_merged_maps(bytes, where);
    for (const Judgement& judgement : merged.judgements) memo_.emplace(judgement.id, judgement);
    below_[from].push_back(std::move(merged));
    has_news_ = true;
  }
}

const Map* RoundMerger::map(const MapId& id) const {
  const auto found = known_.find(id);
  return found == known_.end() ? nullptr : &found->second.map();
}

std::vector<MapId> RoundMerger::maps() const {
  std::vector<MapId> ids;
  for (const auto& entry : known_) ids.push_back(entry.first);
  return ids;
}

// Maps of one edge that it did not merge are not compared again here.
std::set<std::pair<MapId, MapId>> RoundMerger::apart_below(const std::vector<MergedMaps>& seeds) const {
  std::map<MapId, std::size_t> group_of;
  for (std::size_t i = 0; i < seeds.size(); ++i)
    for (const MapId& member : seeds[i].members) group_of[member] = i;
  std::set<std::pair<MapId, MapId>> apart;
  for (auto a = known_.begin(); a != known_.end(); ++a)
    for (auto b = std::next(a); b != known_.end(); ++b) {
      if (a->second.from != b->second.from || a->second.from == tier_) continue;
      const auto of_a = group_of.find(a->first), of_b = group_of.find(b->first);
      if (of_a == group_of.end() || of_b == group_of.end() || of_a->second != of_b->second)
        apart.emplace(a->first, b->first);
    }
  return apart;
}

fusion::FusionInput RoundMerger::input() {
  fusion::FusionInput input;
  input.by = tier_;
  input.priors = priors_;
  input.models = models_;
  input.sights = sights_;
  input.is_preview = true;
  std::size_t submaps = 0;
  for (const auto& entry : known_) {
    Map map = as_if_frozen(entry.second.map(), kLeastScans);
    if (map.submaps.empty()) continue;
    submaps += map.submaps.size();
    input.maps.push_back(std::move(map));
  }
  is_anew_ = is_anew_ || submaps >= kSearchAgain * searched_submaps_;
  std::vector<MergedMaps> seeds = is_anew_ ? std::vector<MergedMaps>() : merged_;
  for (const auto& entry : below_)
    std::copy_if(entry.second.begin(), entry.second.end(), std::back_inserter(seeds),
                 [&](const MergedMaps& merged) { return !joins_any_of(refused_, merged); });
  input.merged = united(seeds);
  input.refused = apart_below(input.merged);
  input.refused.insert(refused_.begin(), refused_.end());
  if (is_anew_) searched_submaps_ = submaps;
  return input;
}

const fusion::FusionResult& RoundMerger::fuse(WorkerPool& pool, Progress& progress) {
  const fusion::FusionInput input = this->input();
  has_news_ = is_anew_ = false;
  result_ = input.maps.empty() ? fusion::FusionResult() : fusion::fuse(input, options_, memo_, pool, progress);
  merged_.clear();
  for (const fusion::Component& component : result_.components)
    if (component.merged) merged_.push_back(*component.merged);
  return result_;
}

RoundNews RoundMerger::news() {
  RoundNews news;
  for (auto& entry : known_)
    if (auto update = entry.second.up.next(entry.second.map())) news.updates.push_back(std::move(*update));
  std::set<MatchKey> now;
  for (const MergedMaps& merged : merged_)
    for (const MatchedSubmaps& match : merged.matches) now.insert(key_of_match(match));
  if (!std::includes(now.begin(), now.end(), sent_.begin(), sent_.end())) {
    news.is_anew = true;
    sent_.clear();
  }
  for (const MergedMaps& merged : merged_) {
    MergedMaps fresh{merged.members, {}, {}, {}, {}};
    for (const MergedGroups& groups : merged.merges)
      if (are_among(groups.one, merged.members) && are_among(groups.other, merged.members))
        fresh.merges.push_back(groups);
    std::set<Hash> judgements;
    for (const MatchedSubmaps& match : merged.matches)
      if (sent_.count(key_of_match(match)) == 0) {
        fresh.matches.push_back(match);
        judgements.insert(match.judgement);
      }
    for (const Judgement& judgement : merged.judgements)
      if (judgements.count(judgement.id) != 0) fresh.judgements.push_back(judgement);
    if (!fresh.matches.empty()) news.merged.push_back(encode(fresh));
  }
  sent_ = std::move(now);
  return news;
}

}  // namespace mapweave::tiers
