#include "geometry/driven_motion.h"

#include <support/painted_room.h>

#include <gmock/gmock.h>

namespace mapweave::visual {
namespace {

// A camera that drives straight ahead in its own frame, and what its wheels say.
Station station(double seconds, const Pose3& map_from_camera, const std::optional<Pose3>& odometry, double metres) {
  Station result;
  result.stamp = stamp_from_seconds(seconds);
  result.driven.odometry_from_camera = odometry;
  result.driven.metres = metres;
  result.view = view_of(map_from_camera);
  return result;
}
Pose3 ahead(double metres, double turned = 0.0) { return test::standing(0.0, metres, turned); }

TEST(DrivenMotion, adds_up_what_odometry_says) {
  DrivenMotion driven;
  go_on(driven, std::nullopt);
  go_on(driven, ahead(1.0));
  go_on(driven, ahead(1.5, 0.2));
  EXPECT_NEAR(driven.metres, 0.5, 1e-9);
  EXPECT_NEAR(driven.radians, 0.2, 1e-9);
  go_on(driven, std::nullopt);
  go_on(driven, ahead(9.0));
  EXPECT_NEAR(driven.metres, 0.5, 1e-9) << "nothing is known of the motion while odometry is silent";
}

TEST(DrivenMotion, odometry_allows_more_the_farther_it_drove) {
  const Station start = station(0, ahead(0), ahead(5), 0);
  for (const double driven : {0.0, 2.0, 4.0}) {
    const Departure right = departure(start, station(9, ahead(driven), ahead(5 + driven), driven), {});
    EXPECT_NEAR(right.error_m, 0.0, 1e-9);
    EXPECT_NEAR(right.reach_m, 0.3 + 0.15 * driven, 1e-9);
  }
  const Departure elsewhere = departure(start, station(9, ahead(2), ahead(5), 0), {});
  EXPECT_NEAR(elsewhere.error_m, 2.0, 1e-9);
  EXPECT_EQ(allowed(elsewhere, kUnique_m), Allowed::no) << "carried off, or in a room that looks the same";
  EXPECT_EQ(allowed(departure(start, station(9, ahead(0, 0.5), ahead(5), 0), {}), kUnique_m), Allowed::no)
      << "it looks elsewhere";
}

TEST(DrivenMotion, drift_does_not_lead_to_what_was_refused) {
  const Station start = station(0, ahead(0), ahead(0), 0);
  Station later = station(9, ahead(3.6), ahead(3), 3);
  EXPECT_EQ(allowed(departure(start, later, {}), kUnique_m), Allowed::yes);
  later.driven.refused_m = 0.6;
  EXPECT_EQ(allowed(departure(start, later, {}), kUnique_m), Allowed::no);
}

TEST(DrivenMotion, without_odometry_time_decides) {
  const Station start = station(0, ahead(0), std::nullopt, 0);
  EXPECT_EQ(allowed(departure(start, station(1, ahead(1), std::nullopt, 0), {}), kUnique_m), Allowed::yes);
  EXPECT_EQ(allowed(departure(start, station(1, ahead(2), std::nullopt, 0), {}), kUnique_m), Allowed::no);
  const Departure late = departure(start, station(4, ahead(1), std::nullopt, 0), {});
  EXPECT_EQ(allowed(late, kUnique_m), Allowed::unclear) << "it may as well have come to the room next door";
  SessionOptions unique;
  unique.alike_m = 0.0;
  EXPECT_EQ(allowed(departure(start, station(4, ahead(1), std::nullopt, 0), unique), kUnique_m), Allowed::yes);
}

TEST(DrivenMotion, what_a_twin_explains_as_well_is_unclear) {
  EXPECT_EQ(allowed({1.0, 2.0}, kUnique_m), Allowed::yes);
  EXPECT_EQ(allowed({1.0, 2.0}, 4.0), Allowed::yes);
  EXPECT_EQ(allowed({2.5, 3.0}, 4.0), Allowed::unclear);
  EXPECT_EQ(allowed({0.1, 4.5}, 4.0), Allowed::unclear);
}

}  // namespace
}  // namespace mapweave::visual
