#include "pictures/feature_grid.h"

#include <mapweave/core/error.h>
#include <mapweave/visual/visual_client.h>
#include <support/painted_room.h>

#include <gmock/gmock.h>
#include <random>

namespace mapweave::visual {
namespace {

const Pinhole camera{320, 240, 260.0, 260.0, 159.5, 119.5};

// A room whose walls carry landmarks.
class StarryRoom {
 public:
  StarryRoom() {
    for (int i = 0; i < 1500; ++i) {
      Eigen::Vector3d point(uniform(-4, 4), uniform(-1.5, 1.5), uniform(-4, 4));
      const int axis = i % 2 == 0 ? 0 : 2;
      point[axis] = i % 4 < 2 ? 4.0 : -4.0;
      points_.push_back(point);
      descriptors_.push_back({random_(), random_(), random_(), random_()});
    }
  }
  FeatureFrame frame(Stamp stamp, const Pose3& room_from_camera) {
    FeatureFrame result;
    result.stamp = stamp;
    const Pose3 camera_from_room = inverse(room_from_camera);
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3d p = transformed(points_[i], camera_from_room);
      if (p.z() < 0.3 || uniform(0, 1) < 0.1) continue;
      const Eigen::Vector2d pixel = camera.project(p);
      if (!(pixel.x() > 0 && pixel.y() > 0 && pixel.x() < camera.width && pixel.y() < camera.height)) continue;
      matching::OrbDescriptor descriptor = descriptors_[i];
      for (int bit = 0; bit < 10; ++bit) descriptor[random_() % 4] ^= std::uint64_t{1} << (random_() % 64);
      result.features.points.push_back({static_cast<float>(pixel.x() + uniform(-0.3, 0.3)),
                                        static_cast<float>(pixel.y() + uniform(-0.3, 0.3)), 0, 0});
      result.features.descriptors.push_back(descriptor);
      result.inverse_depths.push_back(static_cast<float>(1.0 / p.z() + uniform(-0.002, 0.002)));
    }
    return result;
  }

 private:
  double uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(random_() >> 11) * 0x1.0p-53;
  }
  std::mt19937_64 random_{5};
  std::vector<Eigen::Vector3d> points_;
  std::vector<matching::OrbDescriptor> descriptors_;
};

Stamp at(int frame) { return stamp_from_seconds(100.0 + frame / 15.0); }
Pose3 walk(int frame) {
  return test::standing(0.8 * std::sin(0.03 * frame), 0.8 - 0.8 * std::cos(0.03 * frame), 0.03 * frame);
}

TEST(FeatureClient, follows_features_without_pictures) {
  StarryRoom room;
  VisualClient client(camera, 0.0, {});
  for (int i = 0; i < 200; ++i) ASSERT_EQ(client.add(room.frame(at(i), walk(i))).state, TrackState::tracked) << i;
  const auto placed = client.trajectory();
  ASSERT_EQ(placed.size(), 200U);
  for (int i = 0; i < 200; ++i) {
    const Pose3 truth = between(walk(0), walk(i));
    EXPECT_LT((placed[static_cast<std::size_t>(i)].map_from_camera.t - truth.t).norm(), 0.07) << i;
  }
  EXPECT_LT(client.keyframes().size(), 60U);
}

TEST(FeatureClient, keeps_fewer_frames_of_long_ago_where_a_drive_goes_on_and_on) {
  StarryRoom room;
  ClientOptions options;
  options.memory.frames = 60;
  VisualClient client(camera, 0.0, options);
  for (int i = 0; i < 200; ++i) {
    ASSERT_EQ(client.add(room.frame(at(i), walk(i))).state, TrackState::tracked) << i;
    ASSERT_LE(client.trajectory().size(), 60U) << i;
  }
  const auto placed = client.trajectory();
  EXPECT_GT(placed.size(), 30U);
  const auto before = [&](int frame) {
    return std::count_if(placed.begin(), placed.end(), [&](const PlacedFrame& one) { return one.stamp < at(frame); });
  };
  EXPECT_GT(before(30), 0);
  EXPECT_LT(before(100), before(200) - before(100));
  for (const PlacedFrame& one : placed) {
    const int number = static_cast<int>(std::lround((one.stamp.seconds() - 100.0) * 15.0));
    EXPECT_LT((one.map_from_camera.t - between(walk(0), walk(number)).t).norm(), 0.07) << number;
  }
}

TEST(FeatureClient, finds_itself_again_after_a_jump) {
  StarryRoom room;
  VisualClient client(camera, 0.0, {});
  for (int i = 0; i < 60; ++i) client.add(room.frame(at(i), walk(i)));
  FeatureFrame nothing;
  nothing.stamp = at(60);
  EXPECT_EQ(client.add(nothing).state, TrackState::lost);
  const Pose3 there = compose(walk(52), test::standing(0.1, 0.05, 0.1));
  const Tracked again = client.add(room.frame(at(61), there));
  ASSERT_EQ(again.state, TrackState::tracked);
  EXPECT_LT((again.map_from_camera.t - between(walk(0), there).t).norm(), 0.05);
}

TEST(FeatureClient, waits_for_features_with_depth) {
  StarryRoom room;
  VisualClient client(camera, 0.0, {});
  FeatureFrame flat = room.frame(at(0), walk(0));
  std::fill(flat.inverse_depths.begin(), flat.inverse_depths.end(), 0.0F);
  EXPECT_EQ(client.add(flat).state, TrackState::waiting);
  EXPECT_EQ(client.add(room.frame(at(1), walk(1))).state, TrackState::tracked);
}

TEST(FeatureClient, leaves_out_features_that_are_no_numbers_and_refuses_half_ones) {
  StarryRoom room;
  VisualClient client(camera, 0.0, {});
  FeatureFrame frame = room.frame(at(0), walk(0));
  frame.features.points[0].u_px = std::numeric_limits<float>::quiet_NaN();
  frame.features.points[1].v_px = 1e9F;
  frame.inverse_depths[2] = std::numeric_limits<float>::infinity();
  frame.inverse_depths[3] = -1.0F;
  const FrameFeatureGrid grid(frame, camera);
  EXPECT_EQ(grid.size(), static_cast<int>(frame.features.points.size()) - 2);
  EXPECT_EQ(grid.inverse_depth(0), 0.0);
  EXPECT_EQ(grid.inverse_depth(1), 0.0);
  EXPECT_EQ(client.add(frame).state, TrackState::tracked);
  frame.inverse_depths.pop_back();
  EXPECT_THROW(client.add(frame), ContractViolation);
}

TEST(FrameFeatureGrid, finds_what_looks_alike_nearby) {
  StarryRoom room;
  const FeatureFrame frame = room.frame(at(0), walk(0));
  const FrameFeatureGrid grid(frame, camera);
  std::vector<char> taken(static_cast<std::size_t>(grid.size()), 0);
  for (int i = 0; i < grid.size(); ++i) {
    const matching::OrbDescriptor& descriptor = grid.features().descriptors[static_cast<std::size_t>(i)];
    EXPECT_EQ(grid.find(descriptor, grid.pixel(i) + Eigen::Vector2d(3, -3), 5.0, taken), i);
    EXPECT_EQ(grid.find(descriptor, grid.pixel(i) + Eigen::Vector2d(6, 0), 5.0, taken), -1);
  }
  taken[7] = 1;
  EXPECT_EQ(grid.find(grid.features().descriptors[7], grid.pixel(7), 5.0, taken), -1);
}

}  // namespace
}  // namespace mapweave::visual
