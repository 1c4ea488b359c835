#include <mapweave/core/error.h>

#include <support/landmark_sharing.h>

#include <gmock/gmock.h>

#include <functional>

namespace mapweave::visual {
namespace {

using test::at;
using test::error_of;
using test::place_of;
using test::SharingServer;
using test::StarryCorridor;

Pose3 along(double path_m) {
  return {{0.5 * std::sin(0.4 * path_m), 0.2 * std::sin(0.7 * path_m), path_m},
          Eigen::Quaterniond(Eigen::AngleAxisd(0.15 * std::sin(0.5 * path_m), Eigen::Vector3d::UnitY()))};
}
constexpr double kStep_m = 0.06;
constexpr int kFrames = 400;

// A good camera's map of the corridor.
const SharingServer& server() {
  static const SharingServer server = [] {
    StarryCorridor corridor(1);
    VisualClient client(corridor.camera, 0.0, {});
    for (int i = 0; i < kFrames + 40; ++i) client.add(corridor.frame(at(i), along(kStep_m * i), 0.1, 0.0002));
    SharingServer result;
    result.learn(client, place_of("alpha"), along(0.0));
    return result;
  }();
  return server;
}

struct Drive {
  StarryCorridor corridor{2};
  VisualClient client;
  std::vector<Pose3> truth;
  Map published;
  std::size_t borrowed_seen = 0;
  explicit Drive(ClientOptions options = {}) : client(corridor.camera, 0.0, options) {}

  Pose3 world_from_map() const { return compose(truth.front(), inverse(test::kRobotFromCamera)); }
  // A poor camera: `share` is called after each keyframe with where the client thinks that its camera is in the world.
  template <class Share>
  void run(int frames, const Share& share) {
    for (int i = static_cast<int>(truth.size()); i < frames; ++i) {
      truth.push_back(along(kStep_m * i));
      const Tracked tracked = client.add(corridor.frame(at(i), truth.back(), 0.7, 0.01, 0.004));
      ASSERT_EQ(tracked.state, TrackState::tracked) << i;
      if (!tracked.keyframe) continue;
      for (const MapUpdate& update : client.take_updates(place_of("beta"), PublishedDetail::light)) {
        published = updated(std::move(published), decode_map_update(encode(update), "test"));
        for (const LandmarkChange& change : update.borrowed) {
          EXPECT_EQ(change.id.session.client.robot, RobotId("alpha"));
          for (const LandmarkSighting& sighting : change.seen)
            EXPECT_EQ(sighting.node.session.client.robot, RobotId("beta"));
          borrowed_seen += change.seen.size();
        }
      }
      share(compose(truth.front(), tracked.map_from_camera));
    }
  }
};

TEST(Borrowing, keeps_a_client_from_drifting) {
  ClientOptions options;
  options.window.learn_depth_offset = false;
  Drive alone(options), helped(options);
  alone.run(kFrames, [](const Pose3&) {});
  helped.run(kFrames, [&](const Pose3& world_from_camera) {
    helped.client.borrow(
        place_of("beta"), 0,
        SharingServer::in_map(server().under(helped.corridor.camera, world_from_camera), helped.world_from_map()));
  });
  const double without = error_of(alone.client, alone.truth), with = error_of(helped.client, helped.truth);
  std::printf("error %.3f m alone, %.3f m with shared landmarks\n", without, with);
  EXPECT_LT(with, 0.4 * without);
  EXPECT_LT(with, 0.06);
  EXPECT_GT(helped.borrowed_seen, 1000U);
  EXPECT_EQ(alone.borrowed_seen, 0U);
}

TEST(Borrowing, publishes_no_landmark_of_others_as_its_own) {
  Drive drive;
  drive.run(60, [&](const Pose3& world_from_camera) {
    drive.client.borrow(
        place_of("beta"), 0,
        SharingServer::in_map(server().under(drive.corridor.camera, world_from_camera), drive.world_from_map()));
  });
  EXPECT_GT(drive.client.borrowed_seen(), 30U);
  EXPECT_GT(drive.borrowed_seen, 100U);
  drive.client.finish();
  for (const MapUpdate& update : drive.client.take_updates(place_of("beta"), PublishedDetail::exact))
    drive.published = updated(std::move(drive.published), update);
  EXPECT_EQ(drive.published.landmarks.size(), drive.client.landmarks().size());
  for (const auto& [id, landmark] : drive.published.landmarks) {
    EXPECT_EQ(id.session.client.robot, RobotId("beta"));
    for (const LandmarkSighting& sighting : landmark.seen)
      EXPECT_EQ(sighting.node.session.client.robot, RobotId("beta"));
  }
}

TEST(Borrowing, is_not_led_astray_by_landmarks_that_lie) {
  Drive alone;
  alone.run(200, [](const Pose3&) {});
  const double without = error_of(alone.client, alone.truth);
  // Each somewhere else, or all moved by the same.
  for (const bool together : {false, true}) {
    Drive drive;
    std::mt19937_64 random(3);
    const auto noise = [&] { return static_cast<double>(random() >> 11) * 0x1.0p-53 - 0.5; };
    drive.run(200, [&](const Pose3& world_from_camera) {
      auto borrowed =
          SharingServer::in_map(server().under(drive.corridor.camera, world_from_camera), drive.world_from_map());
      for (DescribedLandmark& one : borrowed)
        one.point_in_map += together ? Eigen::Vector3d(0.0, 0.25, 0.1) : Eigen::Vector3d(noise(), noise(), noise());
      drive.client.borrow(place_of("beta"), 0, borrowed);
    });
    const double with = error_of(drive.client, drive.truth);
    std::printf("error %.3f m alone, %.3f m with lies; %zu of %zu seen\n", without, with, drive.client.borrowed_seen(),
                drive.client.borrowed());
    EXPECT_LT(with, 1.3 * without + 0.01);
  }
}

TEST(Borrowing, refuses_what_is_no_landmark_and_sessions_that_are_not) {
  Drive drive;
  const DescribedLandmark good = server().under(drive.corridor.camera, along(0.0)).front();
  EXPECT_EQ(drive.client.borrow(place_of("beta"), 0, {good}), 0) << "it has not begun";
  drive.run(20, [](const Pose3&) {});
  EXPECT_EQ(drive.client.borrow(place_of("beta"), 1, {good}), 0);
  EXPECT_EQ(drive.client.borrow(place_of("beta"), -1, {good}), 0);
  std::vector<DescribedLandmark> bad(5, good);
  bad[0].point_in_map.x() = std::numeric_limits<double>::quiet_NaN();
  bad[1].point_in_map.y() = 1e300;
  bad[2].direction = {3, 4, 5};
  bad[3].sigma_m = -1.0;
  bad[4].feature_from_point.z() = std::numeric_limits<double>::infinity();
  EXPECT_EQ(drive.client.borrow(place_of("beta"), 0, bad), 0);
  EXPECT_EQ(drive.client.borrowed(), 0U);
  bad.push_back(good);
  bad.push_back(good);
  bad.back().id.session = {place_of("beta").client, at(0).ns};  // its own
  EXPECT_EQ(drive.client.borrow(place_of("beta"), 0, bad), 1);
  EXPECT_EQ(drive.client.borrowed(), 1U);
  drive.run(60, [](const Pose3&) {});
}

TEST(Borrowing, holds_no_more_than_it_needs) {
  Drive drive;
  drive.run(20, [](const Pose3&) {});
  std::vector<DescribedLandmark> flood(20000, server().under(drive.corridor.camera, along(0.0)).front());
  for (std::uint32_t i = 0; i < flood.size(); ++i) {
    flood[i].id.index = i;
    flood[i].point_in_map.x() = -500.0 - i;
  }
  drive.client.borrow(place_of("beta"), 0, flood);
  EXPECT_LE(drive.client.borrowed(), 3000U);
  drive.run(320, [](const Pose3&) {});
  EXPECT_EQ(drive.client.borrowed(), 0U) << "out of view for long";
}

TEST(Borrowing, gives_the_same_numbers_every_time) {
  const auto run = [] {
    Drive drive;
    drive.run(80, [&](const Pose3& world_from_camera) {
      auto borrowed =
          SharingServer::in_map(server().under(drive.corridor.camera, world_from_camera), drive.world_from_map());
      drive.client.borrow(place_of("beta"), 0, borrowed);
    });
    std::vector<double> numbers;
    for (const PlacedFrame& frame : drive.client.trajectory())
      for (int k = 0; k < 3; ++k) numbers.push_back(frame.map_from_camera.t[k]);
    return numbers;
  };
  EXPECT_EQ(run(), run());
}

// Pictures: one client maps a room with a good depth camera, others borrow from it.
const test::PaintedRoom room{{4.0, 1.5, 4.0}, {240, 180, 195.0, 195.0, 119.5, 89.5}};
constexpr int kRoomFrames = 100;

Pose3 walk(double frame) {
  return test::standing(1.2 * std::sin(0.03 * frame), 1.2 - 1.2 * std::cos(0.03 * frame), 0.03 * frame,
                        0.1 * std::sin(0.1 * frame));
}

struct RoomMap {
  SharingServer server;
  double error_m = 0.0;
};
const RoomMap& room_map() {
  static const RoomMap known = [] {
    VisualClient client(room.camera, 0.0, {});
    std::vector<Pose3> truth;
    for (int i = -20; i < kRoomFrames + 20; ++i) {
      truth.push_back(walk(i));
      client.add(room.frame(at(i + 20), truth.back()));
    }
    RoomMap result;
    result.server.learn(client, place_of("alpha"), truth.front());
    result.error_m = error_of(client, truth);
    return result;
  }();
  return known;
}

enum class Camera { depth, pair, alone };
// How a client measures scale.
struct Measuring {
  Camera camera;
  double too_near_per_m = 0.0;  // what its depths' inverses are too large by
  double baseline_share = 1.0;  // what it believes of its baseline, of what that is
};
constexpr double kBaseline_m = 0.05;

struct Walked {
  double error_m = 0.0;
  std::size_t borrowed_seen = 0;
};
// Grey values are noisy, differently for each seed.
Walked walk_about(const Measuring& measuring, bool is_helped, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const bool is_pair = measuring.camera == Camera::pair;
  VisualClient client(room.camera, is_pair ? measuring.baseline_share * kBaseline_m : 0.0, {});
  std::vector<Pose3> truth;
  for (int i = 0; i < kRoomFrames; ++i) {
    truth.push_back(walk(i));
    Frame frame = is_pair ? room.pair(at(i), truth.back(), kBaseline_m) : room.frame(at(i), truth.back());
    if (measuring.camera == Camera::alone) {
      frame.depth = {};
      frame.odometry_from_camera = truth.back();
    }
    for (std::uint16_t& depth : frame.depth.image.pixels)
      depth = static_cast<std::uint16_t>(1000.0 / (1000.0 / depth + measuring.too_near_per_m));
    for (std::uint8_t& grey : frame.grey.pixels)
      grey = static_cast<std::uint8_t>(std::clamp<int>(grey + static_cast<int>(random() % 9) - 4, 0, 255));
    const Tracked tracked = client.add(frame);
    if (!is_helped || !tracked.keyframe) continue;
    const auto first = std::lround((client.keyframes().front().stamp.seconds() - 100.0) * 15.0);
    const Pose3 start = truth[static_cast<std::size_t>(first)];
    const Pose3 world_from_map = compose(start, inverse(test::kRobotFromCamera));
    client.borrow(place_of("beta"), 0,
                  SharingServer::in_map(room_map().server.under(room.camera, compose(start, tracked.map_from_camera)),
                                        world_from_map));
  }
  EXPECT_GT(client.trajectory().size(), 80U);
  return {error_of(client, truth), client.borrowed_seen()};
}

void compare(const Measuring& measuring, const std::function<void(double with, double without)>& expect) {
  for (const std::uint64_t seed : {1U, 2U}) {
    const Walked with = walk_about(measuring, true, seed), without = walk_about(measuring, false, seed);
    std::printf("camera %d: error %.4f m alone, %.4f m with shared landmarks, of which %zu are seen\n",
                static_cast<int>(measuring.camera), without.error_m, with.error_m, with.borrowed_seen);
    expect(with.error_m, without.error_m);
    EXPECT_GT(with.borrowed_seen, 60U);
    EXPECT_EQ(without.borrowed_seen, 0U);
  }
}

TEST(Borrowing, keeps_clients_that_measure_scale_badly_from_drifting) {
  for (const Measuring& measuring :
       {Measuring{Camera::depth, 0.03, 1.0}, Measuring{Camera::pair, 0.0, 1.05}, Measuring{Camera::alone}})
    compare(measuring, [](double with, double without) {
      EXPECT_LT(with, 0.5 * without);
      EXPECT_LT(with, 4.0 * room_map().error_m);
    });
}

TEST(Borrowing, costs_clients_that_measure_as_well_as_the_owner_no_more_than_its_map_errs) {
  for (const Measuring& measuring : {Measuring{Camera::depth, 0.008, 1.0}, Measuring{Camera::pair}})
    compare(measuring, [](double with, double without) { EXPECT_LT(with, without + room_map().error_m); });
}

}  // namespace
}  // namespace mapweave::visual
