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
             "light as a share of full daylight; in less light cameras expose up to three times as long, then amplify "
             "picture and noise up to eight times, and what is still missing makes pictures dark; larger values are "
             "brighter");
    v.fraction("lamps", lamps,
               "share of the light that comes from lamps, bright beneath them and dark between; the rest falls "
               "everywhere alike; larger values are more uneven; 0: day");
    v.number(
        "lamp_spacing_m", lamp_spacing_m, 0.5, 50.0,
        "distance in metres from one lamp to the next, along x and along y; larger values make larger dark places");
  }

  // What cameras make of it: 1, 1 and 1 in full light.
  double exposure_factor() const;
  double amplification() const;
  double brightness() const;  // of pictures, where the light falls fully
  // Share of its light that falls on a point of the world: 1 - lamps to 1, the same at all heights.
  double share_at(const Eigen::Vector3d& point_in_world) const;
};

}  // namespace mapweave::simulation
