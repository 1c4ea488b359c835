#include "exchange_form.h"
#include "soundness.h"

#include <mapweave/maps/merged_maps.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace mapweave {
namespace {

bool is_probability(double number) { return number >= 0.0 && number <= 1.0; }

// Sorted, none twice.
template <class Value, class Key>
bool is_rising(const std::vector<Value>& values, const Key& key) {
  for (std::size_t i = 1; i < values.size(); ++i)
    if (!(key(values[i - 1]) < key(values[i]))) return false;
  return true;
}
bool is_rising(const std::vector<MapId>& names) {
  return is_rising(names, [](const MapId& id) -> const MapId& { return id; });
}

// Empty where there is none.
std::string problem_with(const MatchedSubmaps& match) {
  const Pose2& pose = match.from_from_to;
  if (!(std::isfinite(pose.x) && std::isfinite(pose.y) && std::isfinite(pose.phi) && match.information.allFinite()))
    return "a match holds a number that is not finite";
  if (match.information.diagonal().minCoeff() < 0.0) return "a match has an information with a negative diagonal";
  if (match.from == match.to) return "a submap is matched to itself";
  return is_probability(match.probability) ? "" : "a match's probability is not within 0..1";
}

std::string problem_with(const MergedGroups& groups, const std::vector<MapId>& members) {
  std::vector<MapId> all;
  if (!is_rising(groups.one) || !is_rising(groups.other) || groups.one.empty() || groups.other.empty())
    return "groups that were merged are not in order";
  std::set_union(groups.one.begin(), groups.one.end(), groups.other.begin(), groups.other.end(),
                 std::back_inserter(all));
  if (all.size() != groups.one.size() + groups.other.size()) return "a map was merged with itself";
  if (!std::includes(members.begin(), members.end(), all.begin(), all.end()))
    return "a map was merged that is no member";
  if (!is_probability(groups.probability)) return "a merge's probability is not within 0..1";
  return is_proposer(groups.proposer) ? "" : "a merge's proposer is not up to 256 printable letters";
}

std::string problem_with(const MergedMaps& merged) {
  if (merged.members.size() < 2 || !is_rising(merged.members)) return "members are not two maps or more, in order";
  for (const MergedGroups& groups : merged.merges)
    if (auto problem = problem_with(groups, merged.members); !problem.empty()) return problem;
  std::set<Hash> known;
  for (const Judgement& judgement : merged.judgements) {
    if (auto problem = mapweave::problem_with(judgement); !problem.empty()) return problem;
    known.insert(judgement.id);
  }
  if (!is_rising(merged.judgements, [](const Judgement& judgement) -> const Hash& { return judgement.id; }))
    return "judgements are not in order";
  for (const MatchedSubmaps& match : merged.matches) {
    if (auto problem = problem_with(match); !problem.empty()) return problem;
    if (known.count(match.judgement) == 0) return "a match comes without its judgement";
  }
  for (const Constraint& constraint : merged.constraints)
    if (auto problem = mapweave::problem_with(constraint); !problem.empty()) return problem;
  return is_rising(merged.constraints, [](const Constraint& constraint) { return key_of(constraint.id); })
             ? ""
             : "constraints are not in order";
}

SessionTable sessions_of(const MergedMaps& merged) {
  SessionTable sessions;
  for (const MatchedSubmaps& match : merged.matches) {
    sessions.add(match.from.session);
    sessions.add(match.to.session);
  }
  for (const Judgement& judgement : merged.judgements) {
    sessions.add(judgement.a.session);
    sessions.add(judgement.b.session);
  }
  for (const Constraint& constraint : merged.constraints) {
    sessions.add(constraint.id.from.session);
    sessions.add(constraint.id.to.session);
  }
  sessions.sort();
  for (const SessionId& session : sessions.sessions())
    MAPWEAVE_EXPECT(problem_with(session).empty(), "only sound values are sent: " + problem_with(session));
  return sessions;
}

void fill(form::MergedMaps::Match& form, const MatchedSubmaps& match, const SessionTable& sessions) {
  *form.mutable_from() = form_of(match.from, sessions);
  *form.mutable_to() = form_of(match.to, sessions);
  form.set_x(match.from_from_to.x);
  form.set_y(match.from_from_to.y);
  form.set_yaw(match.from_from_to.phi);
  for (int row = 0; row < 3; ++row)
    for (int column = row; column < 3; ++column) form.add_information(match.information(row, column));
  form.set_probability(match.probability);
  form.set_slides(!match.is_observable);
  form.set_overrules_own(match.overrules_own);
  form.set_judgement(std::string(match.judgement.bytes.begin(), match.judgement.bytes.end()));
}

MatchedSubmaps match_of(const form::MergedMaps::Match& form, const FormReader& reader) {
  MatchedSubmaps match;
  match.from = reader.submap_id(form.from());
  match.to = reader.submap_id(form.to());
  match.from_from_to = {form.x(), form.y(), form.yaw()};
  if (form.information_size() != 6) reader.corrupt("a match's information has not six numbers");
  int next = 0;
  for (int row = 0; row < 3; ++row)
    for (int column = row; column < 3; ++column)
      match.information(row, column) = match.information(column, row) = form.information(next++);
  match.probability = form.probability();
  match.is_observable = !form.slides();
  match.judgement = reader.hash(form.judgement());
  match.overrules_own = form.overrules_own();
  return match;
}

template <class Names>
std::vector<MapId> names_in(const Names& names, const FormReader& reader) {
  std::vector<MapId> result;
  for (const std::string& name : names) result.push_back(name_in<MapId>(name, "map", reader));
  return result;
}

}  // namespace

std::string encode(const MergedMaps& merged) {
  const std::string problem = problem_with(merged);
  MAPWEAVE_EXPECT(problem.empty(), "only sound values are sent: " + problem);
  const SessionTable sessions = sessions_of(merged);
  form::Exchange form;
  auto& content = *form.mutable_merged_maps();
  for (const MapId& member : merged.members) {
    expect_name(member, "map");
    content.add_members(member.str());
  }
  for (const MergedGroups& groups : merged.merges) {
    auto& line = *content.add_merges();
    for (const MapId& member : groups.one) line.add_one(member.str());
    for (const MapId& member : groups.other) line.add_other(member.str());
    line.set_probability(groups.probability);
    line.set_proposer(groups.proposer);
  }
  for (const MatchedSubmaps& match : merged.matches) fill(*content.add_matches(), match, sessions);
  for (const Judgement& judgement : merged.judgements) *content.add_judgements() = form_of(judgement, sessions);
  for (const Constraint& constraint : merged.constraints) {
    form::Constraint line = form_of(constraint, sessions);
    shorten(line);
    *content.add_constraints() = std::move(line);
  }
  return written(form, sessions);
}

MergedMaps decode_merged_maps(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  const auto form = read_exchange(bytes, reader, where, form::Exchange::kMergedMaps);
  const auto& content = form.merged_maps();
  MergedMaps merged;
  merged.members = names_in(content.members(), reader);
  for (const auto& line : content.merges())
    merged.merges.push_back(
        {names_in(line.one(), reader), names_in(line.other(), reader), line.probability(), line.proposer()});
  for (const auto& match : content.matches()) merged.matches.push_back(match_of(match, reader));
  for (const auto& judgement : content.judgements()) merged.judgements.push_back(reader.judgement(judgement));
  for (const auto& constraint : content.constraints()) merged.constraints.push_back(reader.constraint(constraint));
  if (const std::string problem = problem_with(merged); !problem.empty()) reader.corrupt(problem);
  return merged;
}

}  // namespace mapweave
