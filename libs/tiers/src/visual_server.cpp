#include "owned_update.h"
#include "team_joining.h"

#include <mapweave/core/error.h>
#include <mapweave/matching/alignment_search.h>
#include <mapweave/matching/binary_vocabulary.h>
#include <mapweave/tiers/byte_allowance.h>
#include <mapweave/tiers/visual_server.h>
#include <mapweave/visual/borrowing.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

namespace mapweave::tiers {
namespace {

constexpr std::uint64_t kHeldFor = 20;       // shares out of view: clients forget after 30 keyframes
constexpr std::uint64_t kSweepEvery = 4;     // shares
constexpr std::size_t kMostHeld = 2500;      // clients hold 3000
constexpr double kResent_m = 0.01;           // a landmark that moved by more is told again
constexpr double kUnchanged_m = 0.05;        // a client whose keyframes moved by more since the joining began knows better
constexpr double kLandmarkBytes = 70.0;      // on the wire, about
constexpr std::size_t kLeastTold = 60;       // landmarks with a place, however narrow the wire
constexpr std::size_t kMostBorrowed = 1000;  // of one keyframe, that are kept
constexpr std::size_t kMostClients = 10000;  // runs of clients
constexpr std::size_t kMostMaps = 1000;      // of one client's run

std::string name_of(const SessionId& session) { return "client " + to_string(session); }

// Where pose_in_map is in the team, and the way back.
Pose3 carried(const Sim3& team_from_map, const Pose3& pose_in_map) {
  return compose(team_from_map.pose, Pose3{team_from_map.scale * pose_in_map.t, pose_in_map.q});
}

// Landmarks that a client may still be told.
std::size_t landmarks_within(const ByteAllowance& downlink) {
  return static_cast<std::size_t>(std::max(0.0, downlink.bytes()) / kLandmarkBytes);
}

struct LandmarkHash {
  std::size_t operator()(const LandmarkId& id) const {
    const auto robot = reinterpret_cast<std::uintptr_t>(&id.session.client.robot.str());  // names are kept once
    return (robot ^ (static_cast<std::uint64_t>(id.session.run) * 31 + id.index)) * 0x9e3779b97f4a7c15ULL;
  }
};

// So many of them, from all over.
std::vector<DescribedLandmark> thinned(std::vector<DescribedLandmark> all, std::size_t count) {
  if (all.size() <= count) return all;
  for (std::size_t i = 0; i < count; ++i)
    if (const std::size_t from = i * all.size() / count; from != i) all[i] = std::move(all[from]);
  all.resize(count);
  return all;
}

}  // namespace

struct VisualServer::Client {
  struct Lent {
    Eigen::Vector3d point_in_map;
    std::uint64_t wanted = 0;  // the share, counted, that it was in the view of last
  };
  struct Part {  // one of its maps
    MapId name;  // here; the client says `told`
    UpdateInbox inbox;
    std::unordered_map<LandmarkId, Lent, LandmarkHash> lent = {};
    std::uint32_t forgotten = 0;
    std::uint64_t shares = 0;
    std::uint64_t corrected_by = 0;                                          // the view
    std::map<NodeId, std::map<LandmarkId, LandmarkSighting>> borrowed = {};  // seen by its keyframes

    void note(const MapUpdate& update) {
      for (const NodeId& id : update.removed_nodes) borrowed.erase(id);
      for (const LandmarkChange& change : update.borrowed)
        for (const LandmarkSighting& sighting : change.seen) {
          auto& of_keyframe = borrowed[sighting.node];
          if (of_keyframe.size() < kMostBorrowed) of_keyframe.insert_or_assign(change.id, sighting);
        }
    }
    std::vector<LandmarkChange> all_borrowed() const {  // by landmark, then keyframe
      std::map<LandmarkId, LandmarkChange> changes;
      for (const auto& [node, of_keyframe] : borrowed)
        for (const auto& [id, sighting] : of_keyframe) {
          LandmarkChange& change = changes[id];
          change.id = id, change.seen.push_back(sighting);
        }
      std::vector<LandmarkChange> result;
      for (auto& entry : changes) result.push_back(std::move(entry.second));
      return result;
    }
  };
  std::map<MapId, Part> parts;    // by what the client calls them
  std::size_t waiting_bytes = 0;  // in the inboxes of all
  mutable ByteAllowance downlink;
};

struct VisualServer::PlaceSearch::State {
  PlaceRequest request;
  std::shared_ptr<const TeamView> view;
  fusion::FusionOptions options;
  std::optional<fusion::FoundPlace> found;
  const TeamView::Component* component = nullptr;  // where
};

struct VisualServer::State {
  TierId edge;
  ServerOptions options;
  fusion::FusionOptions fusion_options;
  std::map<SessionId, Client> clients;
  std::set<MapId> names;
  std::vector<std::pair<SessionId, MapId>> order;  // in which maps became known
  std::set<Hash> vetoed;
  std::shared_ptr<TeamJoining> last;  // that was taken over
  std::shared_ptr<TeamJoining> joining;
  std::shared_ptr<BackgroundWork> work;  // of the joining
  std::shared_ptr<const TeamView> view;
  std::shared_ptr<fusion::Pictures> pictures = std::make_shared<fusion::Pictures>();
  std::uint64_t views = 0;                          // counted
  std::size_t keyframes = 0, joined_keyframes = 0;  // told; told when the maps were joined last
  bool vetoed_since = false;

  Client& client(const SessionId& session) {
    const auto found = clients.find(session);
    if (found == clients.end()) throw Error(ErrorCode::kMissing, "it has not greeted", name_of(session), "say hello first");
    return found->second;
  }

  MapId fresh_name(const MapId& told) {
    MapId name = told;
    for (int run = 2; !names.insert(name).second; ++run) name = MapId(told.str() + "-" + std::to_string(run));
    return name;
  }

  TeamJoining::Snapshots snapshots() const {
    TeamJoining::Snapshots result;
    for (const auto& [session, client] : clients)
      for (const auto& [told, part] : client.parts)
        if (!part.inbox.map().empty()) result.emplace_back(part.name, part.inbox.snapshot());
    return result;
  }
  fusion::FusionInput input() const {
    fusion::FusionInput input;
    input.vetoed = vetoed, input.by = edge, input.pictures = pictures;
    for (const auto& [session, client] : clients)
      for (const auto& [told, part] : client.parts)
        for (LandmarkChange& change : part.all_borrowed()) input.borrowed.push_back(std::move(change));
    return input;
  }

  void begin(Stamp now, WorkerPool& pool) {
    joining = std::make_shared<TeamJoining>();
    joining->input = input();
    if (last) joining->input.judged = last->standing;
    if (!std::exchange(vetoed_since, false) && last) joining->input.teams = last->teams;
    joining->due = {now.ns + static_cast<std::int64_t>(options.fuse_delay_s * 1e9)};
    joined_keyframes = keyframes;
    work = std::make_shared<BackgroundWork>([joining = joining, last = last, maps = snapshots(), options = options,
                                             fusion_options = fusion_options,
                                             &pool] { joining->run(last.get(), maps, options, fusion_options, pool); });
  }

  // What is let go of is left to whoever holds the work.
  void abandon() { joining.reset(), work.reset(); }
  void take_over() {
    work->run();
    view = joining->view, ++views;
    last.swap(joining);
    joining.reset(), work.reset();
  }

  // The part's node that the team has and that is nearest to `place`, in the map's frame or in the team's; null where there is none.
  enum class Frame { map, team };
  static const Node* nearest(const Client::Part& part, const TeamView::Member& member, const Eigen::Vector3d& place, Frame frame) {
    const Node* best = nullptr;
    double least = std::numeric_limits<double>::infinity();
    for (const TeamView::Member::Placed& one : member.nodes) {
      const double apart = ((frame == Frame::map ? one.in_map : one.in_team) - place).squaredNorm();
      if (!(apart < least)) continue;
      if (const Node* node = part.inbox.map().nodes.find(one.id)) least = apart, best = node;
    }
    return best;
  }

  matching::Frustum frustum(const CameraGeometry& camera, const Pose3& team_from_robot) const {
    matching::Frustum frustum;
    frustum.pinhole = {camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy};
    frustum.map_from_camera = compose(team_from_robot, camera.robot_from_camera);
    frustum.far_m = options.far_m;
    return frustum;
  }

  void lend(Client::Part& part, const SessionId& to, const ClientView& told, const TeamView::Member& member, const Node& near,
            std::size_t most, Share& share) const {
    const Sim3 team_from_map = team_from_map_at(near.id, near.map_from_node, member), map_from_team = matching::inverse(team_from_map);
    ++part.shares;
    for (const DescribedLandmark* known : member.component->landmarks.look(
             frustum(*keyframe_of(near)->geometry, carried(team_from_map, told.map_from_robot)), options.retrieval, to.client)) {
      const DescribedLandmark& one = *known;
      if (one.id.session == to) continue;
      if (const auto held = part.lent.find(one.id); held != part.lent.end()) {
        held->second.wanted = part.shares;
        const double moved_m = (held->second.point_in_map - matching::transformed(one.point_in_map, map_from_team)).norm();
        if (moved_m < std::max(kResent_m, map_from_team.scale * one.sigma_m)) continue;
      }
      DescribedLandmark here = matching::transformed(one, map_from_team);
      if (matching::flaw(here).empty()) share.landmarks.push_back(std::move(here));
    }
    share.landmarks = thinned(std::move(share.landmarks), most);
    for (const DescribedLandmark& here : share.landmarks) part.lent[here.id] = {here.point_in_map, part.shares};
    if (part.shares % kSweepEvery != 0 && part.lent.size() <= kMostHeld) return;
    const auto is_old = [&](const Client::Lent& lent, std::uint64_t shares) { return lent.wanted + shares < part.shares; };
    for (std::uint64_t patience = kHeldFor; patience == kHeldFor || part.lent.size() > kMostHeld; patience /= 2) {
      for (auto one = part.lent.begin(); one != part.lent.end();)
        one = is_old(one->second, patience) ? part.lent.erase(one) : std::next(one);
      if (patience == 0) break;
    }
  }

  // Where the team has a client's keyframes, in the frame of the client's first one: a rigid motion of all of them is no correction.
  void correct(Client::Part& part, const TeamView::Member& member, Share& share) const {
    if (part.corrected_by == views) return;
    part.corrected_by = views;
    const Map& own = part.inbox.map();
    const Map& team = member.component->content->map;
    const Node* first = nullptr;
    double square = 0.0;
    Pose3 map_from_team;
    for (const TeamView::Member::Placed& one : member.nodes) {
      const NodeId& id = one.id;
      const Node* node = own.nodes.find(id);
      if (node == nullptr) continue;
      if ((node->map_from_node.t - member.told.find(id)->t).norm() > kUnchanged_m) {
        share.corrected.clear();
        return;
      }
      const Pose3& team_from_node = team.nodes.find(id)->map_from_node;
      if (first == nullptr) first = node, map_from_team = compose(node->map_from_node, inverse(team_from_node));
      share.corrected.push_back({id, compose(map_from_team, team_from_node)});
      square += (share.corrected.back().map_from_node.t - node->map_from_node.t).squaredNorm();
    }
    if (share.corrected.empty() || std::sqrt(square / static_cast<double>(share.corrected.size())) <= options.correct_m)
      share.corrected.clear();
    else
      share.scale = member.scale;
  }
};

VisualServer::VisualServer(TierId edge, ServerOptions options, fusion::FusionOptions fusion) : state_(new State) {
  state_->edge = edge, state_->options = std::move(options), state_->fusion_options = std::move(fusion);
}
VisualServer::~VisualServer() = default;

std::vector<Receipt> VisualServer::greet(const Hello& hello) {
  if (const Hash& known = matching::shipped_vocabulary().hash(); hello.vocabulary != known)
    throw Error(ErrorCode::kUnsupported, "its vocabulary is " + to_hex(hello.vocabulary) + "; this server's is " + to_hex(known),
                name_of(hello.session), "give both the same");
  if (state_->clients.count(hello.session) == 0 && state_->clients.size() >= kMostClients)
    throw Error(ErrorCode::kBadInput, "this server keeps " + std::to_string(kMostClients) + " runs of clients already",
                name_of(hello.session), "take what is old out of its store");
  std::vector<Receipt> receipts;
  for (const auto& [told, part] : state_->clients[hello.session].parts) receipts.push_back(part.inbox.receipt());
  return receipts;
}

VisualServer::Received VisualServer::receive(const SessionId& from, std::string_view bytes) {
  state_->client(from);
  return receive(from, decode_map_update(bytes, name_of(from)), bytes);
}

VisualServer::Received VisualServer::receive(const SessionId& from, MapUpdate update, std::string_view bytes) {
  Client& client = state_->client(from);
  const MapId told = update.origin.map;
  if (!visual::session_of(from.client, told))
    throw Error(ErrorCode::kBadInput, "map '" + told.str() + "' is not one of its own", name_of(from),
                "a client tells of its own map alone");
  expect_owned(update, from, name_of(from));
  auto known = client.parts.find(told);
  Client::Part fresh{told, UpdateInbox(update.origin)};
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
  }
  count_waiting();
  received.receipt = part.inbox.receipt();
  if (known == client.parts.end()) {
    fresh.name = state_->fresh_name(told);
    state_->order.emplace_back(from, told);
    client.parts.emplace(told, std::move(fresh));
  }
  return received;
}

void VisualServer::advance(Stamp now, WorkerPool& pool, bool may_begin) {
  State& state = *state_;
  if (state.joining && (state.options.wait ? !(now < state.joining->due) : state.work->is_done())) state.take_over();
  if (state.joining || !may_begin) return;
  const auto due =
      std::max(static_cast<double>(state.options.fuse_after), state.options.fuse_share * static_cast<double>(state.joined_keyframes));
  if (static_cast<double>(state.keyframes - state.joined_keyframes) >= due || state.vetoed_since) state.begin(now, pool);
}

void VisualServer::abandon() { state_->abandon(); }

std::shared_ptr<BackgroundWork> VisualServer::pending() const { return state_->work; }

std::optional<Share> VisualServer::share(const SessionId& to, const ClientView& told) {
  State& state = *state_;
  Client& client = state.client(to);
  if (!visual::session_of(to.client, told.map))
    throw Error(ErrorCode::kBadInput, "map '" + told.map.str() + "' is not one of its own", name_of(to),
                "a client tells of its own map alone");
  const auto known = client.parts.find(told.map);
  if (state.options.share == Sharing::none || !state.view || known == client.parts.end()) return std::nullopt;
  Client::Part& part = known->second;
  if (part.forgotten != told.forgotten) part.lent.clear(), part.forgotten = told.forgotten;
  const TeamView::Member* member = state.view->member(part.name);
  if (member == nullptr || member->component->content->members.size() < 2) return std::nullopt;
  const Node* near = State::nearest(part, *member, told.map_from_robot.t, State::Frame::map);
  if (near == nullptr) return std::nullopt;
  Share share;
  share.map = told.map;
  const bool is_bound = state.options.most_bytes_per_s > 0.0;
  client.downlink.wait_until(told.stamp, state.options.most_bytes_per_s);
  if (state.options.share == Sharing::full && (!is_bound || client.downlink.bytes() > 0.0)) state.correct(part, *member, share);
  // What is lent is lent for the map as it is: after a correction the client forgets it.
  if (share.corrected.empty())
    state.lend(part, to, told, *member, *near, is_bound ? landmarks_within(client.downlink) : std::numeric_limits<std::size_t>::max(),
               share);
  if (share.corrected.empty() && share.landmarks.empty()) return std::nullopt;
  if (is_bound) client.downlink.spend(encode(share).size());
  return share;
}

VisualServer::PlaceSearch::PlaceSearch(std::unique_ptr<State> state) : state_(std::move(state)) {}
VisualServer::PlaceSearch::~PlaceSearch() = default;

void VisualServer::PlaceSearch::run(WorkerPool& pool) {
  for (const TeamView::Component& one : state_->view->components()) {
    auto found = one.places.find(state_->request.features, state_->options, pool);
    if (!found || (state_->found && found->probability <= state_->found->probability)) continue;
    state_->found = std::move(found), state_->component = &one;
  }
}

std::shared_ptr<VisualServer::PlaceSearch> VisualServer::place_search(const SessionId& from, PlaceRequest request) const {
  const State& state = *state_;
  state_->client(from);
  if (state.options.share == Sharing::none || !state.view) return nullptr;
  auto search = std::make_unique<PlaceSearch::State>();
  search->request = std::move(request), search->view = state.view, search->options = state.fusion_options;
  return std::shared_ptr<PlaceSearch>(new PlaceSearch(std::move(search)));
}

std::optional<PlaceAnswer> VisualServer::place(const SessionId& from, const PlaceRequest& request, WorkerPool& pool) const {
  const auto search = place_search(from, request);
  if (!search) return std::nullopt;
  search->run(pool);
  return answer(from, *search);
}

std::optional<PlaceAnswer> VisualServer::answer(const SessionId& from, const PlaceSearch& search) const {
  State& state = *state_;
  Client& client = state.client(from);
  const auto& [request, view, fusion_options, best, component] = *search.state_;
  if (!best) return std::nullopt;
  const auto answer_in = [&, &request = request, &best = best, &component = component](
                             const MapId& told, const Node& near, const TeamView::Member& member) -> std::optional<PlaceAnswer> {
    const Sim3 team_from_map = team_from_map_at(near.id, near.map_from_node, member), map_from_team = matching::inverse(team_from_map);
    PlaceAnswer answer;
    answer.stamp = request.stamp, answer.map = told;
    answer.map_from_robot = carried(map_from_team, best->map_from_robot);
    for (const DescribedLandmark& one :
         component->landmarks.retrieve(state.frustum(*request.features.geometry, best->map_from_robot), state.options.retrieval)) {
      DescribedLandmark here = matching::transformed(one, map_from_team);
      if (here.id.session != from && matching::flaw(here).empty()) answer.landmarks.push_back(std::move(here));
    }
    if (answer.landmarks.empty()) return std::nullopt;
    if (state.options.most_bytes_per_s > 0.0) {
      client.downlink.wait_until(answer.stamp, state.options.most_bytes_per_s);
      answer.landmarks = thinned(std::move(answer.landmarks), std::max(kLeastTold, landmarks_within(client.downlink)));
      client.downlink.spend(encode(answer).size());
    }
    return answer;
  };
  // In a map of its own where one lies there, else in that of who saw the place.
  for (const auto& [told, part] : client.parts) {
    const TeamView::Member* member = view->member(part.name);
    if (member == nullptr || member->component != component) continue;
    const Node* near = State::nearest(part, *member, best->map_from_robot.t, State::Frame::team);
    if (near != nullptr) return answer_in(told, *near, *member);
  }
  const auto owner = state.clients.find(best->keyframe.session);
  if (owner == state.clients.end()) return std::nullopt;
  for (const auto& [told, part] : owner->second.parts) {
    const TeamView::Member* member = view->member(part.name);
    const Node* near = part.inbox.map().nodes.find(best->keyframe);
    if (member != nullptr && member->component == component && near != nullptr) return answer_in(part.name, *near, *member);
  }
  return std::nullopt;
}

void VisualServer::veto(const Hash& judgement) { state_->vetoed_since = state_->vetoed.insert(judgement).second || state_->vetoed_since; }

VisualServer::Snapshot VisualServer::snapshot() const { return snapshot_to_encode()(); }

std::function<VisualServer::Snapshot()> VisualServer::snapshot_to_encode() const {
  struct Kept {
    SessionId from;
    Receipt receipt;
    std::shared_ptr<const Map> map;
    std::vector<LandmarkChange> borrowed;
  };
  std::vector<Kept> kept;
  for (const auto& [session, told] : state_->order) {
    const Client::Part& part = state_->clients.at(session).parts.at(told);
    if (part.inbox.receipt().stored > 0) kept.push_back({session, part.inbox.receipt(), part.inbox.snapshot(), part.all_borrowed()});
  }
  return [kept = std::move(kept)] {
    Snapshot result;
    for (const Kept& one : kept) {
      MapUpdate all = difference(Map{}, *one.map);
      all.origin = one.receipt.origin, all.sequence = one.receipt.stored, all.borrowed = one.borrowed;
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
    auto& [told, part] = *one;
    part.lent.clear(), part.inbox.drop_waiting();
    if (part.inbox.receipt().stored > 0) {
      ++one;
      continue;
    }
    state_->names.erase(part.name);
    state_->order.erase(std::find(state_->order.begin(), state_->order.end(), std::make_pair(session, told)));
    one = parts.erase(one);
  }
  client->second.waiting_bytes = 0;
  if (parts.empty()) state_->clients.erase(client);
}

std::vector<Map> VisualServer::maps() const { return TeamJoining::copies(state_->snapshots()); }

const fusion::FusionResult& VisualServer::joined() const {
  static const fusion::FusionResult nothing;
  return state_->view ? state_->view->result() : nothing;
}

fusion::FusionResult VisualServer::seal(WorkerPool& pool, Progress& progress) {
  fusion::FusionInput input = state_->input();
  input.maps = maps();
  fusion::Memo known = state_->last ? state_->last->memo : fusion::Memo();
  return fusion::fuse(input, state_->fusion_options, known, pool, progress);
}

}  // namespace mapweave::tiers
