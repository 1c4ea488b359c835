#pragma once
// Clocks, for reports, progress and names of runs. Never part of a sealed result.

#include <chrono>
#include <cstdint>

namespace mapweave {

class Stopwatch {
 public:
  // Since it was made, or since the last lap.
  double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }
  double lap() {
    const double passed = seconds();
    start_ = Clock::now();
    return passed;
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

inline double seconds_since(std::chrono::steady_clock::time_point then) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - then).count();
}
inline std::chrono::steady_clock::time_point in_seconds(double seconds) {
  return std::chrono::steady_clock::now() +
         std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(seconds));
}

double thread_cpu_seconds();  // of the calling thread, since it began
std::int64_t now_ns();        // since 1970

}  // namespace mapweave
