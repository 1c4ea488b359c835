#include "processors.h"

#include <mapweave/core/worker_pool.h>
#include <sched.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <thread>

namespace mapweave {
namespace {

// Version 2: "<quota or max> <period>" in one file. Version 1: a file for each, quota -1 for none.
std::optional<int> quota_of_group(const std::filesystem::path& group) {
  double quota = 0.0, period = 0.0;
  if (std::ifstream both(group / "cpu.max"); both) {
    both >> quota >> period;  // "max" is no number: quota stays 0
  } else {
    std::ifstream(group / "cpu.cfs_quota_us") >> quota;
    std::ifstream(group / "cpu.cfs_period_us") >> period;
  }
  if (!(quota > 0.0 && period > 0.0)) return std::nullopt;
  return static_cast<int>(std::clamp(quota / period, 1.0, 1e6));
}

}  // namespace

std::optional<int> processors_of_cgroup(const std::filesystem::path& membership, const std::filesystem::path& root) {
  std::optional<int> fewest;
  std::ifstream file(membership);
  for (std::string line; std::getline(file, line);) {  // hierarchy-number:controllers:/path
    const auto first = line.find(':');
    const auto second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    if (controllers != ",," && controllers.find(",cpu,") == std::string::npos) continue;
    const auto hierarchy = controllers == ",," ? root : root / "cpu";
    const auto path = std::filesystem::path(line.substr(second + 1)).relative_path();
    for (auto group = path;; group = group.parent_path()) {
      const auto quota = quota_of_group(hierarchy / group);
      if (quota) fewest = std::min(fewest.value_or(*quota), *quota);
      if (group.empty()) break;
    }
  }
  return fewest;
}

int available_processors() {
  int count = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof set, &set) == 0) count = std::max(1, CPU_COUNT(&set));
  const auto quota = processors_of_cgroup("/proc/self/cgroup", "/sys/fs/cgroup");
  return quota ? std::min(count, *quota) : count;
}

}  // namespace mapweave
