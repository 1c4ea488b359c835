#pragma once
// What a run costs. Never part of a sealed result.

#include <chrono>
#include <cstdint>

namespace mapweave::runtime {

// Wall time since it was made.
class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

double thread_cpu_seconds();  // of the calling thread, since it began
// Largest resident size so far: of this process, and of the largest child process that has ended on top of it.
std::uint64_t peak_rss_bytes();

}  // namespace mapweave::runtime
