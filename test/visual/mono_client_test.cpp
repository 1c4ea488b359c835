#include <mapweave/visual/visual_client.h>
#include <support/painted_room.h>

#include <gmock/gmock.h>

namespace mapweave::visual {
namespace {

const test::PaintedRoom room{{4.0, 1.5, 4.0}, {240, 180, 195.0, 195.0, 119.5, 89.5}};

Stamp at(int frame) { return stamp_from_seconds(100.0 + frame / 15.0); }

Frame picture(int frame, const Pose3& pose) {
  Frame result = room.frame(at(frame), pose);
  result.depth = {};
  return result;
}

// Sideways along a wall at first, then around the room's middle.
Pose3 walk(int frame) {
  const double along = 0.035 * frame;
  return test::standing(-1.0 + along, -0.5 + 0.2 * std::sin(1.5 * along), 0.25 * along, 0.05 * std::sin(0.1 * frame));
}

struct Laid {
  double worst_m = 0.0, scale = 1.0;
};

// Distances from the truth once the first placed frames lie on each other and the last ones are as far away.
Laid laid_on(const VisualClient& client, const std::vector<Pose3>& truth) {
  const auto placed = client.trajectory();
  const auto true_pose = [&](const PlacedFrame& frame) {
    return truth[static_cast<std::size_t>(std::lround((frame.stamp.seconds() - 100.0) * 15.0))];
  };
  const Pose3 first = true_pose(placed.front()), last = true_pose(placed.back());
  Laid result;
  result.scale =
      between(first, last).t.norm() / between(placed.front().map_from_camera, placed.back().map_from_camera).t.norm();
  for (const PlacedFrame& frame : placed) {
    const Eigen::Vector3d motion = result.scale * between(placed.front().map_from_camera, frame.map_from_camera).t;
    result.worst_m = std::max(result.worst_m, (motion - between(first, true_pose(frame)).t).norm());
  }
  return result;
}

TEST(MonoClient, follows_pictures_alone_up_to_scale) {
  VisualClient client(room.camera, 0.0, {});
  std::vector<Pose3> truth;
  int tracked = 0;
  for (int i = 0; i < 60; ++i) {
    truth.push_back(walk(i));
    const Tracked now = client.add(picture(i, truth.back()));
    EXPECT_NE(now.state, TrackState::lost) << i;
    tracked += now.state == TrackState::tracked;
  }
  EXPECT_GT(tracked, 50);
  EXPECT_LT(laid_on(client, truth).worst_m, 0.03);
  EXPECT_GT(client.landmarks().size(), 150U);
}

TEST(MonoClient, takes_scale_from_odometry) {
  VisualClient client(room.camera, 0.0, {});
  std::vector<Pose3> truth;
  for (int i = 0; i < 40; ++i) {
    truth.push_back(walk(i));
    Frame frame = picture(i, truth.back());
    frame.odometry_from_camera = compose(test::standing(3.0, 1.0, 0.7), truth.back());
    client.add(frame);
  }
  EXPECT_NEAR(laid_on(client, truth).scale, 1.0, 0.03);
}

TEST(MonoClient, publishes_no_depths_that_it_worked_out_itself) {
  ClientOptions options;
  options.depth.inverse_depth_sigma = 1.0;  // whatever a depth camera may have
  VisualClient client(room.camera, 0.0, options);
  for (int i = 0; i < 60; ++i) client.add(picture(i, walk(i)));
  const auto updates = client.take_updates({{RobotId("alpha"), SensorId("camera")}, {}}, PublishedDetail::exact);
  ASSERT_FALSE(updates.empty());
  int sightings = 0;
  for (const MapUpdate& update : updates)
    for (const Landmark& landmark : update.landmarks)
      for (const LandmarkSighting& sighting : landmark.seen) {
        ASSERT_EQ(sighting.inverse_depth, 0);
        ++sightings;
      }
  EXPECT_GT(sightings, 300);
}

TEST(MonoClient, waits_while_it_stands_or_only_turns) {
  VisualClient client(room.camera, 0.0, {});
  for (int i = 0; i < 30; ++i)
    EXPECT_EQ(client.add(picture(i, test::standing(0, 0, i < 10 ? 0.0 : 0.03 * (i - 10)))).state, TrackState::waiting)
        << i;
  EXPECT_THAT(client.landmarks(), testing::IsEmpty());
}

TEST(MonoClient, holds_on_while_it_turns_on_the_spot) {
  VisualClient client(room.camera, 0.0, {});
  std::vector<Pose3> truth;
  const auto motion = [](int i) { return i < 30 ? walk(i) : compose(walk(30), test::standing(0, 0, 0.03 * (i - 30))); };
  for (int i = 0; i < 90; ++i) {
    truth.push_back(motion(i));
    EXPECT_NE(client.add(picture(i, truth.back())).state, TrackState::lost) << i;
  }
  const Pose3 turned = between(client.trajectory().front().map_from_camera, client.trajectory().back().map_from_camera);
  const Pose3 really = between(truth[truth.size() - client.trajectory().size()], truth.back());
  EXPECT_LT(turned.q.angularDistance(really.q), 0.04);
}

TEST(MonoClient, survives_blank_and_frozen_pictures) {
  VisualClient client(room.camera, 0.0, {});
  for (int i = 0; i < 10; ++i) {
    Frame blank = picture(i, walk(0));
    std::fill(blank.grey.pixels.begin(), blank.grey.pixels.end(), std::uint8_t{90});
    EXPECT_EQ(client.add(blank).state, TrackState::waiting);
  }
  for (int i = 10; i < 50; ++i) client.add(picture(i, walk(i < 40 ? i : 40)));
  EXPECT_GT(client.trajectory().size(), 25U);
}

TEST(MonoClient, gives_the_same_numbers_every_time) {
  const auto run = [] {
    VisualClient client(room.camera, 0.0, {});
    for (int i = 0; i < 30; ++i) client.add(picture(i, walk(i)));
    std::vector<double> numbers;
    for (const PlacedFrame& frame : client.trajectory())
      for (int k = 0; k < 3; ++k) numbers.push_back(frame.map_from_camera.t[k]);
    return numbers;
  };
  const auto once = run();
  EXPECT_THAT(once, testing::Not(testing::IsEmpty()));
  EXPECT_EQ(once, run());
}

}  // namespace
}  // namespace mapweave::visual
