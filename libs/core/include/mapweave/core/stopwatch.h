#pragma once
// Wall time, for reports and progress. Never part of a sealed result.

#include <chrono>

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

}  // namespace mapweave
