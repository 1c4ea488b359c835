#pragma once
// What a keyframe's claim to be back at a place is held to, whether the place is in the own map or was shared by
// others.

#include <mapweave/core/view.h>

#include <cstddef>
#include <cstdint>

namespace mapweave::visual {

constexpr std::uint32_t kMemory = 10;  // keyframes for which a claim stands
constexpr std::size_t kJudged = 2;     // places that are judged, of those most alike: bounds time
constexpr double kTurnApart = 0.05;    // radians: claims that agree
constexpr double kScaleApart = 0.15;   // of logarithms of scale: claims that agree
// What a loop may correct, in radians and in logarithms of scale: a path turns more the longer it is.
constexpr double kTurn = 0.1, kTurnPerMetre = 0.01, kStretch = 1.0;

inline double angle_of(const View& view) { return Eigen::AngleAxisd(view.rotation).angle(); }

}  // namespace mapweave::visual
