#pragma once
// One camera's SLAM: tracking and local mapping (CORB-SLAM 2.1; CVS III-A). A frame is first laid over the one before
// (grey values around landmarks), then each landmark is found to a fraction of a pixel by how a keyframe saw it, and
// the pose follows from all of them. Keyframes add landmarks and refine those around them. What is not known of the
// sensor, its readout time and a constant error of its disparities, is learnt on the way.

#include <mapweave/core/background_work.h>
#include <mapweave/core/geometry.h>
#include <mapweave/maps/map_update.h>
#include <mapweave/matching/binary_vocabulary.h>
#include <mapweave/visual/borrowing.h>
#include <mapweave/visual/client_options.h>
#include <mapweave/visual/frame.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::visual {

enum class TrackState { waiting, tracked, lost };  // waiting: for a first frame with depth, or for parallax

struct Tracked {
  TrackState state = TrackState::waiting;
  Pose3 map_from_camera;  // where tracked
  int landmarks = 0;      // landmarks that the frame sees
  bool keyframe = false;  // the frame became a keyframe
  int session = 0;        // number of the session whose map it is in
};

struct PlacedFrame {
  Stamp stamp;
  Pose3 map_from_camera;  // in the map of its session
  int session = 0;
};

struct ClosedLoop {
  Stamp found, applied;                  // the frame that found it, the first frame with the corrected map
  std::optional<NodeId> on_shared = {};  // the keyframe of another client that it was found on
};

// A keyframe that another client made and this one keeps.
struct PlacedShared {
  NodeId id;
  int session = 0;        // number of the session whose map it lies in
  Pose3 map_from_camera;  // of the camera that made it
  std::size_t landmarks = 0;
};

struct MappedLandmark {
  Eigen::Vector3d point_in_map;
  int sightings = 0;  // number of keyframes that see it
  int session = 0;
};

// Pose of a keyframe that the client has forgotten (MemoryOptions::keyframes), as take_updates() reports it.
struct PlacedForgotten {
  NodeId id;
  MapId map;  // the map that it lies in now
  Pose3 map_from_robot;
};

// A landmark that the last tracked frame sees.
struct SeenLandmark {
  int landmark = 0;  // the same number in every frame
  Eigen::Vector2d pixel;
  double depth_m = 0.0;
};

// light: small motions and landmarks that one keyframe alone saw are not published; exact: everything, for the end.
enum class PublishedDetail { light, exact };

// Not thread-safe; without threads or clocks of its own. A map's frame is the camera's at its first keyframe. A camera
// that stays lost begins another session, with a map of its own; when it comes to a place that an older session knows,
// the two become one.
class VisualClient {
 public:
  // baseline_m: of the right camera, for frames that have a right picture. Without a vocabulary a lost camera looks for
  // itself among the keyframes around where it was lost only, and no loops are closed.
  VisualClient(Pinhole camera, double baseline_m, ClientOptions options,
               std::optional<matching::BinaryVocabulary> vocabulary = std::nullopt);
  ~VisualClient();
  // In the order of stamps, pictures of the camera's size (contract).
  Tracked add(const Frame& frame);
  // The same map from features alone (a camera gives frames of one kind): they are their landmarks' looks, and begin
  // with depth.
  Tracked add(const FeatureFrame& frame);

  // The correction of the map after a loop, until it is applied (VisualLoopOptions::delay_s); null: nothing is to be
  // done. add() does it itself where nobody did: the results are the same.
  std::shared_ptr<BackgroundWork> pending() const;
  // No more frames come: what is pending is done and applied.
  void finish();

  // What is new, changed and gone since the last call: keyframes with their features once, then their poses alone. One
  // update for each map that is touched: sessions that are apart have maps of their own, named after the client
  // ("alpha.front", "alpha.front.1"). Node and landmark ids name the client's one run and never change. `place` is the
  // same at each call (contract).
  std::vector<MapUpdate> take_updates(const ClientPlace& place, PublishedDetail detail);
  // Of a map that was published: the next take_updates() says all of it, with base 0. What it saw of borrowed landmarks
  // that it has forgotten since is not published again.
  void publish_again(const ClientPlace& place, const MapId& map);

  // Every session's whole map, whatever was published before: as take_updates() on a client that has published nothing
  // yet.
  std::vector<Map> maps(const ClientPlace& place) const;
  // How many keyframes went because the map was full (MemoryOptions::keyframes). Once take_updates() was called, it
  // names them as forgotten and not as removed, and says where they move with the keyframes that are left: a server may
  // keep them. A few hundred bytes are kept for each.
  std::size_t forgotten() const;
  // By id. Of those that went since the first take_updates().
  std::vector<PlacedForgotten> forgotten_keyframes(const ClientPlace& place) const;
  // Of which run its ids speak: from the first frame on.
  std::optional<SessionId> run(const ClientPlace& place) const;

  // Landmarks of others for a session's map, to track by: keyframes look for them by their descriptors, frames follow
  // how those show them. They are never altered: a known one that is sent again takes its new place, what does not fit
  // what the client sees is dropped, what stays out of view for long is forgotten, all of a session's when it is
  // corrected after a loop. take_updates() says what keyframes saw of them (MapUpdate::borrowed). How many are kept is
  // answered: its own ones that it still has, those for a session that is not kept, and what is not sound are left out.
  int borrow(const ClientPlace& place, int session, const std::vector<DescribedLandmark>& landmarks);
  // Keyframes of others with their landmarks, for a session's map (Share::keyframes), at most
  // MemoryOptions::shared_keyframes: they are never altered but by who made them, and never published. With or without
  // the server the client tracks by their landmarks, is found again by them, and closes loops on them, which hold them
  // where they are; where its map is corrected otherwise they move along. How many were taken is answered: those that
  // are its own, light ones that it does not know, and what is not sound are left out.
  int keep_shared(const ClientPlace& place, int session, const std::vector<SharedKeyframe>& keyframes,
                  const std::vector<NodeId>& dropped);
  std::vector<PlacedShared> shared_keyframes() const;  // by id
  std::size_t dropped_shared() const;                  // for want of room
  std::size_t found_by_shared() const;                 // times that it was lost
  // Where the client is: the server shares landmarks that it may see there; nullopt while it has no place.
  std::optional<ClientView> view(const ClientPlace& place) const;
  // Where others say that a session's keyframes are, whose loops they closed (Share::corrected; `scale` as there): the
  // rest of its map moves along, what it borrowed is forgotten. False, and nothing done, while a loop correction is
  // pending, and for what is not sound: no such session, keyframes of others, or a scale that a camera measured itself.
  bool correct(const ClientPlace& place, int session, const std::vector<MovedNode>& corrected, double scale);
  std::size_t borrowed() const;       // that the client holds
  std::size_t borrowed_seen() const;  // that keyframes see

  // Where a camera without a place (lost, or not begun) took its last frame; at most once for each frame. nullopt: it
  // has a place, no frame came since, or it shows too little. Late answers are good for the last four requests. `place`
  // as at take_updates.
  std::optional<PlaceRequest> place_request(const ClientPlace& place);
  // The frame is compared with the answer first. Taken, it is a keyframe, and the next frame is looked for around it.
  PlaceVerdict place(const ClientPlace& place, const PlaceAnswer& answer);
  std::vector<ReanchoredFrame> reanchored() const;  // sessions whose map began with an answer, by session

  std::vector<SeenLandmark> seen() const;
  // Of frames that were tracked, as their keyframes stand now; by stamp. After hours fewer of those long ago
  // (MemoryOptions::frames).
  std::vector<PlacedFrame> trajectory() const;
  std::vector<PlacedFrame> keyframes() const;  // that are kept; by stamp
  std::vector<MappedLandmark> landmarks() const;
  std::vector<int> sessions() const;       // that are apart; the lowest number of those that became one stands for all
  std::vector<ClosedLoop> loops() const;   // by stamp; one that is not applied yet is not among them
  SensorCalibration sensor() const;        // as learnt so far
  std::vector<std::string> notes() const;  // what seems wrong with the pictures, and what to do about it

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::visual
