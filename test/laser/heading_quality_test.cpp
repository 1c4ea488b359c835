#include <gtest/gtest.h>
#include <heading_quality.h>
#include <mapweave/core/geometry.h>

#include <random>

namespace mapweave::laser {
namespace {

// A robot that drives straight on: wheels err by `wheels_rad` each step of 0.25 m, matches by `match_rad` each time.
double learned(double wheels_rad, double match_rad, double missed_turn_rad = 0.0) {
  std::mt19937_64 random(3);
  const auto spread = [&](double sigma) {  // a sum of twelve: normal enough
    double sum = -6.0;
    for (int i = 0; i < 12; ++i) sum += static_cast<double>(random() >> 11) / 9007199254740992.0;
    return sigma * sum;
  };
  HeadingQuality quality;
  double heading = 3.0;  // the true one: it wraps around meanwhile
  for (int step = 0; step < 2000; ++step) {
    const double turn = 0.02;
    heading += turn + (step % 100 == 50 ? missed_turn_rad : 0.0);
    quality.add_step(0.25, turn + spread(wheels_rad), 0.01);
    if (quality.wants_heading()) quality.add_heading(wrap_angle(heading + spread(match_rad)));
  }
  return quality.factor();
}

TEST(HeadingQuality, learns_how_good_wheels_are) {
  EXPECT_NEAR(learned(0.01, 0.0), 1.0, 0.3);
  EXPECT_NEAR(learned(0.03, 0.0), 3.0, 0.9);
  EXPECT_NEAR(learned(0.001, 0.0), 0.1, 0.03);
}

TEST(HeadingQuality, takes_the_noise_of_matches_for_that_of_wheels_rather_than_trusting_blindly) {
  EXPECT_GT(learned(0.0001, 0.005), 0.1);
  EXPECT_GE(learned(0.0, 0.0), 0.03) << "never wholly";
}

TEST(HeadingQuality, does_not_let_missed_turns_spoil_what_is_good_otherwise) {
  EXPECT_LT(learned(0.002, 0.0, 0.15), 0.4);
}

TEST(HeadingQuality, leaves_out_stretches_whose_match_failed) {
  HeadingQuality quality;
  for (int i = 0; i < 100; ++i) {
    quality.add_step(6.0, 1.0, 0.01);
    quality.add_heading(i % 2 == 0 ? std::optional(0.0) : std::nullopt);
  }
  EXPECT_EQ(quality.factor(), 1.0);
}

TEST(HeadingQuality, expects_nothing_before_it_has_seen_some_path) {
  HeadingQuality quality;
  EXPECT_EQ(quality.factor(), 1.0);
  EXPECT_TRUE(quality.wants_heading());
  quality.add_heading(0.0);
  EXPECT_FALSE(quality.wants_heading());
  quality.add_step(4.0, 0.0, 0.01);
  EXPECT_FALSE(quality.wants_heading());
  quality.add_step(1.5, 0.0, 0.01);
  EXPECT_TRUE(quality.wants_heading());
  quality.add_heading(0.5);
  EXPECT_EQ(quality.factor(), 1.0) << "one stretch says nothing";
}

}  // namespace
}  // namespace mapweave::laser
