#include <mapweave/runtime/metrics.h>

#include <sys/resource.h>
#include <unistd.h>
#include <ctime>
#include <fstream>

namespace mapweave::runtime {
namespace {

rusage usage_of(int who) {
  rusage usage{};
  ::getrusage(who, &usage);
  return usage;
}

}  // namespace

double process_cpu_seconds() {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

std::uint64_t rss_bytes() {
  std::ifstream file("/proc/self/statm");
  std::uint64_t all_pages = 0, resident_pages = 0;
  file >> all_pages >> resident_pages;
  return resident_pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

std::uint64_t peak_rss_bytes() {
  return 1024 *
         static_cast<std::uint64_t>(usage_of(RUSAGE_SELF).ru_maxrss + usage_of(RUSAGE_CHILDREN).ru_maxrss);  // kB each
}

}  // namespace mapweave::runtime
