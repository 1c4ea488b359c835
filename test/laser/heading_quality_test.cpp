#include <gtest/gtest.h>
#include <heading_quality.h>
#include <mapweave/core/geometry.h>

#include <random>

namespace mapweave::laser {
namespace {

// A robot that drives straight on: wheels err by `wheels_rad` each step of 0.25 m, matches by `match_rad` each time.
HeadingQuality learned(double wheels_rad, double match_rad, double missed_turn_rad = 0.0) {
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
    if (quality.wants_heading()) quality.add_heading(MatchedHeading{wrap_angle(heading + spread(match_rad)), 0.001});
  }
  return quality;
}

TEST(HeadingQuality, learns_how_good_wheels_are) {
  EXPECT_NEAR(learned(0.01, 0.0).factor(), 1.0, 0.3);
  EXPECT_NEAR(learned(0.03, 0.0).factor(), 3.0, 0.9);
  EXPECT_NEAR(learned(0.001, 0.0).factor(), 0.1, 0.03);
}

TEST(HeadingQuality, takes_the_noise_of_matches_for_that_of_wheels_rather_than_trusting_blindly) {
  EXPECT_GT(learned(0.0001, 0.005).factor(), 0.1);
  EXPECT_GE(learned(0.0, 0.0).factor(), 0.03) << "never wholly";
}

TEST(HeadingQuality, learns_how_good_matches_are) {
  // By the median of forty: a factor of three.
  const auto learns = [](double wheels_rad, double match_rad, double information) {
    const double found = learned(wheels_rad, match_rad).match_information().value();
    EXPECT_GT(found, information / 3.0);
    EXPECT_LT(found, information * 3.0);
  };
  learns(0.002, 0.01, 0.01);  // the points promise 0.001
  learns(0.0005, 0.003, 0.11);
  EXPECT_GT(learned(0.002, 0.0005).match_information().value(), 0.5) << "good ones, though wheels are worse";
  EXPECT_FALSE(HeadingQuality().match_information()) << "nothing is known yet";
}

TEST(HeadingQuality, does_not_let_missed_turns_spoil_what_is_good_otherwise) {
  EXPECT_LT(learned(0.002, 0.0, 0.15).factor(), 0.4);
}

TEST(HeadingQuality, leaves_out_stretches_whose_match_failed) {
  HeadingQuality quality;
  for (int i = 0; i < 100; ++i) {
    quality.add_step(6.0, 1.0, 0.01);
    quality.add_heading(i % 2 == 0 ? std::optional(MatchedHeading{}) : std::nullopt);
  }
  EXPECT_EQ(quality.factor(), 1.0);
}

TEST(HeadingQuality, expects_nothing_before_it_has_seen_some_path) {
  HeadingQuality quality;
  EXPECT_EQ(quality.factor(), 1.0);
  EXPECT_TRUE(quality.wants_heading());
  quality.add_heading(MatchedHeading{});
  EXPECT_FALSE(quality.wants_heading());
  quality.add_step(0.2, 0.0, 0.01);
  EXPECT_TRUE(quality.wants_heading()) << "the first step of the stretch";
  quality.add_heading(MatchedHeading{});
  quality.add_step(3.8, 0.0, 0.01);
  EXPECT_FALSE(quality.wants_heading());
  quality.add_step(1.5, 0.0, 0.01);
  EXPECT_TRUE(quality.wants_heading());
  quality.add_heading(MatchedHeading{0.5, 0.001});
  EXPECT_EQ(quality.factor(), 1.0) << "one stretch says nothing";
}

}  // namespace
}  // namespace mapweave::laser
