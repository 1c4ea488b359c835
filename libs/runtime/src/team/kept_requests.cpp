#include "kept_requests.h"

#include <mapweave/core/error.h>
#include <mapweave/core/options.h>
#include <mapweave/runtime/merge_requests.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <tuple>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::json;
constexpr const char* kKey = "requests";

// "section.key=value" of each option that is not the other one's.
void add_what_differs(const OptionFields& values, const OptionFields& others, const std::string& section,
                      std::vector<std::string>& settings) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (const auto* inner = std::get_if<OptionSection>(&values[i].as)) {
      add_what_differs(inner->fields, std::get<OptionSection>(others[i].as).fields, section + "." + values[i].name,
                       settings);
      continue;
    }
    const std::string line = yaml_of_fields({values[i]});  // "key: value\n"
    const std::size_t begin = values[i].name.size() + 2, length = line.size() - begin - 1;
    if (line != yaml_of_fields({others[i]}))
      settings.push_back(section + "." + values[i].name + "=" + line.substr(begin, length));
  }
}

// Empty: the shipped one.
std::string hash_of_given(const matching::ChosenVocabulary& vocabulary) {
  return vocabulary.is_given() ? to_hex(vocabulary.get().hash()) : std::string();
}

}  // namespace

KeptRequests kept_requests(std::vector<fusion::MapPrior> priors, const fusion::FusionOptions& options) {
  KeptRequests kept;
  kept.priors = std::move(priors);
  std::sort(kept.priors.begin(), kept.priors.end(),
            [](const auto& l, const auto& r) { return std::tie(l.a, l.b) < std::tie(r.a, r.b); });
  fusion::FusionOptions given = options, plain;
  plain.cache_mb = given.cache_mb;  // decides nothing
  add_what_differs(fields_of(given), fields_of(plain), "fusion", kept.options);
  kept.vocabulary = hash_of_given(options.visual.vocabulary);
  return kept;
}

KeptRequests kept_requests(const fusion::FusionInput& input, const fusion::FusionOptions& options) {
  KeptRequests kept = kept_requests(input.priors, options);
  kept.refused = input.refused;
  return kept;
}

std::map<Hash, std::pair<MapId, MapId>> vetoes_of(const std::set<Hash>& vetoed, const std::vector<const Map*>& maps,
                                                  const fusion::FusionResult& result) {
  std::map<Hash, std::pair<MapId, MapId>> known;
  const auto map_of = [&](const SubmapId& place) -> const Map* {
    const auto map = std::find_if(maps.begin(), maps.end(), [&](const Map* one) { return holds(*one, place); });
    return map == maps.end() ? nullptr : *map;
  };
  for (const Judgement& judgement : result.judgements) {
    if (vetoed.count(judgement.id) == 0) continue;
    const Map *a = map_of(judgement.a), *b = map_of(judgement.b);
    if (a != nullptr && b != nullptr) known[judgement.id] = std::minmax(a->id, b->id);
  }
  return known;
}

void keep(const KeptRequests& kept, const std::vector<MapId>& maps, std::map<std::string, std::string>& metadata) {
  const auto concerns = [&](const MapId& a, const MapId& b) {
    return std::any_of(maps.begin(), maps.end(), [&](const MapId& map) { return map == a || map == b; });
  };
  Json json = Json::object();
  for (const auto& [a, b] : kept.refused)
    if (concerns(a, b)) json["refused"].push_back({a.str(), b.str()});
  for (const auto& [id, of] : kept.vetoed)
    if (concerns(of.first, of.second)) json["vetoed"].push_back({to_hex(id), of.first.str(), of.second.str()});
  for (const fusion::MapPrior& prior : kept.priors)
    if (concerns(prior.a, prior.b))
      json["priors"].push_back({{"a", prior.a.str()},
                                {"b", prior.b.str()},
                                {"a_from_b", {prior.a_from_b.x, prior.a_from_b.y, prior.a_from_b.phi}},
                                {"sigma_m", prior.sigma_m},
                                {"sigma_rad", prior.sigma_rad}});
  if (!kept.options.empty()) json["options"] = kept.options;
  if (!kept.vocabulary.empty()) json["vocabulary"] = kept.vocabulary;
  if (!json.empty()) metadata[kKey] = json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

KeptRequests kept_in(const std::map<std::string, std::string>& metadata, const std::string& where) {
  KeptRequests kept;
  const auto text = metadata.find(kKey);
  if (text == metadata.end()) return kept;
  const auto unreadable = [&] {
    return Error(ErrorCode::kCorrupt, "what was said when it was merged cannot be read", where,
                 "merge its robots' own maps again");
  };
  try {
    const Json json = Json::parse(text->second);
    for (const Json& pair : json.value("refused", Json::array()))
      kept.refused.insert(std::minmax(MapId(pair.at(0).get<std::string>()), MapId(pair.at(1).get<std::string>())));
    for (const Json& veto : json.value("vetoed", Json::array())) {
      const auto id = hash_in_hex(veto.at(0).get<std::string>());
      if (!id) throw unreadable();
      kept.vetoed[*id] = std::minmax(MapId(veto.at(1).get<std::string>()), MapId(veto.at(2).get<std::string>()));
    }
    for (const Json& prior : json.value("priors", Json::array())) {
      const Json& pose = prior.at("a_from_b");
      kept.priors.push_back({MapId(prior.at("a").get<std::string>()), MapId(prior.at("b").get<std::string>()),
                             Pose2(pose.at(0).get<double>(), pose.at(1).get<double>(), pose.at(2).get<double>()),
                             prior.at("sigma_m").get<double>(), prior.at("sigma_rad").get<double>()});
    }
    kept.options = json.value("options", std::vector<std::string>());
    kept.vocabulary = json.value("vocabulary", std::string());
  } catch (const Json::exception&) {
    throw unreadable();
  }
  return kept;
}

KeptRequests renamed(const KeptRequests& kept, const std::function<MapId(const MapId&)>& name_of) {
  KeptRequests result = kept;
  result.refused.clear();
  for (const auto& [a, b] : kept.refused) result.refused.insert(std::minmax(name_of(a), name_of(b)));
  for (auto& [id, of] : result.vetoed) of = std::minmax(name_of(of.first), name_of(of.second));
  for (fusion::MapPrior& prior : result.priors) {
    prior.a = name_of(prior.a);
    prior.b = name_of(prior.b);
  }
  return result;
}

void note_vocabulary(const KeptRequests& kept, const fusion::FusionOptions& options, std::vector<std::string>& notes) {
  if (kept.vocabulary == hash_of_given(options.visual.vocabulary)) return;
  const auto named = [](const std::string& hash) { return hash.empty() ? "the one that mapweave brings" : hash; };
  const std::string note = "the team was made with another vocabulary (" + named(kept.vocabulary) +
                           "); this merge recognises places by " + named(hash_of_given(options.visual.vocabulary)) +
                           " (visual.vocabulary)";
  if (std::find(notes.begin(), notes.end(), note) == notes.end()) notes.push_back(note);  // of each store of a team
}

void apply(const KeptRequests& kept, fusion::FusionInput& input, std::vector<std::string>& notes) {
  const auto is_there = [&](const MapId& id) {
    return std::any_of(input.maps.begin(), input.maps.end(), [&](const Map& map) { return map.id == id; });
  };
  for (const auto& [a, b] : kept.refused)
    if (is_there(a) && is_there(b) && input.refused.insert({a, b}).second)
      notes.push_back("as before: " + a.str() + " and " + b.str() + " are never matched to each other (--refuse)");
  for (const auto& [id, of] : kept.vetoed)
    if (is_there(of.first) && is_there(of.second) && input.vetoed.insert(id).second)
      notes.push_back("as before: judgement " + to_hex(id) + " of " + of.first.str() + " and " + of.second.str() +
                      " is not believed (--veto)");
  for (const fusion::MapPrior& prior : kept.priors) {
    const bool is_said_anew = std::any_of(input.priors.begin(), input.priors.end(), [&](const fusion::MapPrior& other) {
      return std::minmax(other.a, other.b) == std::minmax(prior.a, prior.b);
    });
    if (is_said_anew || !is_there(prior.a) || !is_there(prior.b)) continue;
    input.priors.push_back(prior);
    notes.push_back("as before: a prior says where " + prior.b.str() + " lies in " + prior.a.str() +
                    " (--anchor, or where they began)");
  }
}

}  // namespace mapweave::runtime
