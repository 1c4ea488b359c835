#pragma once
// What robots and servers send each other beside MapUpdates, and how that goes over a wire: what camera clients ask and
// receive (CVS III-B, III-C), small, so with less precision than maps are kept with; what robots sense that do not map
// themselves (RecSLAM III-B), whole; and what a coordinator receives of maps.

#include <mapweave/core/error.h>
#include <mapweave/maps/map_update.h>

#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace mapweave {

// A landmark, and how it is known again. Frame `map`: of whoever fills it in.
struct DescribedLandmark {
  LandmarkId id;
  Eigen::Vector3d point_in_map = Eigen::Vector3d::Zero();
  BinaryDescriptor descriptor{};
  Eigen::Vector3d feature_from_point =
      Eigen::Vector3d::Zero();  // axes of map, metres: the descriptor's feature lies so far beside it
  Eigen::Vector3d direction =
      Eigen::Vector3d::Zero();               // axes of map, unit: from those that saw it towards it; zero: unknown
  double nearest_m = 0.0, farthest_m = 0.0;  // of the cameras that saw it; farthest 0: unknown
  double sigma_m = 0.02;                     // of its place, each axis
  ClientId updated_by;                       // last; stays with the server
};

// The first word, of a camera's client to its server; of robots, edges and the cloud to each other.
struct Hello {
  SessionId session;
  Hash vocabulary;  // what both must have alike: pictures' words mean nothing to who has others; else a configuration
};

// Client -> server: where it is now, and so what it may see.
struct ClientView {
  MapId map;  // of the session that it is in
  Stamp stamp;
  Pose3 map_from_robot;
  std::uint32_t forgotten = 0;     // how often it forgot all shared landmarks
  std::uint32_t room = 0;          // keyframes of others that it keeps at most; 0: it has none yet, and does not say
  std::uint32_t missed = 0;        // how often it found that it lacks what shares of this map brought, or should have
  std::uint32_t missed_after = 0;  // the last time: shares of higher numbers than this
};

// Client -> server: where was this taken? Of a client that has no place.
struct PlaceRequest {
  Stamp stamp;
  KeyframeFeatures features;
};

// Server -> client.
struct PlaceAnswer {
  Stamp stamp;           // of the request
  MapId map;             // whose frame the answer is in: the client's own, or another's, where it begins a session
  Pose3 map_from_robot;  // of the frame asked for; at true scale
  std::vector<DescribedLandmark> landmarks;  // that it should show, in that frame
};

// A keyframe that another client made (CORB-SLAM 2.3): whole once; light afterwards, where it moves. Its landmarks move
// along with it.
struct SharedKeyframe {
  NodeId id;
  Pose3 map_from_camera;
  double scale = 1.0;                        // of the depths of its features, in units of the map
  std::optional<KeyframeFeatures> features;  // nothing: light, of one that was sent before
  std::vector<DescribedLandmark> landmarks;  // that it holds: new, or moved beside it; in the map's frame
};

// Server -> client.
struct Share {
  MapId map;                                   // the client's, whose frame this speaks of
  std::vector<DescribedLandmark> landmarks;    // of others, ascending by id
  std::vector<MovedNode> corrected;            // where the team has the client's own keyframes, ascending by id
  double scale = 1.0;                          // of `corrected`, in units of the client's map
  std::vector<SharedKeyframe> keyframes = {};  // of others, each once
  std::vector<NodeId> dropped = {};            // keyframes of others that it need not keep any longer
  std::uint32_t number = 0;                    // of this map's shares, from 1: one left out was lost; 0: nobody counts
};
inline constexpr std::size_t kMostSharedKeyframes = 1000;      // of one share; as many are dropped
inline constexpr std::size_t kMostLandmarksOfKeyframe = 1000;  // of one that is shared

// The last word of a robot. A stream may end early; what came before it counts. A robot that is no task of its edge's
// process says the rest, too.
struct StreamEnd {
  std::optional<Error> trouble;         // why it ended early; empty at the end of the log
  std::vector<std::string> notes = {};  // what is implausible of what was sensed; at most kMostNotes
  std::string log = {};                 // where it was recorded, on the robot's machine; empty: not said
  Hash log_sha256 = {};
};
inline constexpr std::size_t kMostNotes = 100;

// A scan that the robot had no room to keep while its edge was away. Its number is taken, so that nobody waits for it.
struct LostScan {};

// Heading by an inertial unit, accumulated since any start.
struct InertialYaw {
  double yaw_rad = 0.0;  // not wrapped
};

// What a robot that maps on board made, before its end: its maps, each as its first update, encoded, and a report on
// how. Cut into parts.
struct MappedPart {
  bool is_report = false;  // else of a map
  bool ends = false;       // the last part of this map or report
  std::string bytes;       // at most kMostPartBytes
};
inline constexpr std::size_t kMostPartBytes = std::size_t{8} << 20;

// Robot -> edge: one scan, one pose of the wheels (odometry_from_robot), one heading of the inertial unit, that a scan
// was lost, a part of what it mapped on board, or the end.
struct Sensed {
  RobotId robot;
  std::uint64_t sequence = 0;  // counts from 1
  Stamp stamp;                 // of the end: nothing
  std::variant<PackedScan, Pose3, StreamEnd, InertialYaw, LostScan, MappedPart> body;
};

// Points to a tenth of a millimetre, directions to a degree, distances and deviations to 3 %: what comes back is
// encoded to the same bytes. decode throws as decode_map_update does.
std::string encode(const Hello&);
std::string encode(const ClientView&);
std::string encode(const PlaceRequest&);
std::string encode(const PlaceAnswer&);
std::string encode(const Share&);
std::string encode(const Sensed&);
Hello decode_hello(std::string_view bytes, const std::string& where);
ClientView decode_client_view(std::string_view bytes, const std::string& where);
PlaceRequest decode_place_request(std::string_view bytes, const std::string& where);
PlaceAnswer decode_place_answer(std::string_view bytes, const std::string& where);
Share decode_share(std::string_view bytes, const std::string& where);
Sensed decode_sensed(std::string_view bytes, const std::string& where);

}  // namespace mapweave
