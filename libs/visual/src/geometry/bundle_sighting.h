#pragma once
// What the map's own camera saw, as bundle adjustment has it. The slack of a point's distance is left out: the point
// moves.

#include "pose_from_points.h"

#include <mapweave/graph/bundle_adjustment.h>

namespace mapweave::visual {

inline graph::BundleSighting bundle_sighting(int view, std::size_t point, const Sighting& seen) {
  return {static_cast<std::uint32_t>(view),
          static_cast<std::uint32_t>(point),
          seen.pixel,
          seen.row_flow,
          seen.sigma_px,
          seen.inverse_depth,
          seen.inverse_depth_sigma,
          true};
}

// A window or a session of one camera: few steps, and depth alone makes no sighting wrong.
inline graph::BundleOptions bundle_options(int iterations) {
  graph::BundleOptions options;
  options.iterations = iterations;
  options.least_gain = 1e-4;
  options.gate_sigmas = 4.0;
  options.gates_inverse_depth = false;
  return options;
}

}  // namespace mapweave::visual
