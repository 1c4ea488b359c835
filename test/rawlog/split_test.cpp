#include "logs.h"

#include <mapweave/rawlog/split.h>
#include <mrpt/obs/CObservationImage.h>
#include <support/pose_matchers.h>

namespace mapweave::rawlog {
namespace {

using test::IsNear;
using test::TemporaryFolder;
using ::testing::HasSubstr;

// Ten seconds, a scan and an odometry each.
std::filesystem::path ten_seconds(const TemporaryFolder& folder) {
  std::vector<Object> objects;
  for (int i = 0; i <= 10; ++i) {
    objects.push_back(odometry(100 + i, 2.0 * i, 1.0, 0.1 * i));
    objects.push_back(scan(100 + i));
  }
  return write_rawlog(folder / "whole.rawlog", objects);
}

std::vector<SplitPart> split(const std::filesystem::path& log, const std::filesystem::path& out,
                             const SplitOptions& options) {
  return split_log(log, out, options, *make_silent_progress());
}

TEST(Split, cuts_by_time_and_keeps_every_record_once) {
  const TemporaryFolder folder;
  const auto log = ten_seconds(folder);
  const auto parts = split(log, folder / "out", {});
  ASSERT_EQ(parts.size(), 2u);
  EXPECT_EQ(parts[0].path.filename(), "robot0.rawlog");
  const auto whole = read_all(log), first = read_all(parts[0].path), second = read_all(parts[1].path);
  EXPECT_EQ(first.records.size() + second.records.size(), whole.records.size());
  EXPECT_EQ(parts[0].last.seconds(), 104.0);
  EXPECT_EQ(parts[1].first.seconds(), 105.0);
  EXPECT_EQ(parts[1].scans, 6u);
  EXPECT_EQ(parts[1].odometry, 6u);
  EXPECT_EQ(serialized(*second.records[1].observation), serialized(*whole.records[11].observation));
}

TEST(Split, restarts_each_robots_odometry_at_the_origin) {
  const TemporaryFolder folder;
  const auto log = ten_seconds(folder);
  const auto parts = split(log, folder / "out", {});
  const auto whole = read_all(log), second = read_all(parts[1].path);
  EXPECT_THAT(odometry_of(second.records[0]), IsNear(Pose2(0, 0, 0), 1e-12, 1e-12));
  for (std::size_t i = 0; i < second.records.size(); i += 2) {
    EXPECT_THAT(odometry_of(second.records[i]),
                IsNear(between(odometry_of(whole.records[10]), odometry_of(whole.records[10 + i])), 1e-9, 1e-9));
  }
}

TEST(Split, grows_each_part_by_the_overlap_on_either_side) {
  const TemporaryFolder folder;
  SplitOptions options;
  options.robots = 3;
  options.at_s = {103.0, 106.0};
  options.overlap_s = 1.5;
  const auto parts = split(ten_seconds(folder), folder / "out", options);
  ASSERT_EQ(parts.size(), 3u);
  EXPECT_EQ(parts[0].first.seconds(), 100.0);
  EXPECT_EQ(parts[0].last.seconds(), 104.0);
  EXPECT_EQ(parts[1].first.seconds(), 102.0);
  EXPECT_EQ(parts[1].last.seconds(), 107.0);
  EXPECT_EQ(parts[2].first.seconds(), 105.0);
  EXPECT_EQ(parts[2].last.seconds(), 110.0);
}

TEST(Split, keeps_cameras_and_where_their_pictures_are) {
  const TemporaryFolder folder;
  auto picture = std::make_shared<mrpt::obs::CObservationImage>();
  picture->timestamp = at(1.0);
  picture->image.setExternalStorage("left.png");
  std::filesystem::create_directory(folder / "walk_Images");
  SplitOptions options;
  options.robots = 1;
  const auto parts = split(write_rawlog(folder / "walk.rawlog", {picture, scan(2.0)}), folder / "elsewhere", options);
  const auto reading = read_all(parts[0].path);
  ASSERT_EQ(reading.records.size(), 2u);
  EXPECT_EQ(
      dynamic_cast<const mrpt::obs::CObservationImage&>(*reading.records[0].observation).image.getExternalStorageFile(),
      (folder / "walk_Images/left.png").string());
}

TEST(Split, refuses_cuts_that_do_not_fit) {
  const TemporaryFolder folder;
  const auto log = ten_seconds(folder);
  const auto problem = [&](int robots, std::vector<double> at_s, double overlap_s = 0.0) {
    SplitOptions options;
    options.robots = robots;
    options.at_s = std::move(at_s);
    options.overlap_s = overlap_s;
    try {
      split(log, folder / "out", options);
    } catch (const Error& error) {
      return std::make_unique<Error>(error);
    }
    return std::unique_ptr<Error>();
  };
  EXPECT_THAT(problem(3, {104.0}), IsError(ErrorCode::kUsage, "1 cuts make 2 parts, not 3"));
  EXPECT_THAT(problem(3, {106.0, 104.0}), IsError(ErrorCode::kUsage, "rising"));
  EXPECT_THAT(problem(2, {std::nan("")}), IsError(ErrorCode::kUsage, "no time"));
  EXPECT_THAT(problem(0, {}), IsError(ErrorCode::kUsage, "robots"));
  EXPECT_THAT(problem(2, {}, -1.0), IsError(ErrorCode::kUsage, "overlap"));
  EXPECT_THAT(problem(2, {4.0}), IsError(ErrorCode::kBadInput, "100.000 to 110.000"));
  EXPECT_THAT(problem(2, {111.0}), IsError(ErrorCode::kBadInput, "outside"));
  EXPECT_THAT(problem(3, {104.2, 104.8}), IsError(ErrorCode::kBadInput, "robot1.rawlog"));
  for (const auto& entry : std::filesystem::directory_iterator(folder / "out"))
    ADD_FAILURE() << entry.path() << " was left behind";
}

TEST(Split, leaves_nothing_of_a_damaged_log) {
  const TemporaryFolder folder;
  const std::string bytes = bytes_of(ten_seconds(folder));
  SplitOptions options;
  options.at_s = {103.0};
  EXPECT_THROW(split(write_bytes(folder / "cut.rawlog", bytes.substr(0, bytes.size() - 4)), folder / "out", options),
               Error);
  EXPECT_TRUE(std::filesystem::is_empty(folder / "out"));
}

}  // namespace
}  // namespace mapweave::rawlog
