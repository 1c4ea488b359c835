#pragma once
// The light in all buildings, by day or by night: what a camera's exposure makes of how much there is, and where it
// falls.

#include <mapweave/core/geometry.h>

namespace mapweave::simulation {

struct LightOptions {
  double level = 1.0;
  double lamps = 0.0;
  double lamp_spacing_m = 4.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("level", level, 0.01, 1.0,
             "how much light there is, of full daylight; in less, cameras expose up to three times as long, then "
             "amplify up to eight times, noise and all; what is left is dark");
    v.fraction("lamps", lamps,
               "share of the light that comes from lamps, bright beneath them and dark between; the rest falls "
               "everywhere alike; 0: day");
    v.number("lamp_spacing_m", lamp_spacing_m, 0.5, 50.0, "from one lamp to the next, along both walls");
  }

  // What cameras make of it: 1, 1 and 1 in full light.
  double exposure_factor() const;
  double amplification() const;
  double brightness() const;  // of pictures, where the light falls fully
  // Share of its light that falls on a point of the world: 1 - lamps to 1, the same at all heights.
  double share_at(const Eigen::Vector3d& point_in_world) const;
};

}  // namespace mapweave::simulation
