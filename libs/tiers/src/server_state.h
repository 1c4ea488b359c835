#pragma once
// What a camera map server keeps of each client and of all together.

#include "map_merge.h"
#include "shared_landmark_table.h"

#include <mapweave/core/error.h>
#include <mapweave/tiers/byte_allowance.h>
#include <mapweave/tiers/visual_server.h>

#include <algorithm>
#include <deque>
#include <utility>

namespace mapweave::tiers {

inline std::string name_of(const SessionId& session) { return "client " + to_string(session); }

// The robot's pose in the team's frame; with the inverse, in the map's. Scale moves its camera, not the extrinsics.
inline Pose3 carried(const Sim3& team_from_map, const Pose3& map_from_robot, const Pose3& robot_from_camera) {
  const Pose3 map_from_camera = compose(map_from_robot, robot_from_camera);
  return compose(compose(team_from_map.pose, Pose3{team_from_map.scale * map_from_camera.t, map_from_camera.q}),
                 inverse(robot_from_camera));
}

// Number of landmarks that the client's limit of bytes still allows to send.
std::size_t landmarks_within(const ByteAllowance& downlink);
// `count` of them, evenly picked.
template <class T>
std::vector<T> thinned(std::vector<T> all, std::size_t count) {
  if (all.size() <= count) return all;
  for (std::size_t i = 0; i < count; ++i)
    if (const std::size_t from = i * all.size() / count; from != i) all[i] = std::move(all[from]);
  all.resize(count);
  return all;
}

// Another client's keyframe that this client was sent.
struct SentKeyframe {
  Pose3 map_from_camera;
  double scale = 1.0;
  std::uint64_t by = 0;                             // number of the view in which it was looked up last
  std::uint32_t share = 0;                          // number of the last share that spoke of it
  std::map<LandmarkId, Eigen::Vector3d> landmarks;  // in the camera's frame
};

struct VisualServer::Client {
  static constexpr std::size_t kMostBorrowed = 1000;  // borrowed landmarks of one keyframe that are kept
  static constexpr std::size_t kMostViews = 8;
  static constexpr std::int64_t kFarthest_ns = std::int64_t{1} << 61;  // from the epoch: no clock shows that

  struct Part {  // one of its maps
    MapId name;  // the server's name for it; the client's is `client_map`
    UpdateInbox inbox;
    SharedLandmarkTable shared = {};
    std::map<SessionId, std::uint64_t> owners = {};  // numbers from 1, for keys of the landmark table
    std::vector<std::uint64_t> owner_of_session =
        {};                       // by the view's numbers of sessions; 0: nothing of it is shared with this client
    std::uint64_t owners_by = 0;  // the view
    std::uint32_t forgotten = 0;
    std::uint32_t shares = 0;
    std::uint32_t sent_shares = 0;                  // the number of the last one
    std::uint32_t missed = 0;                       // how often the client has said that any were lost
    std::map<NodeId, SentKeyframe> keyframes = {};  // of others, that the client keeps
    std::optional<std::uint32_t> lacks_after = {};  // of those, what shares of higher numbers spoke of
    std::uint32_t keyframe_shares = 0;
    std::uint64_t corrected_by = 0;                                          // the view
    std::map<NodeId, std::map<LandmarkId, LandmarkSighting>> borrowed = {};  // seen by its keyframes
    std::vector<std::uint64_t> shelved = {};  // what was taken out of the map, by its numbers on the shelf
    std::size_t tried_with = 0;               // keyframes in memory, when the shelf took nothing more

    // What the client says of shares that were lost.
    void note_missed(const ClientView& view) {
      const std::uint32_t before = std::exchange(missed, view.missed);
      if (view.missed == before) return;
      const std::uint32_t after = view.missed == before + 1 ? view.missed_after : 0;  // else it missed more than that
      lacks_after = std::min(lacks_after.value_or(after), after);
      shared.clear();
      corrected_by = 0;
    }
    void forget_lacking() {
      if (!lacks_after) return;
      for (auto one = keyframes.begin(); one != keyframes.end();)
        one = one->second.share > *lacks_after ? keyframes.erase(one) : std::next(one);
      lacks_after.reset();
    }
    void note(const MapUpdate& update) {
      if (update.base == 0) {
        borrowed.clear();
        shelved.clear();
        tried_with = 0;
      }
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
          change.id = id;
          change.seen.push_back(sighting);
        }
      std::vector<LandmarkChange> result;
      for (auto& entry : changes) result.push_back(std::move(entry.second));
      return result;
    }
  };
  // Where it was, the last few times that it said so.
  void note(const ClientView& view) {
    if (view.stamp < Stamp{-kFarthest_ns} || Stamp{kFarthest_ns} < view.stamp) return;
    while (!seen_at.empty() && !(seen_at.back().stamp < view.stamp)) seen_at.pop_back();
    seen_at.push_back(view);
    if (seen_at.size() > kMostViews) seen_at.pop_front();
  }

  std::map<MapId, Part> parts;     // by what the client calls them
  std::size_t waiting_bytes = 0;   // in the inboxes of all
  std::deque<ClientView> seen_at;  // by stamp
  mutable ByteAllowance downlink;
};

struct VisualServer::State {
  TierId edge;
  ServerOptions options;
  fusion::FusionOptions fusion_options;
  rig::RigOptions rig;
  std::map<SessionId, Client> clients;
  MapMerge::Snapshots starts;  // that it began with
  std::set<MapId> names;
  std::vector<std::pair<SessionId, MapId>> order;  // in which maps became known
  std::set<Hash> vetoed;
  std::set<std::pair<RobotId, RobotId>> refused;
  std::shared_ptr<MapMerge> last;  // that was taken over
  std::shared_ptr<MapMerge> merge;
  std::shared_ptr<BackgroundWork> work;  // of the merge
  std::shared_ptr<const TeamView> view;
  std::shared_ptr<fusion::BagOfWordsCache> pictures = std::make_shared<fusion::BagOfWordsCache>();
  std::uint64_t views = 0;                          // counted
  std::size_t keyframes = 0, merged_keyframes = 0;  // published; when the maps were merged last
  std::size_t counted = 0;                          // of those published, at the last advance
  std::optional<Stamp> published_at;                // any of them, at an advance
  std::set<SessionId> published_since;              // clients that published any of them since
  bool vetoed_since = false;
  std::shared_ptr<Shelf> shelf;
  std::string shelf_trouble;  // why it takes nothing more now
  std::size_t lost = 0;       // keyframes that nobody keeps, for want of a shelf

  Client& client(const SessionId& session) {
    const auto found = clients.find(session);
    if (found == clients.end())
      throw Error(ErrorCode::kMissing, "it has not greeted", name_of(session), "say hello first");
    return found->second;
  }

  MapId fresh_name(const MapId& client_map) {
    MapId name = client_map;
    for (int run = 2; !names.insert(name).second; ++run) name = MapId(client_map.str() + "-" + std::to_string(run));
    return name;
  }

  MapMerge::Snapshots snapshots() const;
  std::vector<LandmarkId> forgotten() const;
  // Keyframes that the client has forgotten leave memory where there are too many.
  void make_room(Client::Part& part);
  // A part's map with what lies on the shelf.
  struct Whole {
    std::shared_ptr<const Map> in_memory;
    std::vector<std::uint64_t> shelved;
    std::map<NodeId, Pose3> poses;
    std::shared_ptr<const Shelf> shelf;
    Map map() const;
  };
  Whole whole(const Client::Part& part) const;
  fusion::FusionInput input() const;

  bool is_due(Stamp now);  // a merge
  void begin(Stamp now, WorkerPool& pool);

  // What is let go of is left to whoever holds the work.
  void abandon() {
    merge.reset();
    work.reset();
  }
  void take_over() {
    work->run();
    view = merge->view;
    ++views;
    last.swap(merge);
    merge.reset();
    work.reset();
  }

  // Runs of other cameras of its robot.
  using Entry = std::pair<const SessionId, Client>;
  std::vector<const Entry*> rig_cameras(const ClientId& camera) const;
  // Whether the team gave one of its maps the scale of others: a single camera does not measure them.
  bool has_scale_of_others(const Client& client) const;

  // The part's node that the team has and that is nearest to `place`, in the map's frame or in the team's; null where
  // there is none.
  enum class Frame { map, team };
  static const Node* nearest(const Client::Part& part, const TeamView::Member& member, const Eigen::Vector3d& place,
                             Frame frame);
  matching::Frustum frustum(const CameraGeometry& camera, const Pose3& team_from_robot) const;
  // Where a robot was in the team, and whose keyframe there says so.
  struct RobotPlace {
    const TeamView::Component* component;
    Pose3 team_from_robot;
    NodeId beside;
  };
  // By a client's word of where its robot is in its map.
  static std::optional<RobotPlace> in_team(const TeamView& team, const Client& client, const MapId& client_map,
                                           const Pose3& map_from_robot);
  // By other cameras of the client's robot: they are where it is.
  std::optional<RobotPlace> place_by_rig_camera(const SessionId& camera, Stamp when, const TeamView& team) const;
  // Whose landmarks and keyframes a client does not receive.
  std::set<SessionId> sessions_not_shared(const SessionId& to, const TeamView::Member& member) const;
  // Of a client that receives keyframes of others: where it is, and how many it keeps; 0: it has not said.
  struct Receiver {
    const SessionId& session;
    const TeamView::Member& member;
    Eigen::Vector3d in_team;
    std::size_t room = 0;
  };
  struct NearKeyframe {
    double apart_m;
    const Node* node;  // in the team
    double scale;      // of the team, in units of its features' depths
  };
  std::vector<NearKeyframe> nearest_of_others(const Client::Part& part, const Receiver& to) const;
  // A keyframe of others in a client's map, as the client's keyframe nearest to it says.
  struct KeyframeInMap {
    Pose3 map_from_camera;
    double scale;
    Sim3 map_from_team;
  };
  static std::optional<KeyframeInMap> in_map_of(const Client::Part& part, const TeamView::Member& member,
                                                const NearKeyframe& one);
  static std::vector<DescribedLandmark> new_landmarks_of(const SentKeyframe& sent, const Receiver& to,
                                                         const NodeId& keyframe, const KeyframeInMap& here);
  void note_sent(SentKeyframe& sent, const SharedKeyframe& shared) const;
  // What a share may still hold; `burst`: what is saved up at most.
  struct Budget {
    double bytes, burst;
  };
  Budget budget(const Client& client, const Share& so_far) const;
  static Receiver receiver(const SessionId& to, const ClientView& client_view, const TeamView::Member& member,
                           const Node& near);
  static bool holds(const Client::Part& part, const TeamView::Member& member, const LandmarkId& id);
  // Which keyframes the client may drop, what of those it has moved, and the nearest ones that it lacks.
  void add_keyframes(Client::Part& part, const Receiver& to, const Budget& budget, Share& share) const;
  void note_owners(Client::Part& part, const SessionId& to, const TeamView::Member& member) const;
  // What there is of landmarks in view that it does not have, with their keys in SharedLandmarkTable.
  struct Offer {
    const matching::LandmarkIndex* index;
    matching::LandmarkIndex::Seen seen;
    std::uint64_t key;
  };
  std::vector<Offer> offers_for(Client::Part& part, const SessionId& to, const TeamView::Member& member,
                                const matching::Frustum& seen_from) const;
  std::vector<DescribedLandmark> landmarks_for(Client::Part& part, const SessionId& to, const ClientView& client_view,
                                               const TeamView::Member& member, const Node& near,
                                               std::size_t most) const;
  // Where the team has a client's keyframes, in the frame of the client's first one: a rigid motion of all of them is
  // no correction.
  void correct(Client::Part& part, const TeamView::Member& member, Share& share) const;
};

}  // namespace mapweave::tiers
