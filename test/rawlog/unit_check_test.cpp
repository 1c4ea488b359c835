#include "logs.h"

#include <mapweave/rawlog/unit_check.h>
#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationStereoImages.h>

#include <cmath>

namespace mapweave::rawlog {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

std::vector<UnitDoubt> doubts_of(const std::vector<std::shared_ptr<mrpt::obs::CObservation>>& observations) {
  UnitCheck check;
  std::vector<UnitDoubt> doubts;
  for (const auto& observation : observations)
    for (const UnitDoubt& doubt : check.add({to_stamp(observation->timestamp), observation})) doubts.push_back(doubt);
  for (const UnitDoubt& doubt : check.finish()) doubts.push_back(doubt);
  return doubts;
}

// Of a room of about 2 to 6 m, `unit` to the metre.
std::vector<std::shared_ptr<mrpt::obs::CObservation>> room_scans(double unit) {
  std::vector<std::shared_ptr<mrpt::obs::CObservation>> scans;
  for (int i = 0; i < 30; ++i) {
    std::vector<float> ranges;
    for (int ray = 0; ray < 181; ++ray)
      ranges.push_back(static_cast<float>(unit * (4.0 + 2.0 * std::sin(0.05 * ray + 0.1 * i))));
    scans.push_back(scan(0.2 * i, ranges));
  }
  return scans;
}

// A drive of 0.5 m/s that turns by 0.4 rad/s, ten steps a second.
std::vector<std::shared_ptr<mrpt::obs::CObservation>> drive(double unit, double angle_unit) {
  std::vector<std::shared_ptr<mrpt::obs::CObservation>> steps;
  for (int i = 0; i < 60; ++i)
    steps.push_back(odometry(0.1 * i, 0.05 * i * unit, 0.0, wrap_angle(0.04 * i * angle_unit)));
  return steps;
}

std::vector<std::shared_ptr<mrpt::obs::CObservation>> depth_pictures(double steps_per_m, double near_m, double far_m) {
  std::vector<std::shared_ptr<mrpt::obs::CObservation>> pictures;
  for (int i = 0; i < 12; ++i) {
    auto picture = std::make_shared<mrpt::obs::CObservation3DRangeScan>();
    picture->timestamp = at(0.1 * i);
    picture->sensorLabel = "RGBD";
    picture->hasRangeImage = true;
    picture->rangeUnits = static_cast<float>(1.0 / steps_per_m);
    picture->rangeImage.resize(48, 64);
    for (int row = 0; row < 48; ++row)
      for (int column = 0; column < 64; ++column)
        picture->rangeImage(row, column) =
            static_cast<std::uint16_t>((near_m + (far_m - near_m) * column / 63.0) * steps_per_m);
    pictures.push_back(picture);
  }
  return pictures;
}

TEST(UnitCheck, metres_and_radians_are_not_doubted) {
  EXPECT_THAT(doubts_of(room_scans(1.0)), IsEmpty());
  EXPECT_THAT(doubts_of(room_scans(10.0)), IsEmpty());  // a large yard
  EXPECT_THAT(doubts_of(drive(1.0, 1.0)), IsEmpty());
  EXPECT_THAT(doubts_of(depth_pictures(5000.0, 0.7, 4.5)), IsEmpty());
  EXPECT_THAT(doubts_of(depth_pictures(1000.0, 0.5, 9.0)), IsEmpty());
}

TEST(UnitCheck, a_laser_in_millimetres_is_hopeless) {
  const auto doubts = doubts_of(room_scans(1000.0));
  ASSERT_THAT(doubts, SizeIs(1));
  EXPECT_THAT(doubts[0].what, HasSubstr("laser 'LASER'"));
  EXPECT_THAT(doubts[0].guess, HasSubstr("millimetres"));
  EXPECT_TRUE(doubts[0].nothing_is_left);
}

TEST(UnitCheck, a_laser_in_centimetres_is_reported) {
  const auto doubts = doubts_of(room_scans(100.0));
  ASSERT_THAT(doubts, SizeIs(1));
  EXPECT_THAT(doubts[0].guess, HasSubstr("centimetres"));
}

TEST(UnitCheck, one_large_number_for_no_return_is_no_distance) {
  std::vector<std::shared_ptr<mrpt::obs::CObservation>> scans;
  for (int i = 0; i < 30; ++i) scans.push_back(scan(0.2 * i, std::vector<float>(181, 8191.0f)));
  EXPECT_THAT(doubts_of(scans), IsEmpty());
}

TEST(UnitCheck, a_fan_of_180_radians_is_in_degrees) {
  auto wide = room_scans(1.0);
  for (const auto& one : wide) dynamic_cast<mrpt::obs::CObservation2DRangeScan&>(*one).aperture = 180.0f;
  const auto doubts = doubts_of(wide);
  ASSERT_THAT(doubts, SizeIs(1));
  EXPECT_THAT(doubts[0].guess, HasSubstr("degrees"));
  EXPECT_TRUE(doubts[0].nothing_is_left);
}

TEST(UnitCheck, ranges_of_some_millimetres_are_in_kilometres) {
  const auto doubts = doubts_of(room_scans(0.001));
  ASSERT_THAT(doubts, SizeIs(1));
  EXPECT_THAT(doubts[0].guess, HasSubstr("kilometres"));
  EXPECT_TRUE(doubts[0].nothing_is_left);
}

TEST(UnitCheck, odometry_in_millimetres_or_with_headings_in_degrees_is_reported) {
  auto doubts = doubts_of(drive(1000.0, 1.0));
  ASSERT_THAT(doubts, SizeIs(1));
  EXPECT_THAT(doubts[0].what, HasSubstr("500 m/s"));
  EXPECT_THAT(doubts[0].guess, HasSubstr("millimetres"));
  EXPECT_FALSE(doubts[0].nothing_is_left);
  doubts = doubts_of(drive(1.0, 180.0 / M_PI));
  ASSERT_THAT(doubts, SizeIs(1));
  EXPECT_THAT(doubts[0].guess, HasSubstr("degrees"));
}

TEST(UnitCheck, a_map_five_times_too_large_or_too_small_is_reported_by_its_depth) {
  // 0.7 to 4.5 m, written with 5000 steps to the metre and read with 1000.
  auto doubts = doubts_of(depth_pictures(1000.0, 3.5, 22.5));
  ASSERT_THAT(doubts, SizeIs(1));
  EXPECT_THAT(doubts[0].what, HasSubstr("1000 steps to the metre"));
  EXPECT_THAT(doubts[0].guess, HasSubstr("5000 (TUM RGB-D)"));
  // A desk, 0.8 to 1.5 m away: five times as far is still within the reach of a depth camera.
  doubts = doubts_of(depth_pictures(1000.0, 4.0, 7.5));
  ASSERT_THAT(doubts, SizeIs(1));
  EXPECT_THAT(doubts[0].what, HasSubstr("something nearer than 2.5 m"));
  EXPECT_THAT(doubts[0].guess, HasSubstr("5000 (TUM RGB-D)"));
  EXPECT_THAT(doubts_of(depth_pictures(5000.0, 2.8, 7.5)), SizeIs(0)) << "a hall";
  EXPECT_THAT(doubts_of(depth_pictures(5000.0, 0.8, 1.5)), SizeIs(0));
  doubts = doubts_of(depth_pictures(5000.0, 0.1, 0.7));
  ASSERT_THAT(doubts, SizeIs(1));
  EXPECT_THAT(doubts[0].guess, HasSubstr("1000 (millimetres)"));
}

TEST(UnitCheck, a_stereo_pair_120_m_apart_is_in_millimetres) {
  auto pair = std::make_shared<mrpt::obs::CObservationStereoImages>();
  pair->timestamp = at(1.0);
  pair->rightCameraPose = mrpt::poses::CPose3DQuat(mrpt::poses::CPose3D(120.0, 0.0, 0.0));
  const auto doubts = doubts_of({pair, pair});
  ASSERT_THAT(doubts, SizeIs(1));
  EXPECT_THAT(doubts[0].guess, HasSubstr("millimetres"));
}

}  // namespace
}  // namespace mapweave::rawlog
