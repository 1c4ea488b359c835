#include <mapweave/core/options.h>
#include <mapweave/simulation/world.h>

#include <support/data.h>
#include <support/temporary_folder.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace mapweave::simulation {
namespace {

WorldOptions loaded(const std::string& yaml) {
  test::TemporaryFolder folder;
  std::ofstream(folder / "world.yaml") << yaml;
  WorldOptions options;
  load(options, {{folder / "world.yaml"}, {}, {}});
  return options;
}

std::string error_of(const std::string& yaml) {
  try {
    loaded(yaml);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    return error.what();
  }
  return "no error";
}

TEST(WorldOptions, are_read_from_a_world_file) {
  const WorldOptions options = loaded(
      "seed: 9\n"
      "buildings:\n"
      "  - {kind: ring, ring: {width_m: 30}}\n"
      "robots:\n"
      "  - {id: alpha, order: shuffled, waypoints: [{x_m: 1, y_m: 2}]}\n"
      "laser: {rays: 360}\n");
  EXPECT_EQ(options.seed, 9);
  ASSERT_EQ(options.buildings.size(), 1u);
  EXPECT_EQ(options.buildings[0].kind, PlanKind::ring);
  EXPECT_EQ(options.buildings[0].ring.width_m, 30.0);
  ASSERT_EQ(options.robots.size(), 1u);
  EXPECT_EQ(options.robots[0].order, TourOrder::shuffled);
  EXPECT_EQ(options.robots[0].waypoints.at(0).y_m, 2.0);
  EXPECT_EQ(options.laser.rays, 360);
}

TEST(WorldOptions, name_the_line_and_the_choices_of_an_unknown_kind_of_plan) {
  const std::string message = error_of("robots:\n  - {id: alpha}\nbuildings:\n  - kind: castle\n");
  EXPECT_THAT(message, testing::HasSubstr("world.yaml:4"));
  EXPECT_THAT(message, testing::HasSubstr("castle"));
  EXPECT_THAT(message, testing::HasSubstr("apartment"));
}

TEST(WorldOptions, refuse_unknown_keys_and_values_out_of_range) {
  EXPECT_THAT(error_of("robot:\n  - {id: alpha}\n"), testing::HasSubstr("robots"));
  EXPECT_THAT(error_of("laser: {rays: 1}\n"), testing::HasSubstr("rays"));
  EXPECT_THAT(error_of("laser: {max_range_m: .nan}\n"), testing::HasSubstr("max_range_m"));
}

TEST(WorldOptions, are_checked_when_set_in_code_too) {
  WorldOptions options;
  options.robots.resize(1);
  options.robots[0].id = "alpha";
  options.laser.rays = 1;
  WorkerPool here(1);
  EXPECT_THROW(World(options, here), Error);
}

TEST(WorldFiles, of_ours_all_build) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(test::own_data("../../configs/worlds"))) {
    SCOPED_TRACE(entry.path().filename().string());
    WorldOptions options;
    load(options, {{entry.path()}, {}, {}});
    WorkerPool here(1);
    const World world(options, here);
    EXPECT_GT(world.scan_count(0), 100u);
    ++files;
  }
  EXPECT_GE(files, 6);
}

}  // namespace
}  // namespace mapweave::simulation
