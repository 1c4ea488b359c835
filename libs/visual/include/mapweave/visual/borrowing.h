#pragma once
// What a camera client takes from a server (CVS III-B, III-C): landmarks that others made, and its own place where it
// does not know it. Coordinates are those of the map that the client publishes (VisualClient::take_updates): of the
// robot's base at the session's first keyframe.

#include <mapweave/maps/exchange.h>

#include <optional>

namespace mapweave::visual {

// Whose camera it is, and where on the robot: what others receive hangs on the robot.
struct ClientPlace {
  ClientId client;
  Pose3 robot_from_camera;
};

// Sessions are published as maps of their own, named after the client: "alpha.front", "alpha.front.1".
MapId map_of(const ClientId& client, int session);
std::optional<int> session_of(const ClientId& client, MapId map);  // nullopt for a map of others

enum class PlaceVerdict {
  taken,      // the client goes on from there
  not_asked,  // for no frame that is waited for: answered before, or too late
  placed,     // meanwhile the client knows where it is
  unsound,    // no pose, no landmarks, or no such session
  disagrees   // the frame does not show the landmarks there
};

// A session that began with a server's answer: its map's frame is the frame that `map` had then.
struct ReanchoredFrame {
  int session = 0;
  MapId map;
};

}  // namespace mapweave::visual
