#pragma once
// When two proposals are one.

#include <cmath>

namespace mapweave::matching {

// Nearer proposals refine to the same alignment.
constexpr double kApart_m = 2.5, kApart_rad = 8.0 * M_PI / 180.0;

}  // namespace mapweave::matching
