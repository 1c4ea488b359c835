#pragma once
// What a simulated camera sees, as its client is handed it.

#include <mapweave/simulation/feature_sensor.h>
#include <mapweave/visual/frame.h>

namespace mapweave::test {

inline visual::FeatureFrame frame_of(const simulation::SimulatedFeatureFrame& seen, bool with_depth = true) {
  visual::FeatureFrame frame;
  frame.stamp = seen.stamp;
  for (const simulation::Feature& feature : seen.features) {
    frame.features.points.push_back({feature.u, feature.v, 0.0F, static_cast<std::uint8_t>(feature.octave)});
    frame.features.descriptors.push_back(feature.descriptor);
    frame.inverse_depths.push_back(with_depth && feature.depth_m > 0.0F ? 1.0F / feature.depth_m : 0.0F);
  }
  return frame;
}

}  // namespace mapweave::test
