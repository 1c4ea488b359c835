#pragma once
// A point of the world that keyframes see. It hangs on one of them, its anchor, and moves with it: whoever corrects
// poses need not touch landmarks.

#include <mapweave/core/ids.h>
#include <mapweave/maps/keyframe.h>

#include <optional>
#include <string>
#include <vector>

namespace mapweave {

struct LandmarkId {
  SessionId session;        // whose client made it
  std::uint32_t index = 0;  // counts from 0 within the session
};
inline auto key_of(const LandmarkId& id) {
  return std::tie(id.session.client.robot, id.session.client.sensor, id.session.run, id.index);
}
std::string to_string(const LandmarkId&);  // ".../landmark 12"

// Where a keyframe saw it: packed as KeyframePoint is. It need not be one of the keyframe's features: it is where the
// landmark was found, to a fraction of a pixel, freed of what is known of the sensor's systematic errors (the readout
// of its rows).
struct LandmarkSighting {
  NodeId node;
  std::uint16_t u = 0, v = 0;
  std::uint16_t inverse_depth = 0;  // 0: unknown
  std::uint8_t level = 0;           // in a pyramid of halves: its deviation is 2^level times that of level 0
};

struct Landmark {
  LandmarkId id;
  NodeId anchor;  // a keyframe of the landmark's own session
  Eigen::Vector3i point_units =
      Eigen::Vector3i::Zero();           // in the anchor's frame (robot base): kLandmarkUnit_m each, here as on a wire
  std::array<std::uint8_t, 3> colour{};  // red, green, blue; alike where the camera has no colour
  std::vector<LandmarkSighting> seen;    // ascending by node, each node once

  Eigen::Vector3d point_in_anchor() const;  // metres
};

// A tenth of a millimetre: a fifth of a pixel of a common camera at 0.25 m. Reaches 200 km.
inline constexpr double kLandmarkUnit_m = 1e-4;
inline Eigen::Vector3i landmark_units(
    const Eigen::Vector3d& point_in_anchor) {  // finite; what lies beyond the reach goes to its border
  Eigen::Vector3i units;
  for (int axis = 0; axis < 3; ++axis)
    units(axis) = static_cast<std::int32_t>(
        std::lround(std::clamp(point_in_anchor(axis) / kLandmarkUnit_m, -2147483647.0, 2147483647.0)));
  return units;
}
inline Eigen::Vector3d Landmark::point_in_anchor() const { return point_units.cast<double>() * kLandmarkUnit_m; }

// What changes of a known landmark while its client goes on.
struct LandmarkChange {
  LandmarkId id;
  std::optional<Eigen::Vector3i> point_units;  // nothing: as before
  std::vector<LandmarkSighting> seen;          // new, or new for their node; ascending by node
};

}  // namespace mapweave
