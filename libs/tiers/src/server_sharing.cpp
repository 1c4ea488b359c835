#include "server_state.h"

#include <mapweave/matching/alignment_search.h>
#include <mapweave/visual/borrowing.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace mapweave::tiers {
namespace {

constexpr std::uint32_t kHeldFor = 20;    // shares out of view: clients forget after 30 keyframes
constexpr std::uint32_t kSweepEvery = 4;  // shares
constexpr std::size_t kMostHeld = 2500;   // clients hold 3000
constexpr std::uint64_t kNobody = 0;      // shares
constexpr double kResent_m = 0.01;        // a landmark that moved by more is sent again
constexpr double kUnchanged_m = 0.05;     // a client whose keyframes moved by more since the merge began knows better
constexpr double kLandmarkBytes = 70.0;   // on the wire, about

}  // namespace

// Whether the client has it with its keyframe.
bool VisualServer::State::holds(const Client::Part& part, const TeamView::Member& member, const LandmarkId& id) {
  if (part.keyframes.empty()) return false;
  const Landmark* landmark = member.component->content().map.landmarks.find(id);
  const auto keyframe = landmark == nullptr ? part.keyframes.end() : part.keyframes.find(landmark->anchor);
  return keyframe != part.keyframes.end() && keyframe->second.landmarks.count(id) != 0;
}

std::size_t landmarks_within(const ByteAllowance& downlink) {
  return static_cast<std::size_t>(std::max(0.0, downlink.bytes()) / kLandmarkBytes);
}

const Node* VisualServer::State::nearest(const Client::Part& part, const TeamView::Member& member,
                                         const Eigen::Vector3d& place, Frame frame) {
  const auto search = [&](const auto& counts) {
    const TeamView::Member::Placed* best = nullptr;
    double least = std::numeric_limits<double>::infinity();
    for (const TeamView::Member::Placed& one : member.nodes)
      if (const double apart = ((frame == Frame::map ? one.in_map : one.in_team) - place).squaredNorm();
          apart < least && counts(one)) {
        least = apart;
        best = &one;
      }
    return best;
  };
  const auto node_of = [&](const TeamView::Member::Placed* one) {
    return one == nullptr ? nullptr : part.inbox.map().nodes.find(one->id);
  };
  const Node* const node = node_of(search([](const auto&) { return true; }));
  return node != nullptr
             ? node
             : node_of(search([&](const auto& one) { return node_of(&one) != nullptr; }));  // some are gone since
}

matching::Frustum VisualServer::State::frustum(const CameraGeometry& camera, const Pose3& team_from_robot) const {
  matching::Frustum frustum;
  frustum.pinhole = camera.pinhole();
  frustum.map_from_camera = compose(team_from_robot, camera.robot_from_camera);
  frustum.far_m = options.far_m;
  return frustum;
}

std::vector<const VisualServer::State::Entry*> VisualServer::State::rig_cameras(const ClientId& camera) const {
  std::vector<const Entry*> result;
  for (auto entry = clients.lower_bound({{camera.robot, {}}, std::numeric_limits<std::int64_t>::min()});
       entry != clients.end() && entry->first.client.robot == camera.robot; ++entry)
    if (entry->first.client.sensor != camera.sensor) result.push_back(&*entry);
  return result;
}

bool VisualServer::State::has_scale_of_others(const Client& client) const {
  return std::any_of(client.parts.begin(), client.parts.end(), [&](const auto& entry) {
    const TeamView::Member* member = view->member(entry.second.name);
    return member != nullptr && member->scale != 1.0;
  });
}

std::set<SessionId> VisualServer::State::sessions_not_shared(const SessionId& to,
                                                             const TeamView::Member& member) const {
  std::set<SessionId> not_shared{to};
  // A camera that measures its scale would come to rest on the scale that a rig camera has from itself.
  for (const Entry* rig_camera : rig_cameras(to.client))
    if (member.scale == 1.0 && has_scale_of_others(rig_camera->second)) not_shared.insert(rig_camera->first);
  return not_shared;
}

void VisualServer::State::note_owners(Client::Part& part, const SessionId& to, const TeamView::Member& member) const {
  if (std::exchange(part.owners_by, views) == views) return;
  const std::set<SessionId> not_shared = sessions_not_shared(to, member);
  part.owner_of_session.clear();
  for (const SessionId& session : member.component->landmarks().sessions())
    part.owner_of_session.push_back(not_shared.count(session) != 0
                                        ? kNobody
                                        : part.owners.try_emplace(session, part.owners.size() + 1).first->second);
}

std::vector<VisualServer::State::Offer> VisualServer::State::offers_for(Client::Part& part, const SessionId& to,
                                                                        const TeamView::Member& member,
                                                                        const matching::Frustum& seen_from) const {
  std::vector<Offer> offers;
  const auto key_of = [](std::uint64_t owner, const matching::LandmarkIndex::Seen& seen) {
    return owner << 32 | seen.index;
  };
  if (member.component->content().members.size() > 1) {
    const matching::LandmarkIndex& landmarks = member.component->landmarks();
    note_owners(part, to, member);
    for (const matching::LandmarkIndex::Seen& seen : landmarks.look(seen_from, options.retrieval, to.client))
      if (const std::uint64_t owner = part.owner_of_session[seen.session]; owner != kNobody) {
        offers.push_back({&landmarks, seen, key_of(owner, seen)});
        part.shared.expect(offers.back().key);
      }
  }
  const matching::LandmarkIndex* forgotten = member.component->forgotten();
  if (forgotten == nullptr) return offers;
  const std::uint64_t own = part.owners.try_emplace(to, part.owners.size() + 1).first->second;
  for (const matching::LandmarkIndex::Seen& seen : forgotten->look(seen_from, options.retrieval))
    if (forgotten->sessions()[seen.session] == to) offers.push_back({forgotten, seen, key_of(own, seen)});
  std::sort(offers.begin(), offers.end(),
            [](const Offer& a, const Offer& b) { return a.index->landmark(a.seen).id < b.index->landmark(b.seen).id; });
  return offers;
}

std::vector<DescribedLandmark> VisualServer::State::landmarks_for(Client::Part& part, const SessionId& to,
                                                                  const ClientView& client_view,
                                                                  const TeamView::Member& member, const Node& near,
                                                                  std::size_t most) const {
  const Sim3 team_from_map = team_from_map_at(near.id, near.map_from_node, member),
             map_from_team = inverse(team_from_map);
  ++part.shares;
  const CameraGeometry& camera = *keyframe_of(near)->geometry;
  const matching::Frustum seen_from =
      frustum(camera, carried(team_from_map, client_view.map_from_robot, camera.robot_from_camera));
  std::vector<DescribedLandmark> shared;
  std::vector<std::uint64_t> keys;  // of what is shared
  for (const auto& [index, seen, key] : offers_for(part, to, member, seen_from)) {
    if (SharedLandmarkTable::Shared* const held = part.shared.find(key)) {
      held->wanted = part.shares;
      if ((held->point_in_map - transformed(*seen.point_in_map, map_from_team)).norm() <
          static_cast<double>(held->resent_m))
        continue;
    }
    const DescribedLandmark& landmark = index->landmark(seen);
    if (holds(part, member, landmark.id)) continue;
    DescribedLandmark here = matching::transformed(landmark, map_from_team);
    if (matching::problem_with(here).empty()) {
      shared.push_back(std::move(here));
      keys.push_back(key);
    }
  }
  shared = thinned(std::move(shared), most);
  keys = thinned(std::move(keys), most);
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const DescribedLandmark& here = shared[i];
    part.shared.set({keys[i], here.point_in_map, static_cast<float>(std::max(kResent_m, here.sigma_m)), part.shares});
  }
  if (part.shares % kSweepEvery != 0 && part.shared.size() <= kMostHeld) return shared;
  for (std::uint32_t patience = kHeldFor; patience == kHeldFor || part.shared.size() > kMostHeld; patience /= 2) {
    part.shared.keep([&](const SharedLandmarkTable::Shared& held) { return held.wanted + patience >= part.shares; });
    if (patience == 0) break;
  }
  return shared;
}

void VisualServer::State::correct(Client::Part& part, const TeamView::Member& member, Share& share) const {
  if (part.corrected_by == views) return;
  part.corrected_by = views;
  const Map& own = part.inbox.map();
  const Map& team = member.component->content().map;
  const Node* first = nullptr;
  double square = 0.0;
  Pose3 map_from_team;
  for (const TeamView::Member::Placed& one : member.nodes) {
    const NodeId& id = one.id;
    const Node* node = own.nodes.find(id);
    if (node == nullptr || part.inbox.forgotten_nodes().count(id) != 0) continue;
    if ((node->map_from_node.t - member.published.find(id)->t).norm() > kUnchanged_m) {
      share.corrected.clear();
      return;
    }
    const Pose3& team_from_node = team.nodes.find(id)->map_from_node;
    if (first == nullptr) {
      first = node;
      map_from_team = compose(node->map_from_node, inverse(team_from_node));
    }
    share.corrected.push_back({id, compose(map_from_team, team_from_node)});
    square += (share.corrected.back().map_from_node.t - node->map_from_node.t).squaredNorm();
  }
  if (share.corrected.empty() || std::sqrt(square / static_cast<double>(share.corrected.size())) <= options.correct_m)
    share.corrected.clear();
  else
    share.scale = member.scale;
}

VisualServer::State::Receiver VisualServer::State::receiver(const SessionId& to, const ClientView& client_view,
                                                            const TeamView::Member& member, const Node& near) {
  const Sim3 team_from_map = team_from_map_at(near.id, near.map_from_node, member);
  return {to, member,
          carried(team_from_map, client_view.map_from_robot, keyframe_of(near)->geometry->robot_from_camera).t,
          client_view.room};
}

VisualServer::State::Budget VisualServer::State::budget(const Client& client, const Share& so_far) const {
  constexpr double kNoLimit = std::numeric_limits<double>::infinity();
  if (options.most_bytes_per_s <= 0.0) return {kNoLimit, kNoLimit};
  const double bytes = client.downlink.bytes() - static_cast<double>(encode(so_far).size());
  return {bytes, ByteAllowance::kBurst_s * options.most_bytes_per_s};
}

std::optional<Share> VisualServer::share(const SessionId& to, const ClientView& client_view) {
  State& state = *state_;
  Client& client = state.client(to);
  if (!visual::session_of(to.client, client_view.map))
    throw Error(ErrorCode::kBadInput, "map '" + client_view.map.str() + "' is not one of its own", name_of(to),
                "a client publishes its own map alone");
  client.note(client_view);
  const auto known = client.parts.find(client_view.map);
  if (state.options.share == Sharing::none || !state.view || known == client.parts.end()) return std::nullopt;
  Client::Part& part = known->second;
  if (part.forgotten != client_view.forgotten) {
    part.shared.clear();
    part.forgotten = client_view.forgotten;
  }
  part.note_missed(client_view);
  const TeamView::Member* member = state.view->member(part.name);
  if (member == nullptr) return std::nullopt;
  const bool is_alone = member->component->content().members.size() < 2;
  // A merge that was taken back: what the client was sent by it goes.
  const bool has_others = !is_alone || !part.keyframes.empty();
  if (!has_others && member->component->forgotten() == nullptr) return std::nullopt;
  const Node* near = State::nearest(part, *member, client_view.map_from_robot.t, State::Frame::map);
  if (near == nullptr) return std::nullopt;
  Share share;
  share.map = client_view.map;
  const bool is_limited = state.options.most_bytes_per_s > 0.0;
  client.downlink.wait_until(client_view.stamp, state.options.most_bytes_per_s);
  const bool is_global = state.options.share == Sharing::global;
  if (!is_alone && (is_global || state.options.share == Sharing::full) &&
      (!is_limited || client.downlink.bytes() > 0.0))
    state.correct(part, *member, share);
  // Landmarks are shared for the map as it is: after a correction the client forgets them.
  if (share.corrected.empty())
    share.landmarks =
        state.landmarks_for(part, to, client_view, *member, *near,
                            is_limited ? landmarks_within(client.downlink) : std::numeric_limits<std::size_t>::max());
  if (is_global && has_others && share.corrected.empty())
    state.add_keyframes(part, state.receiver(to, client_view, *member, *near), state.budget(client, share), share);
  if (share.corrected.empty() && share.landmarks.empty() && share.keyframes.empty() && share.dropped.empty())
    return std::nullopt;
  share.number = ++part.sent_shares;
  if (is_limited) client.downlink.spend(encode(share).size());
  return share;
}

}  // namespace mapweave::tiers
