#pragma once
// What a run costs. Never part of a sealed result.

#include <mapweave/core/stopwatch.h>

#include <cstdint>

namespace mapweave::runtime {

using mapweave::thread_cpu_seconds;
double process_cpu_seconds();  // of all threads of this process, without child processes
std::uint64_t rss_bytes();     // resident size of this process; 0 where the system does not say
// Largest resident size so far: of this process, and of the largest child process that has ended on top of it.
std::uint64_t peak_rss_bytes();

}  // namespace mapweave::runtime
