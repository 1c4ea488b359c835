#include "processors.h"

#include <gtest/gtest.h>
#include <mapweave/core/files.h>
#include <mapweave/core/worker_pool.h>
#include <sched.h>

#include <support/temporary_folder.h>
#include <thread>

namespace mapweave {
namespace {

namespace fs = std::filesystem;

std::optional<int> processors(const std::string& membership,
                              const std::vector<std::pair<std::string, std::string>>& files) {
  const test::TemporaryFolder folder;
  write_file(folder / "membership", membership);
  for (const auto& [name, text] : files) {
    fs::create_directories((folder / ("groups/" + name)).parent_path());
    write_file(folder / ("groups/" + name), text);
  }
  return processors_of_cgroup(folder / "membership", folder / "groups");
}

TEST(AvailableProcessors, are_those_of_the_cgroup_quota) {
  EXPECT_EQ(processors("0::/box\n", {{"box/cpu.max", "300000 100000\n"}}), 3);
  EXPECT_EQ(processors("0::/box\n", {{"box/cpu.max", "max 100000\n"}}), std::nullopt);
  EXPECT_EQ(processors("0::/box\n", {{"box/cpu.max", "50000 100000\n"}}), 1) << "less than one is still one";
  EXPECT_EQ(processors("0::/\n", {{"cpu.max", "200000 100000\n"}}), 2);
}

TEST(AvailableProcessors, heed_the_smallest_quota_of_all_groups_around) {
  EXPECT_EQ(processors("0::/a/b/c\n", {{"a/cpu.max", "200000 100000\n"},
                                       {"a/b/cpu.max", "max 100000\n"},
                                       {"a/b/c/cpu.max", "800000 100000\n"}}),
            2);
}

TEST(AvailableProcessors, know_the_older_form_of_cgroups) {
  const std::string membership = "5:memory:/other\n4:cpuacct,cpu:/box\n";
  EXPECT_EQ(
      processors(membership, {{"cpu/box/cpu.cfs_quota_us", "400000\n"}, {"cpu/box/cpu.cfs_period_us", "100000\n"}}), 4);
  EXPECT_EQ(processors(membership, {{"cpu/box/cpu.cfs_quota_us", "-1\n"}, {"cpu/box/cpu.cfs_period_us", "100000\n"}}),
            std::nullopt);
}

TEST(AvailableProcessors, do_not_stumble_over_nonsense) {
  EXPECT_EQ(processors("", {}), std::nullopt);
  EXPECT_EQ(processors("nonsense\n::\n0::/gone\n", {{"cpu.max", "many few"}}), std::nullopt);
  EXPECT_EQ(processors("0::/box\n", {{"box/cpu.max", "100000 0\n"}}), std::nullopt);
}

TEST(AvailableProcessors, heed_the_affinity_of_the_process) {
  EXPECT_GE(available_processors(), 1);
  cpu_set_t before, one;
  ASSERT_EQ(sched_getaffinity(0, sizeof before, &before), 0);
  CPU_ZERO(&one);
  for (int i = 0; i < CPU_SETSIZE && CPU_COUNT(&one) == 0; ++i) {
    if (CPU_ISSET(i, &before)) CPU_SET(i, &one);
  }
  if (sched_setaffinity(0, sizeof one, &one) != 0) GTEST_SKIP() << "may not change the affinity here";
  EXPECT_EQ(available_processors(), 1);
  sched_setaffinity(0, sizeof before, &before);
}

}  // namespace
}  // namespace mapweave
