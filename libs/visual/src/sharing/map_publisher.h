#pragma once
// What is published of a client's map: content once, then what moved and what was seen again (CVS III-A; CORB-SLAM 2.3:
// light updates).

#include "mapping/landmark_map.h"

#include <mapweave/maps/map_update.h>
#include <mapweave/visual/visual_client.h>

#include <map>
#include <memory>
#include <set>

namespace mapweave::visual {

std::shared_ptr<const CameraGeometry> geometry_of(const LandmarkMap& map, const Pose3& robot_from_camera);
// depths: metres along the optical axis, of each feature; 0 unknown.
KeyframeFeatures packed(const matching::OrbFeatures& features, const std::vector<float>& depths,
                        std::shared_ptr<const CameraGeometry> geometry);

class MapPublisher {
 public:
  MapPublisher(ClientPlace place, SessionId session, double sigma_px, double inverse_depth_sigma);
  // What changed since the last call, one update for each map that it touches.
  std::vector<MapUpdate> take(const LandmarkMap& map, PublishedDetail detail);
  // Of one map, what was published: the next update of it says all, and builds on nothing.
  void forget(int part);
  // Keyframes that the map has forgotten, as they lie now; by id.
  std::vector<PlacedForgotten> forgotten(const LandmarkMap& map) const;

 private:
  struct SentKeyframe {
    std::uint32_t serial = 0;
    int part = -1;  // -1: not sent
    Pose3 map_from_robot;
  };
  struct SentLandmark {
    std::uint32_t serial = 0;
    int part = -1;
    std::uint32_t anchor = 0;  // the keyframe's serial number
    Eigen::Vector3i point_units = Eigen::Vector3i::Zero();
    std::vector<std::uint32_t> seen;  // serial numbers of keyframes, ascending
  };
  MapUpdate& update_of(int part);
  NodeId node_id(std::uint32_t serial) const { return {session_, serial}; }
  LandmarkId landmark_id(std::uint32_t serial) const { return {session_, serial}; }
  Pose3 map_from_robot(const View& view) const;
  std::shared_ptr<const Payload> payload_of(const LandmarkMap& map, const Keyframe& keyframe);
  LandmarkSighting sighting_of(const LandmarkMap& map, const Observation& observation) const;
  void publish_keyframes(const LandmarkMap& map, PublishedDetail detail);
  bool say_forgotten(const SentKeyframe& sent);
  void publish_forgotten(const LandmarkMap& map, PublishedDetail detail);
  void publish_landmarks(const LandmarkMap& map, PublishedDetail detail);
  void publish_borrowed(const LandmarkMap& map, PublishedDetail detail);

  ClientPlace place_;
  SessionId session_;
  double sigma_px_;             // of a sighting on level 0
  double inverse_depth_sigma_;  // of a depth camera's, away from edges
  std::shared_ptr<const CameraGeometry> geometry_;
  std::vector<SentKeyframe> keyframes_;  // by slot
  std::vector<SentLandmark> landmarks_;
  std::vector<SentLandmark> borrowed_;                    // by slot; sightings alone
  std::map<std::uint32_t, SentKeyframe> kept_elsewhere_;  // keyframes that were said to be forgotten; by serial number
  std::set<std::uint32_t> forgotten_now_;                 // serial numbers of keyframes that the map has forgotten
  std::map<int, std::uint64_t> sequence_;                 // by part
  std::set<int> forgotten_;                               // parts
  std::map<int, MapUpdate> updates_;                      // of this call
};

}  // namespace mapweave::visual
