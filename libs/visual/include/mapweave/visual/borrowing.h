#pragma once
// What a camera client takes from a server (CVS III-B, III-C): landmarks that others made, and its own place where it does not know it.
// Coordinates are those of the map that the client tells (VisualClient::take_updates): of the robot's base at the session's first keyframe.

#include <mapweave/core/geometry.h>
#include <mapweave/core/ids.h>
#include <mapweave/core/stamp.h>
#include <mapweave/maps/keyframe.h>
#include <mapweave/matching/landmark_index.h>

#include <vector>

namespace mapweave::visual {

// Whose camera it is, and where on the robot: what others are told hangs on the robot.
struct ClientPlace {
  ClientId client;
  Pose3 robot_from_camera;
};

// As LandmarkIndex::retrieve answers, in the frame of the session's map. Its point is said to be right within sigma_m; updated_by is not
// read.
using BorrowedLandmark = matching::DescribedLandmark;

// Where was this taken? Of a client that has no place; KeyframeFeatures is what keyframes are told as, so it goes over a wire like one.
struct PlaceRequest {
  Stamp stamp;
  KeyframeFeatures features;
};

struct PlaceAnswer {
  Stamp stamp;                              // of the request
  MapId map;                                // whose frame the answer is in, and whose landmarks these are
  int session = -1;                         // of the client, whose map's frame this is; -1: another map's, where a session begins
  Pose3 map_from_robot;                     // of the frame asked for; lengths are true
  std::vector<BorrowedLandmark> landmarks;  // that it should show
};

enum class PlaceVerdict {
  taken,      // the client goes on from there
  not_asked,  // for no frame that is waited for: answered before, or too late
  placed,     // meanwhile the client knows where it is
  unsound,    // no pose, no landmarks, or no such session
  disagrees   // the frame does not show the landmarks there
};

// A session that began with a server's answer: its map's frame is the frame that `map` had then.
struct AdoptedFrame {
  int session = 0;
  MapId map;
};

}  // namespace mapweave::visual
