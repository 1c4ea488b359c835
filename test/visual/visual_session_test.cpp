// What goes wrong with cameras, and what a client makes of it.
#include <support/live_client.h>
#include <support/painted_room.h>

#include <gmock/gmock.h>
#include <atomic>
#include <future>
#include <thread>

namespace mapweave::visual {
namespace {

const test::PaintedRoom room{{4.0, 1.5, 4.0}, {240, 180, 195.0, 195.0, 119.5, 89.5}};

Stamp at(int frame) { return stamp_from_seconds(100.0 + frame / 15.0); }

Pose3 walk(double frame) {
  return test::standing(0.8 * std::sin(0.05 * frame), 0.8 - 0.8 * std::cos(0.05 * frame), 0.04 * frame);
}

Frame covered(int frame) {
  Frame dark = room.frame(at(frame), walk(0));
  std::fill(dark.grey.pixels.begin(), dark.grey.pixels.end(), std::uint8_t{4});
  return dark;
}

ClientOptions impatient() {
  ClientOptions options;
  options.session.patience_s = 0.4;
  options.session.alike_m = 0.0;
  return options;
}

TEST(VisualSessions, waits_while_nothing_is_to_be_seen) {
  VisualClient client(room.camera, 0.0, impatient());
  int frame = 0;
  for (; frame < 20; ++frame) client.add(room.frame(at(frame), walk(frame)));
  for (; frame < 60; ++frame) EXPECT_EQ(client.add(covered(frame)).state, TrackState::lost);
  EXPECT_THAT(client.sessions(), testing::ElementsAre(0)) << "a covered camera begins no new map";
  EXPECT_EQ(client.add(room.frame(at(frame), walk(18))).state, TrackState::tracked);
  EXPECT_THAT(client.notes(), testing::IsEmpty());
}

// Carried to the other side, where nothing has been seen before; there it turns until it looks where it began.
Pose3 carried(int frame) {
  if (frame < 25) return walk(frame);
  return test::standing(-0.8, 0.5, 3.6 + 0.04 * (frame - 25));
}
constexpr int kCarriedFrames = 155;

TEST(VisualSessions, begins_another_map_in_a_new_place_and_joins_it_when_it_comes_back) {
  VisualClient client(room.camera, 0.0, impatient(), matching::shipped_vocabulary());
  int lost = 0;
  std::size_t most = 0;
  for (int i = 0; i < kCarriedFrames; ++i) {
    lost += client.add(room.frame(at(i), carried(i))).state == TrackState::lost;
    most = std::max(most, client.sessions().size());
  }
  client.finish();
  EXPECT_LT(lost, 15);
  EXPECT_EQ(most, 2U);
  EXPECT_THAT(client.sessions(), testing::ElementsAre(0));
  for (const PlacedFrame& placed : client.trajectory()) {
    const int number = static_cast<int>(std::lround((placed.stamp.seconds() - 100.0) * 15.0));
    EXPECT_EQ(placed.session, 0);
    EXPECT_LT((compose(walk(0), placed.map_from_camera).t - carried(number).t).norm(), 0.1) << number;
  }
}

TEST(VisualSessions, gives_the_same_numbers_whoever_corrects_the_map) {
  const auto run = [](bool aside) {
    VisualClient client(room.camera, 0.0, impatient(), matching::shipped_vocabulary());
    std::thread helper;
    int helped = 0;
    for (int i = 0; i < kCarriedFrames; ++i) {
      client.add(room.frame(at(i), carried(i)));
      const auto work = client.pending();
      if (!aside || !work || helper.joinable()) continue;
      helper = std::thread([work] { work->run(); });
      ++helped;
    }
    client.finish();
    if (helper.joinable()) helper.join();
    EXPECT_EQ(helped, aside ? 1 : 0);
    std::vector<double> numbers;
    for (const PlacedFrame& frame : client.trajectory())
      for (int k = 0; k < 3; ++k) numbers.push_back(frame.map_from_camera.t[k]);
    return numbers;
  };
  EXPECT_EQ(run(false), run(true));
}

TEST(VisualSessions, survives_a_frozen_camera) {
  VisualClient client(room.camera, 0.0, {});
  int frame = 0;
  for (; frame < 10; ++frame) client.add(room.frame(at(frame), walk(frame)));
  const std::size_t keyframes = client.keyframes().size();
  for (; frame < 40; ++frame) EXPECT_EQ(client.add(room.frame(at(frame), walk(9))).state, TrackState::tracked);
  EXPECT_LE(client.keyframes().size(), keyframes + 1);
  EXPECT_EQ(client.add(room.frame(at(frame), walk(10))).state, TrackState::tracked);
}

TEST(VisualSessions, survives_jumps_of_exposure) {
  VisualClient client(room.camera, 0.0, {});
  for (int i = 0; i < 40; ++i) {
    Frame frame = room.frame(at(i), walk(i));
    if (i / 4 % 2 == 1)
      for (std::uint8_t& value : frame.grey.pixels) value = static_cast<std::uint8_t>(value / 2);
    EXPECT_EQ(client.add(frame).state, TrackState::tracked) << i;
  }
  for (const PlacedFrame& placed : client.trajectory()) {
    const double number = (placed.stamp.seconds() - 100.0) * 15.0;
    EXPECT_LT((compose(walk(0), placed.map_from_camera).t - walk(number).t).norm(), 0.05);
  }
}

TEST(VisualSessions, says_that_the_depth_scale_is_wrong) {
  for (const double scale : {1.0, 1e-6}) {
    VisualClient client(room.camera, 0.0, {});
    for (int i = 0; i < 12; ++i) {
      Frame frame = room.frame(at(i), walk(i));
      frame.depth.metres_per_unit = scale;
      EXPECT_EQ(client.add(frame).state, TrackState::waiting);
    }
    EXPECT_THAT(client.notes(), testing::ElementsAre(testing::HasSubstr("check the depth scale")));
  }
}

TEST(VisualSessions, says_that_left_and_right_are_exchanged) {
  VisualClient client(room.camera, 0.12, {});
  for (int i = 0; i < 12; ++i) {
    Frame frame = room.pair(at(i), walk(i), 0.12);
    std::swap(frame.grey, frame.right);
    client.add(frame);
  }
  EXPECT_THAT(client.notes(), testing::ElementsAre(testing::HasSubstr("exchange")));
  EXPECT_THAT(client.trajectory(), testing::IsEmpty());
}

TEST(VisualSessions, does_not_use_depth_of_another_time) {
  VisualClient client(room.camera, 0.0, {});
  for (int i = 0; i < 30; ++i) {
    Frame frame = room.frame(at(i), walk(i));
    if (i >= 10) frame.depth.delay_s = 3.0;
    if (i >= 10) frame.depth.image = room.frame(at(i), walk(i + 45)).depth.image;
    client.add(frame);
  }
  EXPECT_THAT(client.notes(), testing::ElementsAre(testing::HasSubstr("check the stamps")));
  for (const PlacedFrame& placed : client.trajectory()) {
    const double number = (placed.stamp.seconds() - 100.0) * 15.0;
    EXPECT_LT((compose(walk(0), placed.map_from_camera).t - walk(number).t).norm(), 0.08);
  }
}

TEST(VisualSessions, stays_bounded_where_it_drives_again_and_again) {
  ClientOptions options;
  options.memory.keyframes = 40;
  VisualClient client(room.camera, 0.0, options);
  const auto around = [](int i) { return test::standing(0.5 * std::sin(0.1 * i), 0.5 * std::cos(0.1 * i), 0.1 * i); };
  std::size_t after_two = 0;
  for (int i = 0; i < 190; ++i) {
    EXPECT_EQ(client.add(room.frame(at(i), around(i))).state, TrackState::tracked) << i;
    EXPECT_LE(client.keyframes().size(), 41U);
    if (i == 126) after_two = client.landmarks().size();
  }
  EXPECT_LT(client.landmarks().size(), 1.3 * static_cast<double>(after_two));
  EXPECT_EQ(client.trajectory().size(), 190U) << "frames outlive their keyframes";
  for (const PlacedFrame& placed : client.trajectory()) {
    const int number = static_cast<int>(std::lround((placed.stamp.seconds() - 100.0) * 15.0));
    EXPECT_LT((compose(around(0), placed.map_from_camera).t - around(number).t).norm(), 0.05) << number;
  }
}

TEST(LiveClient, follows_and_drops_what_comes_too_fast) {
  std::vector<Frame> frames;
  for (int i = 0; i < 20; ++i) frames.push_back(room.frame(at(i), walk(i)));
  std::atomic<int> reported{0};
  test::LiveClient client(room.camera, 0.0, {}, std::nullopt,
                          [&](VisualClient&, Stamp, const Tracked&) { ++reported; });
  for (int round = 0; round < 2; ++round) client.add(frames[0]);  // may replace one another
  for (int i = 1; i < 20; ++i) {
    client.add(frames[static_cast<std::size_t>(i)]);
    std::this_thread::sleep_for(std::chrono::milliseconds(i < 10 ? 50 : 0));
  }
  const VisualClient& done = client.finish();
  EXPECT_EQ(reported + client.dropped(), 21);
  EXPECT_GE(done.trajectory().size(), 3U);
  EXPECT_EQ(done.trajectory().back().stamp, at(19)) << "the last frame is never dropped";
}

TEST(LiveClient, drops_what_waits_when_it_is_given_up) {
  std::promise<void> reports;
  std::atomic<bool> is_given_up{false};
  std::atomic<int> reported{0};
  {
    test::LiveClient client(room.camera, 0.0, {}, std::nullopt, [&](VisualClient&, Stamp, const Tracked&) {
      if (++reported > 1) return;
      reports.set_value();
      while (!is_given_up) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      std::this_thread::sleep_for(std::chrono::milliseconds(200));  // the client's end has begun meanwhile
    });
    client.add(room.frame(at(0), walk(0)));
    reports.get_future().wait();
    client.add(room.frame(at(1), walk(1)));
    is_given_up = true;
  }
  EXPECT_EQ(reported, 1);
}

}  // namespace
}  // namespace mapweave::visual
