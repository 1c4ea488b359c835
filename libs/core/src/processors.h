#pragma once
#include <filesystem>
#include <optional>

namespace mapweave {

// Processors that the cgroup CPU quota leaves to a process: the smallest of its own group and those above it; nullopt
// without a quota. membership: /proc/self/cgroup; root: /sys/fs/cgroup. Versions 1 and 2.
std::optional<int> processors_of_cgroup(const std::filesystem::path& membership, const std::filesystem::path& root);

}  // namespace mapweave
