#include "small_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/evaluation/tum_trajectory.h>
#include <mapweave/exporters/map_folder.h>
#include <mapweave/exporters/map_server.h>
#include <support/temporary_folder.h>

namespace mapweave::exporters {
namespace {

using test::add_pose;
using test::node_id;
using ::testing::ElementsAre;

Map two_robots() {
  Map map;
  add_pose(map, node_id("alpha", 0), 1000000000, spatial(Pose2(0.1, 0.1, 0.0)), test::cross_scan({0.1, 0.1, 0.1, 0.1}));
  add_pose(map, node_id("alpha", 1), 2000000000, spatial(Pose2(0.2, 0.1, 0.0)));
  add_pose(map, node_id("beta", 0), 1500000000, spatial(Pose2(0.1, 0.2, 0.0)));
  return map;
}

const OccupancyGrid kRoom = test::drawn_grid({"######", "#....#", "#....#", "######"});

std::vector<std::string> files_in(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) names.push_back(entry.path().lexically_relative(folder).string());
  std::sort(names.begin(), names.end());
  return names;
}

TEST(MapFolder, holds_what_slam_and_merge_promise) {
  const test::TemporaryFolder folder;
  MapFolderOptions options;
  options.files.robot_trajectories = options.files.g2o = true;
  const auto written = write_map_folder(folder / "team", two_robots(), kRoom, options);
  EXPECT_THAT(written, ElementsAre("map.png", "map.color.png", "map.pgm", "map.yaml", "map.pcd",
                                   "trajectories/alpha.tum", "trajectories/beta.tum", "map.g2o"));
  EXPECT_THAT(files_in(folder / "team"),
              testing::UnorderedElementsAre("map.png", "map.color.png", "map.pgm", "map.yaml", "map.pcd",
                                            "trajectories/alpha.tum", "trajectories/beta.tum", "map.g2o"));
  EXPECT_EQ(evaluation::read_tum(folder / "team/trajectories/alpha.tum").size(), 2u);
  EXPECT_EQ(evaluation::read_tum(folder / "team/trajectories/beta.tum").size(), 1u);
  EXPECT_EQ(test::letters_of(read_map_server(folder / "team/map.yaml")), test::letters_of(kRoom));
}

TEST(MapFolder, of_one_robot_has_its_trajectory_at_the_top) {
  const test::TemporaryFolder folder;
  Map map;
  add_pose(map, node_id("alpha", 0), 1000000000, {});
  EXPECT_THAT(write_map_folder(folder / "robot", map, {}), ElementsAre("map.pcd", "trajectory.tum"));
  MapFolderOptions options;
  options.files.robot_trajectories = true;
  EXPECT_THAT(write_map_folder(folder / "team", map, {}, options),
              ElementsAre("map.pcd", "trajectory.tum", "trajectories/alpha.tum"));
}

TEST(MapFolder, holds_only_what_was_asked_for) {
  const test::TemporaryFolder folder;
  MapFolderOptions options;
  options.files = {false, true, false, false, false, false};
  write_map_folder(folder.path(), two_robots(), kRoom, options);
  EXPECT_THAT(files_in(folder.path()), ElementsAre("map.pgm", "map.yaml"));
}

TEST(MapFolder, of_a_map_that_saw_nothing_has_no_pictures) {
  const test::TemporaryFolder folder;
  const auto written = write_map_folder(folder.path(), two_robots(), OccupancyGrid{});
  EXPECT_THAT(written, ElementsAre("map.pcd", "trajectories/alpha.tum", "trajectories/beta.tum"));
}

TEST(MapFolder, has_the_same_bytes_each_time) {
  const test::TemporaryFolder folder;
  MapFolderOptions options;
  options.files.robot_trajectories = options.files.g2o = true;
  options.picture.title = "two robots";
  const auto names = write_map_folder(folder / "first", two_robots(), kRoom, options);
  write_map_folder(folder / "second", two_robots(), kRoom, options);
  for (const auto& name : names)
    EXPECT_EQ(read_file(folder / "first" / name), read_file(folder / "second" / name)) << name;
}

TEST(MapFolder, says_when_it_cannot_be_made) {
  const test::TemporaryFolder folder;
  write_file(folder / "file", "in the way");
  try {
    write_map_folder(folder / "file/below", two_robots(), kRoom);
    FAIL() << "wrote below a file";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCannotWrite);
    EXPECT_THAT(error.what(), testing::HasSubstr("file/below"));
  }
}

}  // namespace
}  // namespace mapweave::exporters
