#include "forgotten_content.h"
#include "owned_update.h"
#include "server_state.h"

#include <mapweave/rig/scale.h>

#include <algorithm>

namespace mapweave::tiers {
namespace {

constexpr std::size_t kMostClients = 10000;  // runs of clients
constexpr std::size_t kMostMaps = 1000;      // of one client's run

// What cameras mapped of it.
Map seen_part_of(const Map& map) {
  Map part;
  part.id = map.id;
  for (const auto& [id, node] : map.nodes)
    if (keyframe_of(node) != nullptr) part.nodes.set(id, node);
  for (const auto& [id, constraint] : map.constraints)
    if (part.nodes.contains(id.from) && part.nodes.contains(id.to)) part.constraints.set(id, constraint);
  part.landmarks = map.landmarks;
  return part;
}

}  // namespace

MapMerge::Snapshots VisualServer::State::snapshots() const {
  MapMerge::Snapshots result;
  for (const auto& [session, client] : clients)
    for (const auto& [client_map, part] : client.parts)
      if (!part.inbox.map().empty()) result.emplace_back(part.name, part.inbox.snapshot());
  result.insert(result.end(), starts.begin(), starts.end());
  return result;
}

std::vector<LandmarkId> VisualServer::State::forgotten() const {
  std::vector<LandmarkId> result;
  for (const auto& [session, client] : clients)
    for (const auto& [client_map, part] : client.parts) {
      const auto& of_part = part.inbox.forgotten_landmarks();
      result.insert(result.end(), of_part.begin(), of_part.end());
    }
  std::sort(result.begin(), result.end());
  return result;
}

void VisualServer::State::make_room(Client::Part& part) {
  const auto most = static_cast<std::size_t>(options.keyframes);
  const std::size_t held = part.inbox.map().nodes.size(), spare = most / 20 + 1;
  const std::set<NodeId>& forgotten = part.inbox.forgotten_nodes();
  if (held <= most || forgotten.empty() || held < part.tried_with + (part.tried_with > 0 ? spare : 0)) return;
  const std::size_t count = std::min(forgotten.size(), held - most + std::min(spare, most) - 1);
  const std::vector<NodeId> going(forgotten.begin(), std::next(forgotten.begin(), static_cast<std::ptrdiff_t>(count)));
  if (shelf) {
    try {
      part.shelved.push_back(shelf->put(encode(part.inbox.content_of(going))));
      shelf_trouble.clear();
      part.tried_with = 0;
    } catch (const Error& error) {
      shelf_trouble = error.what();
      part.tried_with = held;
      return;
    }
  } else {
    lost += count;
  }
  part.inbox.take_out(going);
}

VisualServer::State::Whole VisualServer::State::whole(const Client::Part& part) const {
  Whole result{part.inbox.snapshot(), part.shelved, {}, shelf};
  if (!part.shelved.empty()) result.poses = part.inbox.taken_out();
  return result;
}

Map VisualServer::State::Whole::map() const {
  Map map = *in_memory;
  std::vector<MapUpdate> out;
  for (const std::uint64_t number : shelved)
    out.push_back(decode_map_update(shelf->get(number), "what the camera map server put on the disk"));
  put_back(map, out, poses);
  return map;
}

fusion::FusionInput VisualServer::State::input() const {
  fusion::FusionInput input;
  input.vetoed = vetoed;
  input.by = edge;
  input.pictures = pictures;
  for (const auto& [session, client] : clients)
    for (const auto& [client_map, part] : client.parts)
      for (LandmarkChange& change : part.all_borrowed()) input.borrowed.push_back(std::move(change));
  return input;
}

bool VisualServer::State::is_due(Stamp now) {
  if (std::exchange(counted, keyframes) != keyframes) published_at = now;
  if (vetoed_since) return true;
  constexpr double kGrowth = 1.0;
  const double joined = static_cast<double>(merged_keyframes), after = options.fuse_after;
  const double of_each = after * static_cast<double>(std::max<std::size_t>(1, published_since.size()));
  const double due = std::max(options.fuse_share * joined, std::min(of_each, std::max(after, kGrowth * joined)));
  const std::size_t fresh = keyframes - merged_keyframes;
  return static_cast<double>(fresh) >= due ||
         (fresh > 0 && published_at && seconds_between(*published_at, now) >= options.fuse_idle_s);
}

void VisualServer::State::begin(Stamp now, WorkerPool& pool) {
  merge = std::make_shared<MapMerge>();
  merge->input = input();
  merge->rig = rig;
  merge->forgotten = forgotten();
  merge->refused = refused;
  if (last) merge->input.judged = last->kept_judgements;
  if (!std::exchange(vetoed_since, false) && last) merge->input.teams = last->teams;
  merge->due = {now.ns + static_cast<std::int64_t>(options.fuse_delay_s * 1e9)};
  merged_keyframes = keyframes;
  published_since.clear();
  work = std::make_shared<BackgroundWork>(
      [merge = merge, last = last, maps = snapshots(), options = options, fusion_options = fusion_options,
       &pool]() mutable { merge->run(last.get(), std::move(maps), options, fusion_options, pool); });
}

VisualServer::VisualServer(TierId edge, ServerOptions options, fusion::FusionOptions fusion, rig::RigOptions rig)
    : state_(new State) {
  state_->edge = edge;
  state_->options = std::move(options);
  state_->fusion_options = std::move(fusion);
  state_->rig = rig;
}
VisualServer::~VisualServer() = default;

void VisualServer::begin_with(const std::vector<Map>& maps) {
  MAPWEAVE_EXPECT(state_->clients.empty(), "a server begins with maps before its clients come");
  for (const Map& map : maps) {
    Map part = seen_part_of(map);
    if (part.nodes.empty() || !rig::is_metric(part)) continue;
    state_->keyframes += part.nodes.size();
    const MapId name = state_->fresh_name(map.id);
    state_->starts.emplace_back(name, std::make_shared<const Map>(std::move(part)));
  }
}
void VisualServer::use_shelf(std::shared_ptr<Shelf> shelf) { state_->shelf = std::move(shelf); }

const Hash& VisualServer::vocabulary() const { return state_->fusion_options.visual.vocabulary.get().hash(); }

std::vector<Receipt> VisualServer::greet(const Hello& hello) {
  if (const Hash& known = vocabulary(); hello.vocabulary != known)
    throw Error(ErrorCode::kUnsupported,
                "its vocabulary is " + to_hex(hello.vocabulary) + "; this server's is " + to_hex(known),
                name_of(hello.session), "give both the same");
  if (state_->clients.count(hello.session) == 0 && state_->clients.size() >= kMostClients)
    throw Error(ErrorCode::kBadInput, "this server keeps " + std::to_string(kMostClients) + " runs of clients already",
                name_of(hello.session), "take what is old out of its store");
  std::vector<Receipt> receipts;
  for (const auto& [client_map, part] : state_->clients[hello.session].parts) receipts.push_back(part.inbox.receipt());
  return receipts;
}

VisualServer::Received VisualServer::receive(const SessionId& from, std::string_view bytes) {
  state_->client(from);
  return receive(from, decode_map_update(bytes, name_of(from)), bytes);
}

VisualServer::Received VisualServer::receive(const SessionId& from, MapUpdate update, std::string_view bytes) {
  Client& client = state_->client(from);
  const MapId client_map = update.origin.map;
  expect_own_map(client_map, from.client, name_of(from));
  expect_owned(update, from, name_of(from));
  auto known = client.parts.find(client_map);
  Client::Part fresh{client_map, UpdateInbox(update.origin)};
  if (known == client.parts.end() && client.parts.size() >= kMostMaps)
    throw Error(ErrorCode::kBadInput, "it has begun " + std::to_string(kMostMaps) + " maps already", name_of(from));
  Client::Part& part = known != client.parts.end() ? known->second : fresh;
  Received received;
  const std::uint64_t sequence = update.sequence;
  const std::size_t of_others = client.waiting_bytes - part.inbox.waiting_bytes();
  const auto count_waiting = [&] { client.waiting_bytes = of_others + part.inbox.waiting_bytes(); };
  for (const MapUpdate& stored :
       part.inbox.receive(std::move(update), bytes.size(), name_of(from), UpdateInbox::kMostWaitingBytes - of_others)) {
    received.stored.push_back(stored.sequence == sequence ? std::string(bytes) : encode(stored));
    part.note(stored);
    state_->keyframes += stored.nodes.size();
    if (!stored.nodes.empty()) state_->published_since.insert(from);
  }
  count_waiting();
  state_->make_room(part);
  received.receipt = part.inbox.receipt();
  if (known == client.parts.end()) {
    fresh.name = state_->fresh_name(client_map);
    state_->order.emplace_back(from, client_map);
    client.parts.emplace(client_map, std::move(fresh));
  }
  return received;
}

void VisualServer::advance(Stamp now, WorkerPool& pool, bool may_begin) {
  State& state = *state_;
  if (state.merge && (state.options.wait ? !(now < state.merge->due) : state.work->is_done())) state.take_over();
  if (state.merge || !may_begin) return;
  if (state.is_due(now)) state.begin(now, pool);
}

void VisualServer::abandon() { state_->abandon(); }

std::shared_ptr<BackgroundWork> VisualServer::pending() const { return state_->work; }

void VisualServer::veto(const Hash& judgement) {
  state_->vetoed_since = state_->vetoed.insert(judgement).second || state_->vetoed_since;
}

void VisualServer::refuse(std::set<std::pair<RobotId, RobotId>> robots) { state_->refused = std::move(robots); }

const std::set<Hash>& VisualServer::vetoed() const { return state_->vetoed; }

std::vector<std::string> VisualServer::notes() const {
  std::vector<std::string> notes = state_->last ? state_->last->notes : std::vector<std::string>{};
  if (const auto trouble = keeping_trouble()) notes.push_back(*trouble);
  return notes;
}

std::optional<std::string> VisualServer::keeping_trouble() const {
  const std::string most = "server.keyframes=" + std::to_string(state_->options.keyframes);
  if (!state_->shelf_trouble.empty())
    return "camera map server of " + state_->edge.str() + ": what its cameras forgot stays in memory, beyond " + most +
           ": " + state_->shelf_trouble;
  if (state_->lost > 0)
    return "camera map server of " + state_->edge.str() +
           ": it has no disk to keep on what its cameras forgot, and forgot " + std::to_string(state_->lost) +
           " of their keyframes, too; allow more than " + most;
  return std::nullopt;
}

VisualServer::Snapshot VisualServer::snapshot() const { return snapshot_to_encode()(); }

std::function<VisualServer::Snapshot()> VisualServer::snapshot_to_encode() const {
  struct Kept {
    SessionId from;
    Receipt receipt;
    State::Whole map;
    std::set<NodeId> forgotten_nodes;
    std::set<LandmarkId> forgotten_landmarks;
    std::vector<LandmarkChange> borrowed;
  };
  std::vector<Kept> kept;
  for (const auto& [session, client_map] : state_->order) {
    const Client::Part& part = state_->clients.at(session).parts.at(client_map);
    if (part.inbox.receipt().stored > 0)
      kept.push_back({session, part.inbox.receipt(), state_->whole(part), part.inbox.forgotten_nodes(),
                      part.inbox.forgotten_landmarks(), part.all_borrowed()});
  }
  return [kept = std::move(kept)]() mutable {
    Snapshot result;
    for (Kept& one : kept) {
      const Map map = one.map.map();
      MapUpdate all = difference(Map{}, map);
      for (const auto& [id, pose] : one.map.poses)
        if (map.nodes.contains(id)) one.forgotten_nodes.insert(id);
      all.origin = one.receipt.origin;
      all.sequence = one.receipt.stored;
      all.borrowed = one.borrowed;
      all.forgotten_nodes.assign(one.forgotten_nodes.begin(), one.forgotten_nodes.end());
      for (const Landmark& landmark : all.landmarks)
        if (one.forgotten_landmarks.count(landmark.id) != 0 || one.map.poses.count(landmark.anchor) != 0)
          all.forgotten_landmarks.push_back(landmark.id);
      result.emplace_back(one.from, encode(all));
    }
    return result;
  };
}

void VisualServer::leave(const SessionId& session) {
  const auto client = state_->clients.find(session);
  if (client == state_->clients.end()) return;
  auto& parts = client->second.parts;
  for (auto one = parts.begin(); one != parts.end();) {
    auto& [client_map, part] = *one;
    part.shared.clear();
    part.keyframes.clear();
    part.sent_shares = 0;
    part.lacks_after.reset();
    part.inbox.drop_waiting();
    if (part.inbox.receipt().stored > 0) {
      ++one;
      continue;
    }
    state_->names.erase(part.name);
    state_->order.erase(std::find(state_->order.begin(), state_->order.end(), std::make_pair(session, client_map)));
    one = parts.erase(one);
  }
  client->second.waiting_bytes = 0;
  client->second.seen_at.clear();
  if (parts.empty()) state_->clients.erase(client);
}

std::vector<Map> VisualServer::maps() const {
  std::vector<Map> result;
  for (const auto& [session, client] : state_->clients)
    for (const auto& [client_map, part] : client.parts) {
      if (part.inbox.map().empty() && part.shelved.empty()) continue;
      result.push_back(state_->whole(part).map());
      result.back().id = part.name;
    }
  for (Map& map : MapMerge::copies(state_->starts)) result.push_back(std::move(map));
  return result;
}

std::vector<KeptMap> VisualServer::kept_for(const SessionId& session) const { return kept_to_read(session)(); }

std::function<std::vector<KeptMap>()> VisualServer::kept_to_read(const SessionId& session) const {
  struct Part {
    MapId client_map;
    State::Whole whole;
    std::set<NodeId> forgotten_nodes;
    std::set<LandmarkId> forgotten_landmarks;
  };
  std::vector<Part> parts;
  for (const auto& [client_map, part] : state_->client(session).parts)
    if (!part.inbox.forgotten_nodes().empty() || !part.shelved.empty())
      parts.push_back(
          {client_map, state_->whole(part), part.inbox.forgotten_nodes(), part.inbox.forgotten_landmarks()});
  return [parts = std::move(parts)] {
    std::vector<KeptMap> result;
    for (const Part& part : parts) {
      KeptMap& kept = result.emplace_back(KeptMap{part.whole.map(), part.forgotten_nodes, part.forgotten_landmarks});
      kept.map.id = part.client_map;
      for (const auto& [id, pose] : part.whole.poses)
        if (kept.map.nodes.contains(id)) kept.forgotten_nodes.insert(id);
      for (const auto& [id, landmark] : kept.map.landmarks)
        if (part.whole.poses.count(landmark.anchor) != 0) kept.forgotten_landmarks.insert(id);
    }
    return result;
  };
}

const fusion::FusionResult& VisualServer::merged() const {
  static const fusion::FusionResult nothing;
  return state_->view ? state_->view->result() : nothing;
}

fusion::FusionResult VisualServer::seal(WorkerPool& pool, Progress& progress) {
  fusion::FusionInput input = state_->input();
  const std::vector<Map> own = maps();
  rig::RobotRigs rigs = rig::merge_rigs(own, state_->rig, pool);
  input.maps = std::move(rigs.maps);
  MapMerge::refuse(state_->refused, input);
  fusion::Memo known = state_->last ? state_->last->memo : fusion::Memo();
  fusion::FusionResult result = fusion::fuse(input, state_->fusion_options, known, pool, progress);
  fusion::split_rigs(result, rigs.rigs, own);
  return result;
}

}  // namespace mapweave::tiers
