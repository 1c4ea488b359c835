#include <mapweave/visual/visual_client.h>
#include <support/painted_room.h>

#include <gmock/gmock.h>

namespace mapweave::visual {
namespace {

const test::PaintedRoom room{{4.0, 1.5, 4.0}, {240, 180, 195.0, 195.0, 119.5, 89.5}};

Stamp at(int frame) { return stamp_from_seconds(100.0 + frame / 15.0); }

// A walk around the room's middle that looks about.
Pose3 walk(double frame) {
  return test::standing(0.8 * std::sin(0.05 * frame), 0.8 - 0.8 * std::cos(0.05 * frame), 0.04 * frame,
                        0.1 * std::sin(0.1 * frame));
}

// Greatest distance between where frames were and where they are said to be, once the first frames lie on each other.
double worst_error(const VisualClient& client, const std::vector<Pose3>& truth) {
  const auto placed = client.trajectory();
  double worst = 0;
  for (const PlacedFrame& frame : placed) {
    const auto number = static_cast<std::size_t>(std::lround((frame.stamp.seconds() - 100.0) * 15.0));
    const Pose3 estimate = compose(truth.front(), frame.map_from_camera);
    worst = std::max(worst, (estimate.t - truth[number].t).norm());
  }
  return worst;
}

TEST(VisualClient, follows_a_depth_camera_within_centimetres) {
  VisualClient client(room.camera, 0.0, {});
  std::vector<Pose3> truth;
  for (int i = 0; i < 60; ++i) {
    truth.push_back(walk(i));
    const Tracked tracked = client.add(room.frame(at(i), truth.back()));
    ASSERT_EQ(tracked.state, TrackState::tracked) << i;
  }
  EXPECT_EQ(client.trajectory().size(), 60U);
  EXPECT_LT(worst_error(client, truth), 0.02);
  EXPECT_GT(client.keyframes().size(), 3U);
  EXPECT_LT(client.keyframes().size(), 40U);
  for (const MappedLandmark& landmark : client.landmarks()) {
    const Eigen::Vector3d p = transformed(landmark.point_in_map, truth.front());
    EXPECT_LT((p.cwiseAbs() - room.half).maxCoeff(), 0.2);
  }
}

TEST(VisualClient, follows_a_stereo_pair) {
  VisualClient client(room.camera, 0.12, {});
  std::vector<Pose3> truth;
  for (int i = 0; i < 40; ++i) {
    truth.push_back(walk(i));
    ASSERT_EQ(client.add(room.pair(at(i), truth.back(), 0.12)).state, TrackState::tracked) << i;
  }
  EXPECT_LT(worst_error(client, truth), 0.06);
}

TEST(VisualClient, learns_that_rows_are_read_one_after_the_other) {
  constexpr double kReadout = 0.03;
  const auto run = [&](bool learn, double& readout) {
    ClientOptions options;
    options.window.learn_readout = learn;
    VisualClient client(room.camera, 0.0, options);
    std::vector<Pose3> truth;
    const auto pose = [](double frame) {
      return test::standing(0, 0, 0.7 * std::sin(0.16 * frame), 0.25 * std::sin(0.23 * frame));
    };
    for (int i = 0; i < 60; ++i) {
      truth.push_back(pose(i));
      Frame frame = room.frame(at(i), pose(i - 0.5 * kReadout * 15.0), pose(i + 0.5 * kReadout * 15.0));
      frame.depth.image = room.frame(at(i), pose(i)).depth.image;
      client.add(frame);
    }
    readout = client.sensor().readout_s;
    EXPECT_GT(client.trajectory().size(), 55U);
    return worst_error(client, truth);
  };
  double learnt = 0, ignored = 0;
  const double with = run(true, learnt), without = run(false, ignored);
  EXPECT_NEAR(learnt, kReadout, 0.008);
  EXPECT_EQ(ignored, 0.0);
  EXPECT_LT(with, 0.7 * without);
}

TEST(VisualClient, finds_itself_again_after_a_jump) {
  VisualClient client(room.camera, 0.0, {});
  std::vector<Pose3> truth;
  for (int i = 0; i < 40; ++i) {
    truth.push_back(walk(i));
    client.add(room.frame(at(i), truth.back()));
  }
  // The camera is covered, and carried back some metres meanwhile.
  Frame dark = room.frame(at(40), walk(40));
  std::fill(dark.grey.pixels.begin(), dark.grey.pixels.end(), std::uint8_t{4});
  truth.push_back(walk(40));
  EXPECT_EQ(client.add(dark).state, TrackState::lost);
  truth.push_back(compose(walk(36), test::standing(0.05, 0.02, 0.08)));
  EXPECT_EQ(client.add(room.frame(at(41), truth.back())).state, TrackState::tracked);
  EXPECT_EQ(client.trajectory().size(), 41U);
  EXPECT_LT(worst_error(client, truth), 0.03);
}

TEST(VisualClient, waits_for_a_frame_that_shows_something_deep) {
  VisualClient client(room.camera, 0.0, {});
  Frame blank = room.frame(at(0), walk(0));
  std::fill(blank.depth.image.pixels.begin(), blank.depth.image.pixels.end(), std::uint16_t{0});
  EXPECT_EQ(client.add(blank).state, TrackState::waiting);
  EXPECT_THAT(client.trajectory(), testing::IsEmpty());
  EXPECT_EQ(client.add(room.frame(at(1), walk(0))).state, TrackState::tracked);
}

TEST(VisualClient, gives_the_same_numbers_every_time) {
  const auto run = [] {
    VisualClient client(room.camera, 0.0, {});
    for (int i = 0; i < 25; ++i) client.add(room.frame(at(i), walk(i)));
    std::vector<double> numbers;
    for (const PlacedFrame& frame : client.trajectory())
      for (int k = 0; k < 3; ++k) numbers.push_back(frame.map_from_camera.t[k]);
    return numbers;
  };
  EXPECT_EQ(run(), run());
}

}  // namespace
}  // namespace mapweave::visual
