#include <gtest/gtest.h>
#include <mapweave/laser/scan_input.h>
#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationOdometry.h>

#include <cmath>
#include <limits>

namespace mapweave::laser {
namespace {

using mrpt::obs::CObservation2DRangeScan;

CObservation2DRangeScan::Ptr make_scan(std::size_t rays = 7, const std::string& label = "front") {
  auto scan = CObservation2DRangeScan::Create();
  scan->sensorLabel = label;
  scan->aperture = static_cast<float>(M_PI);
  scan->maxRange = 30.0f;
  scan->resizeScanAndAssign(rays, 0.0f, false);
  for (std::size_t i = 0; i < rays; ++i) {
    scan->setScanRange(i, 1.0f + 0.5f * static_cast<float>(i));
    scan->setScanRangeValidity(i, true);
  }
  return scan;
}

rawlog::Record record(mrpt::obs::CObservation::Ptr observation, std::int64_t ns = 1000) {
  return {Stamp{ns}, std::move(observation)};
}

PackedScan packed(ScanPacker& pack, const CObservation2DRangeScan::Ptr& scan) {
  const auto input = pack(record(scan));
  if (!input) throw std::runtime_error("nothing was packed");
  return std::get<ScanInput>(*input).scan;
}

// Where MRPT itself puts the ends of the rays, against ours.
void expect_points_as_mrpt_sees_them(const CObservation2DRangeScan::Ptr& scan) {
  ScanPacker pack;
  const auto points = points_in_robot(packed(pack, scan));
  mrpt::maps::CSimplePointsMap map;
  map.insertionOptions.minDistBetweenLaserPoints = 0.0f;
  map.insertionOptions.isPlanarMap = false;
  map.insertObservation(*scan);
  ASSERT_EQ(points.size(), map.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    float x, y, z;
    map.getPoint(i, x, y, z);
    EXPECT_NEAR(points[i].x, x, 0.001) << "ray " << i;
    EXPECT_NEAR(points[i].y, y, 0.001) << "ray " << i;
  }
}

TEST(ScanPacker, puts_every_ray_where_mrpt_puts_it) {
  const auto scan = make_scan(181);
  scan->sensorPose = mrpt::poses::CPose3D(0.3, -0.2, 0.5, 0.7, 0.0, 0.0);
  scan->maxRange = 200.0f;
  expect_points_as_mrpt_sees_them(scan);
}

TEST(ScanPacker, follows_a_laser_that_sweeps_clockwise) {
  const auto scan = make_scan(90);
  scan->rightToLeft = false;
  scan->sensorPose = mrpt::poses::CPose3D(0.1, 0.0, 0.2, -0.3, 0.0, 0.0);
  scan->maxRange = 200.0f;
  expect_points_as_mrpt_sees_them(scan);
}

TEST(ScanPacker, follows_lasers_that_hang_upside_down_or_tilt) {
  const auto scan = make_scan(60);
  scan->maxRange = 200.0f;
  scan->sensorPose = mrpt::poses::CPose3D(0.1, 0.0, 0.2, 0.4, 0.0, M_PI);
  expect_points_as_mrpt_sees_them(scan);
  scan->sensorPose = mrpt::poses::CPose3D(0.1, 0.0, 0.2, 0.4, 0.3, 0.1);
  expect_points_as_mrpt_sees_them(scan);
}

TEST(ScanPacker, turns_what_is_no_reading_into_no_return) {
  const auto scan = make_scan(9);
  scan->setScanRange(0, std::numeric_limits<float>::quiet_NaN());
  scan->setScanRange(1, std::numeric_limits<float>::infinity());
  scan->setScanRange(2, -1.0f);
  scan->setScanRange(3, 0.0f);
  scan->setScanRange(4, 30.0f);  // the maximum
  scan->setScanRange(5, 0.01f);  // nearer than min_range_m
  scan->setScanRangeValidity(6, false);
  scan->setScanRange(7, 29.9994f);
  ScanPacker pack;
  const auto ranges = packed(pack, scan).ranges;
  EXPECT_EQ(ranges, (std::vector<std::uint16_t>{0, 0, 0, 0, 0, 0, 0, 29999, 5000}));
}

TEST(ScanPacker, chooses_a_unit_that_the_maximum_fits_in) {
  for (const auto& [max_range_m, unit_m] : std::vector<std::pair<float, double>>{
           {30.0f, 0.001}, {65.0f, 0.001}, {81.0f, 0.002}, {131.0f, 0.002}, {132.0f, 0.003}}) {
    const auto scan = make_scan();
    scan->maxRange = max_range_m;
    scan->setScanRange(3, max_range_m - 0.5f);
    ScanPacker pack;
    const PackedScan result = packed(pack, scan);
    EXPECT_DOUBLE_EQ(result.geometry->range_unit_m, unit_m);
    EXPECT_NEAR(result.ranges[3] * unit_m, max_range_m - 0.5, unit_m);
  }
}

TEST(ScanPacker, shares_the_geometry_while_it_stays_the_same) {
  ScanPacker pack;
  const auto first = packed(pack, make_scan()), second = packed(pack, make_scan());
  EXPECT_EQ(first.geometry, second.geometry);
  const auto other = packed(pack, make_scan(8));
  EXPECT_NE(first.geometry, other.geometry);
  EXPECT_EQ(other.ranges.size(), 8u);
}

TEST(ScanPacker, keeps_to_the_first_laser_and_counts_the_others) {
  ScanPacker pack;
  EXPECT_TRUE(pack(record(make_scan(7, "front"))));
  EXPECT_FALSE(pack(record(make_scan(7, "rear"))));
  EXPECT_FALSE(pack(record(make_scan(7, "rear"))));
  EXPECT_TRUE(pack(record(make_scan(7, "front"))));
  EXPECT_EQ(pack.label(), "front");
  EXPECT_EQ(pack.ignored_lasers(), (std::map<std::string, std::uint64_t>{{"rear", 2}}));
}

TEST(ScanPacker, uses_the_laser_that_was_asked_for) {
  ScanInputOptions options;
  options.label = "rear";
  ScanPacker pack(options);
  EXPECT_FALSE(pack(record(make_scan(7, "front"))));
  EXPECT_FALSE(pack.found_laser());
  EXPECT_TRUE(pack(record(make_scan(7, "rear"))));
  EXPECT_TRUE(pack.found_laser());
}

TEST(ScanPacker, narrows_the_maximum_on_request) {
  ScanInputOptions options;
  options.max_range_m = 2.0;
  ScanPacker pack(options);
  const auto scan = packed(pack, make_scan(4));  // 1, 1.5, 2, 2.5 m
  EXPECT_EQ(scan.ranges, (std::vector<std::uint16_t>{1000, 1500, 0, 0}));
  EXPECT_DOUBLE_EQ(scan.geometry->max_range_m, 2.0);
}

TEST(ScanPacker, leaves_out_scans_that_make_no_sense) {
  ScanPacker pack;
  EXPECT_FALSE(pack(record(CObservation2DRangeScan::Create())));
  EXPECT_FALSE(pack(record(make_scan(1))));
  const auto without_aperture = make_scan();
  without_aperture->aperture = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(pack(record(without_aperture)));
  const auto nowhere = make_scan();
  nowhere->sensorPose = mrpt::poses::CPose3D(std::numeric_limits<double>::quiet_NaN(), 0, 0, 0, 0, 0);
  EXPECT_FALSE(pack(record(nowhere)));
  EXPECT_EQ(pack.unusable(), 4u);
  EXPECT_FALSE(pack.found_laser());
}

TEST(ScanPacker, passes_odometry_on_and_nothing_else) {
  ScanPacker pack;
  auto odometry = mrpt::obs::CObservationOdometry::Create();
  odometry->odometry = mrpt::poses::CPose2D(1.0, -2.0, 0.5);
  const auto input = pack(record(odometry, 42));
  ASSERT_TRUE(input);
  EXPECT_EQ(std::get<OdometryInput>(*input).stamp.ns, 42);
  const Pose2 pose = planar(std::get<OdometryInput>(*input).odometry_from_robot);
  EXPECT_NEAR(pose.x, 1.0, 1e-12);
  EXPECT_NEAR(pose.y, -2.0, 1e-12);
  EXPECT_NEAR(pose.phi, 0.5, 1e-12);
  EXPECT_FALSE(pack(record(mrpt::obs::CObservationIMU::Create())));
  odometry->odometry = mrpt::poses::CPose2D(std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0);
  EXPECT_FALSE(pack(record(odometry)));
  EXPECT_EQ(pack.unusable(), 1u);
}

rawlog::Record odometry(double seconds, const mrpt::math::TPose2D& pose) {
  auto observation = mrpt::obs::CObservationOdometry::Create();
  observation->odometry = mrpt::poses::CPose2D(pose);
  return record(observation, static_cast<std::int64_t>(seconds * 1e9));
}

Pose2 packed_odometry(ScanPacker& pack, double seconds, const mrpt::math::TPose2D& pose) {
  return planar(std::get<OdometryInput>(*pack(odometry(seconds, pose))).odometry_from_robot);
}

TEST(ScanPacker, goes_on_where_it_was_when_odometry_starts_anew) {
  ScanPacker pack;
  packed_odometry(pack, 0.0, {0, 0, 0});
  packed_odometry(pack, 1.0, {10, 0, 1.0});
  const Pose2 restarted = packed_odometry(pack, 1.1, {-700, 3, 0});
  EXPECT_NEAR(restarted.x, 10.0, 1e-9);
  EXPECT_NEAR(restarted.phi, 1.0, 1e-9);
  const Pose2 onwards = packed_odometry(pack, 1.2, {-699, 3, 0});
  EXPECT_NEAR(onwards.x, 10.0 + std::cos(1.0), 1e-9);
  EXPECT_NEAR(onwards.y, std::sin(1.0), 1e-9);
  EXPECT_EQ(pack.odometry_jumps(), 1U);
  EXPECT_NEAR(packed_odometry(pack, 1e9, {1e9, 0, 0}).x, onwards.x, 1e-6)
      << "nor do years explain a thousand kilometres";
  EXPECT_EQ(pack.odometry_jumps(), 2U);
}

TEST(ScanPacker, believes_in_no_laser_that_sees_for_kilometres_or_stands_far_off) {
  ScanPacker pack;
  const auto scan = make_scan(4);
  scan->maxRange = 50000.0f;
  scan->setScanRange(1, 40000.0f);
  scan->setScanRange(2, 150.0f);
  const PackedScan result = packed(pack, scan);
  EXPECT_EQ(result.ranges[1], 0);
  EXPECT_NEAR(result.ranges[2] * result.geometry->range_unit_m, 150.0, 0.01);
  scan->sensorPose = mrpt::poses::CPose3D(1e7, 0, 0, 0, 0, 0);
  EXPECT_FALSE(pack(record(scan)));
  EXPECT_EQ(pack.unusable(), 1U);
}

TEST(ScanPacker, knows_of_no_sweep_unless_it_is_given) {
  ScanPacker automatic;
  EXPECT_FALSE(packed(automatic, make_scan()).geometry->has_sweep());
  ScanInputOptions options;
  options.sweep = SweepSource::none;
  options.sweep_s = 0.06;
  ScanPacker none(options);
  EXPECT_FALSE(packed(none, make_scan()).geometry->has_sweep());
}

TEST(ScanPacker, times_each_ray_as_the_options_say) {
  ScanInputOptions options;
  options.sweep = SweepSource::given;
  options.sweep_s = 0.06;
  ScanPacker first(options);
  const auto along = packed(first, make_scan(7)).geometry;
  EXPECT_NEAR(along->ray_time_s(0), 0.0, 1e-12);
  EXPECT_NEAR(along->ray_time_s(6), 0.06, 1e-12);
  options.sweep_order = SweepOrder::against_rays;
  options.sweep_stamp = 1.0;
  ScanPacker second(options);
  const auto against = packed(second, make_scan(7)).geometry;
  EXPECT_NEAR(against->ray_time_s(0), 0.0, 1e-12) << "the last one measured, at the stamp";
  EXPECT_NEAR(against->ray_time_s(6), -0.06, 1e-12);
}

mrpt::obs::CObservationIMU::Ptr unit(double rate_rad_s, const std::string& label = "IMU") {
  auto reading = mrpt::obs::CObservationIMU::Create();
  reading->sensorLabel = label;
  reading->set(mrpt::obs::IMU_WX, 0.0);
  reading->set(mrpt::obs::IMU_WY, 0.0);
  reading->set(mrpt::obs::IMU_WZ, rate_rad_s);
  return reading;
}

// The last heading reported of a unit that is read a hundred times a second.
double heading_after_a_second(ScanPacker& pack, const mrpt::obs::CObservationIMU::Ptr& reading, int& reported) {
  double yaw_rad = 0.0;
  for (int i = 0; i <= 100; ++i) {
    const auto input = pack(record(reading, i * 10'000'000LL));
    if (!input) continue;
    ++reported;
    yaw_rad = std::get<InertialInput>(*input).yaw_rad;
  }
  return yaw_rad;
}

TEST(ScanPacker, sums_up_the_turns_of_an_inertial_unit_and_reports_them_not_too_often) {
  ScanPacker pack;
  int reported = 0;
  EXPECT_NEAR(heading_after_a_second(pack, unit(0.5), reported), 0.5, 0.02);
  EXPECT_GE(reported, 20);
  EXPECT_LE(reported, 26);
  EXPECT_FALSE(pack(record(unit(0.5, "another"), 2'000'000'000LL))) << "the first unit's turns alone";
}

TEST(ScanPacker, turns_the_rates_of_an_inertial_unit_that_is_mounted_upside_down) {
  auto reading = unit(0.5);
  reading->sensorPose = mrpt::poses::CPose3D(0.0, 0.0, 0.0, 0.3, 0.0, M_PI);
  ScanPacker pack;
  int reported = 0;
  EXPECT_NEAR(heading_after_a_second(pack, reading, reported), -0.5, 0.02);
}

TEST(ScanPacker, asks_no_inertial_unit_where_options_say_so) {
  ScanInputOptions options;
  options.inertial = InertialUse::none;
  ScanPacker pack(options);
  int reported = 0;
  heading_after_a_second(pack, unit(0.5), reported);
  EXPECT_EQ(reported, 0);
  EXPECT_TRUE(pack.found_inertial());
  EXPECT_FALSE(ScanPacker().found_inertial());
}

TEST(ScanPacker, takes_turns_in_degrees_as_they_come_and_leaves_out_what_no_unit_measures) {
  ScanPacker pack;
  int reported = 0;
  EXPECT_NEAR(heading_after_a_second(pack, unit(100.0), reported), 100.0, 4.0) << "found out by the scans";
  ScanPacker other;
  reported = 0;
  heading_after_a_second(other, unit(1e6), reported);
  EXPECT_EQ(reported, 0);
  EXPECT_GT(other.unusable(), 0U);
}

}  // namespace
}  // namespace mapweave::laser
