#include <gtest/gtest.h>
#include <laser/room_widths.h>

#include <cmath>
#include <random>

namespace mapweave::fusion {
namespace {

// Rectangular rooms, each seen by a submap of its own whose frame lies anywhere.
class Rooms {
 public:
  Rooms(std::size_t count, double width_m, double depth_m, double noise_m = 0.005) : walls_(count) {
    std::mt19937 random(static_cast<std::uint32_t>(1e3 * width_m) + 7U);
    std::normal_distribution<double> noise(0.0, noise_m);
    for (std::size_t i = 0; i < count; ++i) {
      const Pose2 pose{10.0 * static_cast<double>(i) + 0.3, -0.2, 0.7 + static_cast<double>(i)};
      const auto add = [&](double x, double y, double normal_x, double normal_y) {
        const Pose2 wall = between(pose, Pose2{10.0 * static_cast<double>(i) + x + noise(random) * normal_x,
                                               y + noise(random) * normal_y, 0.0});
        const double c = std::cos(wall.phi), s = std::sin(wall.phi);
        walls_[i].push_back({static_cast<float>(wall.x), static_cast<float>(wall.y),
                             static_cast<float>(c * normal_x - s * normal_y),
                             static_cast<float>(s * normal_x + c * normal_y)});
      };
      for (double along = -0.5 * depth_m + 0.05; along < 0.5 * depth_m; along += 0.07) {
        add(-0.5 * width_m, along, 1.0, 0.0);
        add(0.5 * width_m, along, -1.0, 0.0);
      }
      for (double along = -0.5 * width_m + 0.05; along < 0.5 * width_m; along += 0.07) {
        add(along, -0.5 * depth_m, 0.0, 1.0);
        add(along, 0.5 * depth_m, 0.0, -1.0);
      }
      poses_.push_back(pose);
    }
  }
  // Moved as a drifting map moves its submaps.
  std::vector<PlacedSubmap> placed(double drift_m = 0.0) const {
    std::vector<PlacedSubmap> result;
    for (std::size_t i = 0; i < walls_.size(); ++i) {
      Pose2 pose = poses_[i];
      pose.x += i % 2 == 0 ? drift_m : -drift_m;
      pose.y -= drift_m;
      result.push_back({i, pose, 10.0 * static_cast<double>(i), 0.0, 4.0, &walls_[i]});
    }
    return result;
  }

 private:
  std::vector<std::vector<matching::WallPoint>> walls_;
  std::vector<Pose2> poses_;
};

TEST(RoomWidths, are_compared_to_centimetres_though_both_maps_drift) {
  const Rooms one(4, 3.0, 4.0), wider(4, 3.06, 4.0), larger(4, 3.08, 4.08);
  const WidthComparison same = compare_widths(one.placed(), Rooms(4, 3.0, 4.0, 0.007).placed(0.05));
  EXPECT_EQ(same.count, 4U);
  EXPECT_NEAR(same.difference_m, 0.0, 0.004);
  EXPECT_EQ(same.certain_m(), 0.0);
  const WidthComparison all = compare_widths(one.placed(), larger.placed(0.05));
  EXPECT_NEAR(all.difference_m, 0.08, 0.006);
  EXPECT_GT(all.certain_m(), 0.05);
  EXPECT_NEAR(compare_widths(larger.placed(0.05), one.placed()).difference_m, -all.difference_m, 0.003);
  EXPECT_NEAR(compare_widths(one.placed(), wider.placed()).difference_m, 0.06, 0.006) << "as deep, but wider";
}

TEST(RoomWidths, of_one_room_have_to_differ_more_and_those_of_none_say_nothing) {
  const Rooms one(1, 1.0, 3.0), wider(1, 1.06, 3.0);
  const WidthComparison room = compare_widths(one.placed(), wider.placed());
  EXPECT_EQ(room.count, 1U) << "a metre of wall is too little";
  EXPECT_NEAR(room.difference_m, 0.06, 0.006);
  EXPECT_LT(room.certain_m(), 0.05);
  EXPECT_EQ(compare_widths({}, one.placed()).count, 0U);
  EXPECT_EQ(compare_widths({}, one.placed()).certain_m(), 0.0);
}

}  // namespace
}  // namespace mapweave::fusion
