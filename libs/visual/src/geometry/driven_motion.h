#pragma once
// How a camera came from one place to another, whatever the two look like: rooms may be alike to the last picture on
// the wall, and then only the motion between them distinguishes them.

#include <mapweave/core/stamp.h>
#include <mapweave/core/view.h>
#include <mapweave/visual/client_options.h>

#include <limits>
#include <optional>

namespace mapweave::visual {

// To the next place that looks the same: there is none.
inline constexpr double kUnique_m = std::numeric_limits<double>::infinity();

// Up to a frame, since the first one.
struct DrivenMotion {
  std::optional<Pose3> odometry_from_camera;
  double metres = 0.0, radians = 0.0;  // driven by odometry
  // Places that look as the camera does now were refused so near, at least, since it was lost. Odometry drifts, but not
  // towards them.
  double refused_m = std::numeric_limits<double>::infinity();
};
// To the next frame.
void go_on(DrivenMotion& driven, const std::optional<Pose3>& odometry_from_camera);

// A camera in a map.
struct Station {
  Stamp stamp;
  DrivenMotion driven;
  View view;
};

// How far `to` is from where a camera would be expected that was at `from`, in the same map, and how far it may be: by
// odometry where both know it (infinitely far where it says that the camera looks elsewhere), else by the time that has
// passed. Each may be the earlier one.
struct Departure {
  double error_m = 0.0, reach_m = 0.0;
  double repeats_m = kUnique_m;  // of the same look, which must be reckoned with
};
Departure departure(const Station& from, const Station& to, const SessionOptions& options);

enum class Allowed {
  no,
  unclear,  // it may be here, or in another place that looks the same
  yes
};
// Where the same look is known to come again `repeats_m` away.
Allowed allowed(const Departure& departure, double repeats_m);

}  // namespace mapweave::visual
