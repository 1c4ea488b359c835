#include "box_room.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/laser/odometry_check.h>

#include <functional>

namespace mapweave::laser {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// What is reported of a drive whose odometry is written down by `written`.
std::vector<std::string> guesses(const std::function<Pose2(const Pose2&)>& written) {
  OdometryCheck check;
  std::vector<std::string> reported;
  for (const LaserInput& input : test::drive_around(250, true).inputs) {
    if (const auto* odometry = std::get_if<OdometryInput>(&input))
      check.add_odometry(written(planar(odometry->odometry_from_robot)));
    if (const auto* scan = std::get_if<ScanInput>(&input))
      if (const auto doubt = check.add_scan(scan->stamp, scan->scan)) reported.push_back(doubt->guess);
  }
  return reported;
}

TEST(OdometryCheck, odometry_that_moves_as_the_scans_do_is_not_doubted) {
  EXPECT_THAT(guesses([](const Pose2& pose) { return pose; }), IsEmpty());
  // Bad wheels are none of another unit.
  EXPECT_THAT(guesses([](const Pose2& pose) { return Pose2{1.3 * pose.x, 1.3 * pose.y, pose.phi}; }), IsEmpty());
  EXPECT_THAT(guesses([](const Pose2&) { return Pose2{}; }), IsEmpty());
}

TEST(OdometryCheck, odometry_in_other_units_than_the_laser_is_reported_with_the_unit) {
  const auto scaled = [](double unit) {
    return [unit](const Pose2& pose) { return Pose2{unit * pose.x, unit * pose.y, pose.phi}; };
  };
  for (const auto& [unit, name] : {std::pair(3.2808, "feet"), {100.0, "centimetres"}, {1000.0, "millimetres"}}) {
    const auto reported = guesses(scaled(unit));
    ASSERT_THAT(reported, SizeIs(1)) << name;
    EXPECT_THAT(reported[0], HasSubstr(std::string("odometry in ") + name));
  }
}

TEST(OdometryCheck, headings_in_degrees_are_reported) {
  const auto reported = guesses([](const Pose2& pose) {
    return Pose2{pose.x, pose.y, wrap_angle(pose.phi * 180.0 / M_PI)};
  });
  ASSERT_THAT(reported, SizeIs(1));
  EXPECT_THAT(reported[0], HasSubstr("degrees"));
}

}  // namespace
}  // namespace mapweave::laser
