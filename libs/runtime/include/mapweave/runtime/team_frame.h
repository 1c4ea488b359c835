#pragma once
// Which frame merged maps have (team.frame, merge --frame), and which they got.

#include <mapweave/core/error.h>
#include <mapweave/core/geometry.h>
#include <mapweave/core/ids.h>
#include <mapweave/maps/map_identity.h>

#include <string>
#include <vector>

namespace mapweave::runtime {

struct FrameRequest {
  enum class Kind {
    first,  // frame of the first map given
    named,  // frame of the map `name`
    walls,  // the first map's, turned so that its axes run along the walls
    given   // the first map's, moved
  };
  Kind kind = Kind::first;
  std::string name = {};
  Pose2 team_from_first = Pose2(0.0, 0.0, 0.0);  // where `given`: pose of the first map's frame in the team's
};

// Where a request stands, and what it is when it is wrong.
struct RequestPlace {
  ErrorCode code = ErrorCode::kUsage;
  std::string where;
};

// "" (first), "walls", "x,y,yaw" in metres and radians, or one of the names: a map that is called walls is that map.
// Throws Error(place.code) for anything else.
FrameRequest parse_frame(const std::string& text, const std::vector<std::string>& names, const RequestPlace& place);

// The frame that one team's map has.
struct TeamFrame {
  std::string of;  // the given map whose frame it is, or from whose frame it was moved
  FrameRequest::Kind kind = FrameRequest::Kind::first;
  bool has_no_walls = false;                     // walls were asked for, but no direction stood out
  Pose2 team_from_given = Pose2(0.0, 0.0, 0.0);  // pose of that map's frame in the team's
  double moved_m = 0.0, most_moved_m = 0.0;      // change of that map's places: root mean square, largest
  MapId by;                                      // the robot's own map whose first place is kept
  MapIdentity continued = {};                    // the given map's identity where the team's map is its next version
};
// "the frame is that of yesterday", "... of alpha, turned by -12.40 degrees: axes along the walls".
std::string in_words(const TeamFrame&);

}  // namespace mapweave::runtime
