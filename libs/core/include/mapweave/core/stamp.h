#pragma once
// Time comes from the data, never from a clock: the computations of mapweave see stamps only.

#include <cstdint>

namespace mapweave {

// Nanoseconds since the UNIX epoch.
struct Stamp {
  std::int64_t ns = 0;
  double seconds() const { return static_cast<double>(ns) * 1e-9; }
  friend bool operator==(Stamp a, Stamp b) { return a.ns == b.ns; }
  friend bool operator!=(Stamp a, Stamp b) { return a.ns != b.ns; }
  friend bool operator<(Stamp a, Stamp b) { return a.ns < b.ns; }
  friend bool operator<=(Stamp a, Stamp b) { return a.ns <= b.ns; }
};

inline double seconds_between(Stamp earlier, Stamp later) { return static_cast<double>(later.ns - earlier.ns) * 1e-9; }

// Rounds to the nearest nanosecond. Contract: finite and within +-9e9 s.
Stamp stamp_from_seconds(double seconds);

}  // namespace mapweave
