#include <google/protobuf/io/coded_stream.h>

#include "dense_points.h"
#include "form.h"
#include "soundness.h"

namespace mapweave {
namespace {

using google::protobuf::MessageLite;

constexpr std::uint32_t kVersion = 7;  // of updates: 1 knows no keyframes and landmarks, 2 none borrowed, 3 no dense
                                       // points, 4 no sweeps, 5 none forgotten, 6 no floats
constexpr std::uint32_t kJudgementVersion = 1;                 // of lone judgements, and of verdicts
constexpr std::size_t kMostBytes = std::size_t{1} << 30;       // of a message
constexpr std::size_t kMostFieldBytes = std::size_t{4} << 20;  // of the header and any element but a node

// Fields of form::MapUpdate, written and read one by one.
enum Field : int {
  kHeader = 1,
  kNodes,
  kMoved,
  kSubmaps,
  kConstraints,
  kJudgements,
  kRemovedNodes,
  kRemovedSubmaps,
  kRemovedConstraints,
  kLandmarks,
  kChangedLandmarks,
  kRemovedLandmarks,
  kBorrowed,
  kForgottenNodes,
  kForgottenLandmarks
};

const NodeId& id_of(const NodeId& id) { return id; }
const SubmapId& id_of(const SubmapId& id) { return id; }
const ConstraintId& id_of(const ConstraintId& id) { return id; }
const LandmarkId& id_of(const LandmarkId& id) { return id; }
template <class Element>
const auto& id_of(const Element& element) {
  return element.id;
}

template <class Value>
void expect_sound(const Value& value) {
  const std::string problem = problem_with(value);
  MAPWEAVE_EXPECT(problem.empty(), "only sound values are written: " + problem);
}
void expect_sound(const NodeId&) {}  // their sessions are checked
void expect_sound(const SubmapId&) {}
void expect_sound(const LandmarkId&) {}

void append_varint(std::string& bytes, std::uint64_t number) {
  for (; number >= 0x80; number >>= 7) bytes.push_back(static_cast<char>(number | 0x80));
  bytes.push_back(static_cast<char>(number));
}

template <class Form>
void append_field(std::string& bytes, Field field, Form&& message, bool in_floats = false) {
  if (in_floats) shorten(message);
  const std::size_t size = message.ByteSizeLong();
  MAPWEAVE_EXPECT(field == kNodes || size <= kMostFieldBytes, "an element of an update stays under 4 MiB");
  MAPWEAVE_EXPECT(bytes.size() + size + 16 <= kMostBytes, "an update stays under 1 GiB: send it in parts");
  append_varint(bytes, static_cast<std::uint64_t>(field) << 3 | 2);  // 2: a length and so many bytes
  append_varint(bytes, size);
  message.AppendToString(&bytes);
}

void collect(SessionTable& sessions, const NodeId& id) { sessions.add(id.session); }
void collect(SessionTable& sessions, const SubmapId& id) { sessions.add(id.session); }
void collect(SessionTable& sessions, const LandmarkId& id) { sessions.add(id.session); }
void collect(SessionTable& sessions, const Node& node) { sessions.add(node.id.session); }
void collect(SessionTable& sessions, const MovedNode& moved) { sessions.add(moved.id.session); }
void collect(SessionTable& sessions, const Submap& submap) {
  sessions.add(submap.id.session);
  for (const auto& member : submap.submap_from_node) sessions.add(member.first.session);
}
void collect(SessionTable& sessions, const ConstraintId& id) {
  sessions.add(id.from.session);
  sessions.add(id.to.session);
}
void collect(SessionTable& sessions, const Constraint& constraint) { collect(sessions, constraint.id); }
void collect(SessionTable& sessions, const Judgement& judgement) {
  sessions.add(judgement.a.session);
  sessions.add(judgement.b.session);
}

template <class AnyLandmark>
void collect_sightings(SessionTable& sessions, const AnyLandmark& landmark) {
  sessions.add(landmark.id.session);
  for (const LandmarkSighting& sighting : landmark.seen) sessions.add(sighting.node.session);
}
void collect(SessionTable& sessions, const Landmark& landmark) { collect_sightings(sessions, landmark); }
void collect(SessionTable& sessions, const LandmarkChange& change) { collect_sightings(sessions, change); }

// The oldest that says it all: what older programs can read, they may.
std::uint32_t version_of(const MapUpdate& update) {
  bool has_keyframes = false, has_dense = false, has_sweeps = false;
  for (const Node& node : update.nodes)
    if (const auto* scan = std::get_if<PackedScan>(node.payload.get()))
      has_sweeps = has_sweeps || scan->geometry->has_sweep();
    else if (const auto* keyframe = std::get_if<KeyframeFeatures>(node.payload.get())) {
      has_keyframes = true;
      has_dense = has_dense || can_be_dense(keyframe->points);
    }
  const bool has_landmarks =
      !update.landmarks.empty() || !update.changed_landmarks.empty() || !update.removed_landmarks.empty();
  if (update.in_floats) return 7;
  if (!update.forgotten_nodes.empty() || !update.forgotten_landmarks.empty()) return 6;
  if (has_sweeps) return 5;
  if (has_dense) return 4;
  if (!update.borrowed.empty()) return 3;
  return has_keyframes || has_landmarks ? 2 : 1;
}

// Calls action(field, list) for every list of an update, in the order of their fields.
template <class Update, class Action>
void for_each_list(Update& update, const Action& action) {
  action(kNodes, update.nodes);
  action(kMoved, update.moved);
  action(kSubmaps, update.submaps);
  action(kConstraints, update.constraints);
  action(kJudgements, update.judgements);
  action(kRemovedNodes, update.removed_nodes);
  action(kRemovedSubmaps, update.removed_submaps);
  action(kRemovedConstraints, update.removed_constraints);
  action(kLandmarks, update.landmarks);
  action(kChangedLandmarks, update.changed_landmarks);
  action(kRemovedLandmarks, update.removed_landmarks);
  action(kBorrowed, update.borrowed);
  action(kForgottenNodes, update.forgotten_nodes);
  action(kForgottenLandmarks, update.forgotten_landmarks);
}

template <class Form>
Form parsed(std::string_view bytes, const FormReader& reader) {
  Form form;
  if (!form.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
    reader.corrupt("these bytes are not what they should be");
  return form;
}

void check_version(std::uint32_t version, std::uint32_t newest, const FormReader& reader, const std::string& where) {
  if (version > newest)
    throw Error(
        ErrorCode::kUnsupported,
        "it is in form " + std::to_string(version) + "; this program knows forms up to " + std::to_string(newest),
        where, "read it with a newer mapweave");
  if (version == 0) reader.corrupt("no version stands where it should");
}

void take_header(const form::Header& header, FormReader& reader, const std::string& where, MapUpdate& update) {
  check_version(header.version(), kVersion, reader, where);
  update.origin.tier = TierId(reader.name_or_nothing(header.tier(), "tier"));
  update.origin.map = MapId(reader.name_or_nothing(header.map(), "map"));
  update.sequence = header.sequence();
  update.base = header.base();
  for (const auto& session : header.sessions()) reader.take_session(session);
  for (const auto& geometry : header.geometries()) reader.take_geometry(geometry);
  for (const auto& camera : header.cameras()) reader.take_camera(camera);
}

template <class Element>
void append(std::vector<Element>& list, Element element, const FormReader& reader) {
  if (!list.empty() && !(id_of(list.back()) < id_of(element))) reader.corrupt("the ids are not in ascending order");
  list.push_back(std::move(element));
}

void take_element(int field, std::string_view bytes, const FormReader& reader, MapUpdate& update) {
  switch (field) {
    case kNodes: return append(update.nodes, reader.node(parsed<form::Node>(bytes, reader)), reader);
    case kMoved: return append(update.moved, reader.moved(parsed<form::MovedNode>(bytes, reader)), reader);
    case kSubmaps: return append(update.submaps, reader.submap(parsed<form::Submap>(bytes, reader)), reader);
    case kConstraints:
      return append(update.constraints, reader.constraint(parsed<form::Constraint>(bytes, reader)), reader);
    case kJudgements:
      return append(update.judgements, reader.judgement(parsed<form::Judgement>(bytes, reader)), reader);
    case kRemovedNodes: return append(update.removed_nodes, reader.node_id(parsed<form::Id>(bytes, reader)), reader);
    case kRemovedSubmaps:
      return append(update.removed_submaps, reader.submap_id(parsed<form::Id>(bytes, reader)), reader);
    case kRemovedConstraints:
      return append(update.removed_constraints, reader.constraint_id(parsed<form::ConstraintId>(bytes, reader)),
                    reader);
    case kLandmarks: return append(update.landmarks, reader.landmark(parsed<form::Landmark>(bytes, reader)), reader);
    case kChangedLandmarks:
      return append(update.changed_landmarks, reader.landmark_change(parsed<form::LandmarkChange>(bytes, reader)),
                    reader);
    case kRemovedLandmarks:
      return append(update.removed_landmarks, reader.landmark_id(parsed<form::Id>(bytes, reader)), reader);
    case kBorrowed: {
      const LandmarkChange borrowed = reader.landmark_change(parsed<form::LandmarkChange>(bytes, reader));
      if (borrowed.point_units) reader.corrupt("a borrowed landmark moves");
      return append(update.borrowed, borrowed, reader);
    }
    case kForgottenNodes:
      return append(update.forgotten_nodes, reader.node_id(parsed<form::Id>(bytes, reader)), reader);
    case kForgottenLandmarks:
      return append(update.forgotten_landmarks, reader.landmark_id(parsed<form::Id>(bytes, reader)), reader);
    default: reader.corrupt("field " + std::to_string(field) + " is unknown");
  }
}

}  // namespace

std::string encode(const MapUpdate& update) {
  expect_sound(update.origin);
  for (const LandmarkChange& borrowed : update.borrowed)
    MAPWEAVE_EXPECT(!borrowed.point_units, "borrowed landmarks do not move");
  SessionTable sessions;
  Geometries geometries;
  form::Header header;
  std::uint64_t elements = 0;
  for_each_list(update, [&](Field, const auto& list) {
    elements += list.size();
    for (std::size_t i = 0; i < list.size(); ++i) {
      expect_sound(list[i]);
      MAPWEAVE_EXPECT(i == 0 || id_of(list[i - 1]) < id_of(list[i]),
                      "the lists of an update are in ascending order of ids");
      collect(sessions, list[i]);
    }
  });
  sessions.sort();
  for (const SessionId& session : sessions.sessions()) {
    expect_sound(session);
    *header.add_sessions() = form_of(session);
  }
  for (const Node& node : update.nodes) {
    if (const auto* scan = std::get_if<PackedScan>(node.payload.get())) geometries.lasers.add(scan->geometry);
    if (const auto* keyframe = std::get_if<KeyframeFeatures>(node.payload.get()))
      geometries.cameras.add(keyframe->geometry);
  }
  for (const auto& laser : geometries.lasers.geometries()) {
    expect_sound(*laser);
    *header.add_geometries() = form_of(*laser);
  }
  for (const auto& camera : geometries.cameras.geometries()) {
    expect_sound(*camera);
    *header.add_cameras() = form_of(*camera);
  }
  header.set_version(version_of(update));
  header.set_elements(elements);
  header.set_tier(update.origin.tier.str());
  header.set_map(update.origin.map.str());
  header.set_sequence(update.sequence);
  header.set_base(update.base);

  std::string bytes;
  append_field(bytes, kHeader, header);
  for_each_list(update, [&](Field field, const auto& list) {
    for (const auto& element : list) {
      if constexpr (std::is_same_v<std::decay_t<decltype(element)>, Node>)
        append_field(bytes, field, form_of(element, sessions, geometries), update.in_floats);
      else
        append_field(bytes, field, form_of(element, sessions), update.in_floats);
    }
  });
  return bytes;
}

MapUpdate decode_map_update(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  if (bytes.empty()) reader.corrupt("it is empty");
  if (bytes.size() > kMostBytes)
    reader.corrupt("it has " + std::to_string(bytes.size()) + " bytes; at most " + std::to_string(kMostBytes) +
                   " are expected");
  google::protobuf::io::CodedInputStream stream(reinterpret_cast<const std::uint8_t*>(bytes.data()),
                                                static_cast<int>(bytes.size()));
  MapUpdate update;
  int last_field = 0;
  std::uint64_t elements = 0, expected_elements = 0;
  while (static_cast<std::size_t>(stream.CurrentPosition()) < bytes.size()) {
    reader.locate("byte " + std::to_string(stream.CurrentPosition()));
    const std::uint32_t tag = stream.ReadTag();
    std::uint32_t size = 0;
    if ((tag & 7) != 2 || !stream.ReadVarint32(&size)) reader.corrupt("no field of an update begins here");
    const auto begin = static_cast<std::size_t>(stream.CurrentPosition());
    const int field = static_cast<int>(tag >> 3);
    if (size > bytes.size() - begin)
      reader.corrupt("a field needs " + std::to_string(size) + " bytes, " + std::to_string(bytes.size() - begin) +
                     " remain");
    if (field != kNodes && size > kMostFieldBytes)
      reader.corrupt("field " + std::to_string(field) + " has " + std::to_string(size) + " bytes; at most " +
                     std::to_string(kMostFieldBytes) + " are expected");
    if (field < last_field || (field == kHeader) != (last_field == 0))
      reader.corrupt("field " + std::to_string(field) + " does not belong here");
    last_field = field;
    const std::string_view content = bytes.substr(begin, size);
    if (field == kHeader) {
      const auto header = parsed<form::Header>(content, reader);
      take_header(header, reader, where, update);
      expected_elements = header.elements();
    } else {
      take_element(field, content, reader, update);
      ++elements;
    }
    stream.Skip(static_cast<int>(size));
  }
  reader.locate("byte " + std::to_string(bytes.size()));
  if (elements != expected_elements)
    reader.corrupt("it holds " + std::to_string(elements) + " elements; its header says " +
                   std::to_string(expected_elements));
  return update;
}

std::string encode(const Judgement& judgement) {
  expect_sound(judgement);
  SessionTable sessions;
  collect(sessions, judgement);
  sessions.sort();
  form::LoneJudgement form;
  form.set_version(kJudgementVersion);
  for (const SessionId& session : sessions.sessions()) {
    expect_sound(session);
    *form.add_sessions() = form_of(session);
  }
  *form.mutable_judgement() = form_of(judgement, sessions);
  return form.SerializeAsString();
}

Judgement decode_judgement(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  if (bytes.size() > kMostFieldBytes)
    reader.corrupt("a judgement of " + std::to_string(bytes.size()) + " bytes; at most " +
                   std::to_string(kMostFieldBytes) + " are expected");
  const auto form = parsed<form::LoneJudgement>(bytes, reader);
  check_version(form.version(), kJudgementVersion, reader, where);
  for (const auto& session : form.sessions()) reader.take_session(session);
  return reader.judgement(form.judgement());
}

std::string encode(const Verdict& verdict) {
  expect_sound(verdict);
  form::Verdict form = form_of(verdict);
  form.set_version(kJudgementVersion);
  return form.SerializeAsString();
}

Verdict decode_verdict(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  if (bytes.size() > kMostFieldBytes)
    reader.corrupt("a verdict of " + std::to_string(bytes.size()) + " bytes; at most " +
                   std::to_string(kMostFieldBytes) + " are expected");
  const auto form = parsed<form::Verdict>(bytes, reader);
  check_version(form.version(), kJudgementVersion, reader, where);
  return reader.verdict(form);
}

}  // namespace mapweave
