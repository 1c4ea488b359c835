#pragma once
// What the cloud asks of an edge before it merges everything: to compare maps. Byte form: as exchange.h.

#include <mapweave/core/geometry.h>
#include <mapweave/core/ids.h>

#include <string>
#include <string_view>
#include <vector>

namespace mapweave {

// Two submaps to be laid on each other, and where to search.
struct SubmapsToJudge {
  SubmapId a, b;
  Pose2 a_from_b;           // middle of the window
  double radius_m = 0.0;    // of the centre of b's walls around where the middle puts it
  double yaw_rad = 0.0;     // either way
  bool known_part = false;  // only walls of b that a looked at, as the middle has it
};

struct PairToJudge {
  MapId a, b;
  std::vector<SubmapsToJudge> submaps;
  bool have_cameras = false;  // all keyframes of both are compared as well
};

std::string encode(const std::vector<PairToJudge>&);
std::vector<PairToJudge> decode_pairs_to_judge(std::string_view bytes, const std::string& where);

}  // namespace mapweave
