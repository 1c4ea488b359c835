#pragma once
// Keyframes and landmarks that other clients made and a server shares (CORB-SLAM 2.3, rule 2): where they are in the
// client's own map, and which of them show what a picture shows. Nobody but their owners moves or publishes them; where
// the client's own map moves, they keep their place beside the client's keyframes.

#include "loops/judged_place.h"

#include <mapweave/matching/landmark_index.h>
#include <mapweave/matching/place_index.h>
#include <mapweave/visual/visual_client.h>

#include <map>
#include <optional>

namespace mapweave::visual {

// Where a picture was taken, as a keyframe of another client says.
struct SharedPlace {
  NodeId keyframe;
  int session = 0;
  View view;                 // of the picture's camera
  View keyframe_view;        // of the other's
  double scale = 1.0;        // what is one long to the picture's side is so long in the map
  std::uint32_t anchor = 0;  // the own keyframe (its serial number) beside which the other's was placed
};

// Whether its numbers make sense.
bool is_sound(const SharedKeyframe& shared);
// Of the session's keyframes, the one whose serial number is nearest; -1 without any.
int keyframe_beside(const LandmarkMap& map, int session, std::uint32_t serial);

class SharedKeyframes {
 public:
  // Without a vocabulary none is recognised.
  SharedKeyframes(std::optional<matching::BinaryVocabulary> vocabulary, const ClientOptions& options);

  struct Receiver {
    int session = 0;
    SessionId own;
    Eigen::Vector3d centre;  // of its camera
  };
  // For a session's map, in the frame of the map in memory: whole ones become known, light ones move. Where there are
  // too many, those of other sessions go, then those farthest from the camera. What is not sound, or is its own, is
  // left out; how many were not is answered.
  int receive(const LandmarkMap& map, const Receiver& receiver, const std::vector<SharedKeyframe>& keyframes);
  void drop(const std::vector<NodeId>& ids);
  void forget(int session);  // all of its
  // The map's keyframes were at `before` (by slot), and their scales grow: each shared one stays where it was beside
  // the own keyframe by which it was placed.
  void follow(const LandmarkMap& map, const std::vector<View>& before, const std::vector<double>& scales);
  std::vector<PlacedShared> placed() const;

  // Landmarks that the camera should see.
  std::vector<DescribedLandmark> in_view(int session, const View& view, const Pinhole& camera) const;
  // Those that look most like these features, of a session's map or of any; first the one that does most.
  std::vector<NodeId> alike(std::optional<int> session, const matching::OrbFeatures& features, std::size_t most) const;
  std::optional<SharedPlace> judged(const NodeId& keyframe, const JudgedPlace& here) const;

  bool empty() const { return known_.empty(); }
  std::size_t size() const { return known_.size(); }
  std::size_t dropped() const { return dropped_; }  // for want of room, so far
  // How often another session's map took keyframes of this one's, or their room: who shared them does not know.
  std::uint32_t times_lost(int session) const;
  std::uint32_t room() const { return static_cast<std::uint32_t>(options_.memory.shared_keyframes); }
  bool has_received() const { return has_received_; }

 private:
  struct Known {
    int session = 0;
    View view;  // of the other camera, in the own map
    double scale = 1.0;
    Pinhole camera;
    matching::OrbFeatures features;
    std::vector<float> depths;                          // in units of the own map; 0 unknown
    std::map<LandmarkId, DescribedLandmark> landmarks;  // in the other camera's frame
    std::uint32_t anchor = 0;
  };
  using Entry = std::map<NodeId, Known>::iterator;
  bool take_whole(const SharedKeyframe& shared, Known& known) const;
  static void grow(Known& known, double factor);
  void note(const NodeId& id, Known& known);
  void limit(const Receiver& receiver);
  Entry take_out(Entry entry);

  std::optional<matching::BinaryVocabulary> vocabulary_;
  ClientOptions options_;
  std::map<NodeId, Known> known_;
  std::optional<matching::PlaceIndex> index_;  // once there is anything
  std::size_t dropped_ = 0;
  std::map<int, std::uint32_t> times_lost_;  // by session
  bool has_received_ = false;
};

}  // namespace mapweave::visual
