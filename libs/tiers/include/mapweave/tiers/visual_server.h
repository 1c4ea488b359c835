#pragma once
// The edge's map server for cameras (CORB-SLAM 2.2, 2.3; CVS III): keeps what its clients publish, merges it by fuse(),
// and sends each client what others know of where it is. Clients write their own maps and no others (CORB-SLAM 2.3):
// what is believed of all lies beside them, so that nobody waits while it is computed. Clients whose robot is the same
// are cameras of one robot (CVS III-D): their maps are merged first (rig/robot_rigs.h), and where one of them is the
// others are. A state machine: no thread, no clock, no file.

#include <mapweave/core/background_work.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/maps/exchange.h>
#include <mapweave/matching/landmark_description.h>
#include <mapweave/rig/rig.h>
#include <mapweave/tiers/kept_map.h>
#include <mapweave/tiers/shelf.h>
#include <mapweave/tiers/update_inbox.h>

#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace mapweave::tiers {

// none: clients are kept and merged. view: they receive shared landmarks that they may see, and their places when they
// ask. full: besides, where the team has their keyframes. global: besides, keyframes and landmarks of the whole team.
enum class Sharing { none, view, full, global };

struct ServerOptions {
  Sharing share = Sharing::none;
  double share_rate_hz = 2.0;
  int fuse_after = 10;
  double fuse_share = 0.1;
  double fuse_idle_s = 3.0;
  double fuse_delay_s = 1.0;
  bool wait = true;
  int judged_pairs = 120;
  double far_m = 10.0;
  double correct_m = 0.05;
  double most_bytes_per_s = 0.0;
  int keyframes = 5000;
  bool across_edges = true;
  matching::LandmarkIndexOptions index;
  matching::RetrievalOptions retrieval;
  matching::DescriptionOptions description;
  template <class Visitor>
  void describe(Visitor& v) {
    v.choice(
        "share", share,
        {{"none", Sharing::none}, {"view", Sharing::view}, {"full", Sharing::full}, {"global", Sharing::global}},
        "what the camera map server of an edge sends to its clients; none: nothing; view: landmarks of other robots "
        "that they may see, their own ones that they forgot (visual.memory.keyframes), and "
        "relocalisation when lost; full: also corrections of their keyframes from the merged map; global: also "
        "keyframes and "
        "landmarks of all other robots, which clients keep (visual.memory.shared_keyframes) to track, relocalise and "
        "close loops by without the server");
    v.positive("share_rate_hz", share_rate_hz,
               "updates per second of recorded time that a client and the server exchange; larger values react faster "
               "and send more");
    v.integer("fuse_after", fuse_after, 1, 100000,
              "mean number of new keyframes per active client after which the server merges all maps again; larger "
              "values merge less "
              "often");
    v.non_negative("fuse_share", fuse_share,
                   "least share of new keyframes, relative to those already merged, at which the server merges all "
                   "maps again; larger values merge large maps less often");
    v.non_negative("fuse_idle_s", fuse_idle_s,
                   "time in seconds without a new keyframe after which the server merges what is new, however little; "
                   "larger values wait longer");
    v.number("fuse_delay_s", fuse_delay_s, 0.0, 600.0,
             "recorded time in seconds from the start of a merge until its result is used; fixed, so that results do "
             "not depend on computing time; larger values use it later and leave more time to compute");
    v.flag("wait", wait,
           "use the result of a merge exactly fuse_delay_s after its start, waiting for the computation if needed; "
           "false: as soon as it is "
           "computed, as live servers do, which is not repeatable");
    v.integer("judged_pairs", judged_pairs, 1, 1000000,
              "most keyframe pairs that one full merge compares for each map, spread evenly over the other maps; "
              "larger values find more common places and take longer. Each other map gets at least 12 pairs, and at "
              "most fusion.visual.most_pairs");
    v.positive("far_m", far_m,
               "landmarks farther than this distance in metres from a camera are not shared with it; larger values "
               "share more landmarks");
    v.positive("correct_m", correct_m,
               "a client receives corrections of its keyframes once they differ from the merged map by more than this "
               "distance in metres (root mean square); larger values correct less often");
    v.non_negative("most_bytes_per_s", most_bytes_per_s,
                   "largest mean rate in bytes per second at which the server sends to one client; smaller values "
                   "first share fewer landmarks, then delay corrections and keyframes; larger values share more; "
                   "relocalisation is "
                   "always answered; 0: unlimited");
    v.integer("keyframes", keyframes, 20, 10000000,
              "most keyframes of a client's map that the server holds in memory; it keeps what a client forgets "
              "(visual.memory.keyframes), beyond this number on the disk, no longer shared but part of "
              "the final map; larger values share more and need more memory");
    v.flag("across_edges", across_edges,
           "camera map servers of several edges send each other, through the cloud, what their clients publish, so "
           "that cameras of different edges share too; false: cameras share within their edge alone");
    v.section("index", index, "lookup of shared landmarks by place");
    v.section("retrieval", retrieval, "which landmarks of other robots a camera may see from where it is");
    v.section("description", description, "descriptors and position errors of shared landmarks");
  }
};

// Where a robot is, by all of its cameras.
struct RobotInTeam {
  Stamp stamp;            // of the newest word of where it was
  Pose3 team_from_robot;  // of its base, as maps were merged last: merging them again may move it
  MapId team;             // the lowest of the maps that are merged there: the first member of its component
  int cameras = 0;        // that it rests on
};

class VisualServer {
 public:
  // rig: of clients that are cameras of one robot.
  VisualServer(TierId edge, ServerOptions options, fusion::FusionOptions fusion, rig::RigOptions rig = {});
  ~VisualServer();
  // For what clients have forgotten beyond ServerOptions::keyframes. Without one the server forgets that, too.
  void use_shelf(std::shared_ptr<Shelf> shelf);

  // Maps of sessions before, as of clients that are not there: merged with those of clients, shared with them, and
  // known again when they are lost. What lasers mapped of them is left out, and so is a map without keyframes or
  // without a unit. Before the first client greets; no client is called as their robots.
  void begin_with(const std::vector<Map>& maps);

  const Hash& vocabulary() const;  // that its clients have, too
  // A client's first word, and its word after a break: what is stored of its maps, so that it repeats the rest. Throws
  // Error(kUnsupported) where its vocabulary is another one, kBadInput where there are too many clients.
  std::vector<Receipt> greet(const Hello&);

  // It has gone, perhaps to come back: its maps stay; what waits for a missing update, what was shared with it, and a
  // client that published nothing, are forgotten.
  void leave(const SessionId& session);

  struct Received {
    Receipt receipt;                  // what to repeat
    std::vector<std::string> stored;  // updates to be kept, in order, before the client is informed that they are
  };
  // An encoded MapUpdate; of one map in any order and more than once. Throws Error, nothing is stored then, and other
  // clients do not notice: kMissing for who has not greeted, kCorrupt or kUnsupported for what cannot be decoded,
  // kBadInput for what does not fit, and for maps, nodes and landmarks of others.
  Received receive(const SessionId& from, std::string_view bytes);
  // Of bytes that were decoded elsewhere.
  Received receive(const SessionId& from, MapUpdate update, std::string_view bytes);
  // After what came at one moment: begins to merge the maps where enough is new, and takes over what was begun long
  // enough ago. The pool outlives the server.
  void advance(Stamp now, WorkerPool& pool, bool may_begin = true);
  // The merge under way, to be run on any thread while the server goes on; null: none. advance() does it itself where
  // nobody did.
  std::shared_ptr<BackgroundWork> pending() const;
  // Of a merge that threw: what was merged before it stays, and the next one begins once there is enough new.
  void abandon();

  // What there is to send a client at this place; nothing where it knows all of it, or sharing is off. Throws
  // Error(kMissing, kBadInput) as receive.
  std::optional<Share> share(const SessionId& to, const ClientView& view);
  // Of a client that is sent nothing now: where it is. Throws as share.
  void note(const SessionId& from, const ClientView& view);
  // Where the picture was taken: as it is known again, else by where another camera of the robot said it was within
  // half a second; nullopt where neither says it, nothing is known of what the camera should see there, or sharing is
  // off.
  std::optional<PlaceAnswer> place(const SessionId& from, const PlaceRequest& request, WorkerPool& pool) const;
  // The same in two steps: the search, to be run on any thread while the server goes on, and the answer, after it.
  // null: as nullopt.
  class PlaceSearch;
  std::shared_ptr<PlaceSearch> place_search(const SessionId& from, PlaceRequest request) const;
  std::optional<PlaceAnswer> answer(const SessionId& from, const PlaceSearch& search) const;

  // By the views of its cameras' newest runs, whatever is shared; one with a single camera too. Which cameras are
  // believed, and how one hands over to the others: rig/robot_pose.h. One is silent once two views in a row did not
  // come (share_rate_hz). Where their maps are not merged to one, those speak that are the most, else those that spoke
  // last. Views are stamped by one clock. nullopt: no camera said where it is, or no map that it is in is among those
  // that were merged last.
  std::optional<RobotInTeam> robot(const RobotId& robot) const;

  // Robots whose maps must not be matched to each other from the next merge on, the lower id first.
  void refuse(std::set<std::pair<RobotId, RobotId>> robots);
  // A judgement that is not to be believed from the next merge on: what rested on it comes apart.
  void veto(const Hash& judgement);
  const std::set<Hash>& vetoed() const;
  // Every client's own maps, each as one update that says all: received by another server, in this order, they make it
  // the same as this one. Judgements are made again.
  using Snapshot = std::vector<std::pair<SessionId, std::string>>;
  Snapshot snapshot() const;
  // The same of the maps as they are now, encoded where it is called: on any thread, while the server goes on.
  std::function<Snapshot()> snapshot_to_encode() const;
  // Every client's own map, as published; ids are those of the clients', unless one was there before (of another run):
  // "alpha.front-2". And the maps that it began with.
  std::vector<Map> maps() const;
  // Of those, a client's own that hold what it has forgotten (KeptMap); ids of maps are the client's.
  std::vector<KeptMap> kept_for(const SessionId& client) const;
  // The same of the maps as they are now, read where it is called: on any thread, while the server goes on.
  std::function<std::vector<KeptMap>()> kept_to_read(const SessionId& client) const;
  // For people: why cameras of one robot are not merged, by the last merge; keeping_trouble().
  std::vector<std::string> notes() const;
  // What could not be kept, or not on the disk, of what clients forgot.
  std::optional<std::string> keeping_trouble() const;
  // As merged last; empty before. Members are clients' own maps, of a merged rig or not; verdicts name a rig by the
  // member that began first.
  const fusion::FusionResult& merged() const;
  // All merged now. Neither the order in which updates came nor threads change a byte.
  fusion::FusionResult seal(WorkerPool& pool, Progress& progress);

 private:
  struct Client;
  struct State;
  std::unique_ptr<State> state_;
};

class VisualServer::PlaceSearch {
 public:
  ~PlaceSearch();
  void run(WorkerPool& pool);

 private:
  friend class VisualServer;
  struct State;
  explicit PlaceSearch(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::tiers
