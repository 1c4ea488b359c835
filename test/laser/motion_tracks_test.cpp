#include <gtest/gtest.h>

#include "motion_tracks.h"

#include <cmath>

namespace mapweave::laser {
namespace {

Stamp at(double seconds) { return {std::llround(seconds * 1e9)}; }

TEST(OdometryTrack, interpolates_between_readings_and_goes_on_shortly_after_the_last) {
  OdometryTrack track;
  track.add(at(1.0), {1.0, 0.0, 0.0});
  track.add(at(1.2), {1.2, 0.0, 0.2});
  EXPECT_FALSE(track.at(at(0.9)));
  EXPECT_NEAR(track.at(at(1.1))->phi, 0.1, 1e-9);
  EXPECT_NEAR(track.at(at(1.3))->phi, 0.3, 1e-9);
  EXPECT_FALSE(track.at(at(3.0)));
}

// A unit whose turn rate is `scale` times that of a robot that turns to and fro.
InertialTrack track_of(double scale) {
  InertialTrack track;
  const auto heading = [](double seconds) { return 0.5 * std::sin(seconds); };
  for (int i = 0; i <= 500; ++i) {
    const double seconds = 0.04 * i;
    track.add(at(seconds), scale * heading(seconds) + 0.003 * seconds);
    if (i % 5 == 0 && i > 0) track.compare(at(seconds - 0.2), at(seconds), heading(seconds) - heading(seconds - 0.2));
  }
  return track;
}

TEST(InertialTrack, is_trusted_where_it_turns_as_the_scans_do) {
  EXPECT_TRUE(track_of(1.0).is_trusted());
  EXPECT_NEAR(*track_of(1.0).turn(at(15.0), at(15.1)), 0.5 * (std::sin(15.1) - std::sin(15.0)), 1e-3);
}

TEST(InertialTrack, is_not_trusted_upside_down_in_degrees_or_before_anything_was_compared) {
  EXPECT_FALSE(track_of(-1.0).is_trusted());
  EXPECT_FALSE(track_of(57.3).is_trusted());
  EXPECT_FALSE(track_of(0.0).is_trusted());
  EXPECT_FALSE(InertialTrack().is_trusted());
}

TEST(InertialTrack, says_nothing_of_gaps) {
  InertialTrack track;
  track.add(at(0.0), 0.0);
  track.add(at(1.0), 0.5);
  track.add(at(1.1), 0.6);
  EXPECT_FALSE(track.turn(at(0.4), at(0.5)));
  EXPECT_FALSE(track.turn(at(1.0), at(2.0)));
  EXPECT_NEAR(*track.turn(at(1.05), at(1.1)), 0.05, 1e-9);
}

}  // namespace
}  // namespace mapweave::laser
