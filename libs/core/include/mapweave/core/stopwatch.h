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

double thread_cpu_seconds();  // of the calling thread, since it began
std::int64_t now_ns();        // since 1970

}  // namespace mapweave
