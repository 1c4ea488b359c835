#include <mapweave/core/error.h>
#include <mapweave/matching/visual_judge.h>

#include <support/landmark_sharing.h>

#include <gmock/gmock.h>

namespace mapweave::visual {
namespace {

using test::at;
using test::error_of;
using test::place_of;
using test::SharingServer;

const test::PaintedRoom room{{4.0, 1.5, 4.0}, {240, 180, 195.0, 195.0, 119.5, 89.5}};

// Sideways along a wall at first, then around the room's middle.
Pose3 walk(int frame) {
  const double along = 0.035 * frame;
  return test::standing(-1.0 + along, -0.5 + 0.2 * std::sin(1.5 * along), 0.25 * along, 0.05 * std::sin(0.1 * frame));
}
Frame picture(int frame, const Pose3& pose) {
  Frame result = room.frame(at(frame), pose);
  result.depth = {};
  return result;
}

// A depth camera's map of the room; it began in a corner of it.
const SharingServer& server() {
  static const SharingServer server = [] {
    VisualClient client(room.camera, 0.0, {});
    for (int i = -15; i < 40; ++i) client.add(room.frame(at(i + 15), walk(i)));
    SharingServer result;
    result.learn(client, place_of("alpha"), walk(-15));
    return result;
  }();
  return server;
}

// As a server answers that knows where the camera is, about.
PlaceAnswer answer_to(const PlaceRequest& request, const Pose3& world_from_camera, const Pose3& error = {}) {
  PlaceAnswer answer;
  answer.stamp = request.stamp;
  answer.map = MapId("team");
  const Pose3 there = compose(world_from_camera, error);
  answer.map_from_robot = compose(compose(inverse(server().world_from_map), there), inverse(test::kRobotFromCamera));
  answer.landmarks = SharingServer::in_map(server().under(room.camera, world_from_camera), server().world_from_map);
  return answer;
}

ClientOptions waiting() {
  ClientOptions options;
  options.session.await_place = true;
  return options;
}

TEST(PlaceExchange, starts_a_camera_alone_at_true_scale_in_the_servers_frame) {
  VisualClient client(room.camera, 0.0, waiting());
  std::vector<Pose3> truth;
  Map published;
  int tracked_frames = 0;
  for (int i = 0; i < 90; ++i) {
    truth.push_back(walk(i));
    const Tracked tracked = client.add(picture(i, truth.back()));
    if (i < 5) {
      EXPECT_EQ(tracked.state, TrackState::waiting);
    } else if (i == 5) {
      const auto request = client.place_request(place_of("beta"));
      ASSERT_TRUE(request);
      EXPECT_EQ(request->stamp, at(5));
      EXPECT_GT(request->features.points.size(), 100U);
      EXPECT_FALSE(client.place_request(place_of("beta"))) << "once for each frame";
      EXPECT_EQ(client.place(place_of("beta"), answer_to(*request, truth.back(), test::standing(0.05, -0.06, 0.02))),
                PlaceVerdict::taken);
    } else {
      EXPECT_EQ(tracked.state, TrackState::tracked) << i;
      tracked_frames += tracked.state == TrackState::tracked;
      const Pose3 world_from_camera =
          compose(compose(server().world_from_map, test::kRobotFromCamera), tracked.map_from_camera);
      if (tracked.keyframe && i < 50)
        client.borrow(place_of("beta"), 0,
                      SharingServer::in_map(server().under(room.camera, world_from_camera), server().world_from_map));
      for (const MapUpdate& update : client.take_updates(place_of("beta"), PublishedDetail::light))
        published = updated(std::move(published), decode_map_update(encode(update), "test"));
    }
  }
  double scale = 0;
  const double error = error_of(client, truth, true, &scale);
  std::printf("scale %.4f, error %.4f m; %zu own landmarks, %zu of others\n", scale, error, client.landmarks().size(),
              client.borrowed_seen());
  EXPECT_NEAR(scale, 1.0, 0.02);
  EXPECT_LT(error, 0.03);
  EXPECT_GT(client.landmarks().size(), 100U) << "its own";
  ASSERT_EQ(client.reanchored().size(), 1U);
  EXPECT_EQ(client.reanchored()[0].map, MapId("team"));
  EXPECT_EQ(client.reanchored()[0].session, 0);
  // What it publishes lies in the frame of the map that it was answered in.
  for (const auto& [id, node] : published.nodes) {
    const auto number = static_cast<std::size_t>(std::lround((node.stamp.seconds() - 100.0) * 15.0));
    const Pose3 world_from_camera =
        compose(compose(server().world_from_map, node.map_from_node), test::kRobotFromCamera);
    EXPECT_LT((world_from_camera.t - truth[number].t).norm(), 0.08) << number;
  }
}

TEST(PlaceExchange, survives_wrong_late_and_unsound_answers) {
  VisualClient client(room.camera, 0.0, waiting());
  const auto ask = [&](int i) {
    EXPECT_EQ(client.add(picture(i, walk(i))).state, TrackState::waiting);
    return *client.place_request(place_of("beta"));
  };
  const ClientPlace place = place_of("beta");
  EXPECT_FALSE(client.place_request(place)) << "no frame yet";
  EXPECT_EQ(client.place(place, answer_to(ask(0), walk(0), test::standing(1.0, 0.0, 0.0))), PlaceVerdict::disagrees)
      << "a metre off";
  EXPECT_EQ(client.place(place, answer_to(ask(1), walk(40))), PlaceVerdict::disagrees) << "another place";
  PlaceAnswer wrong = answer_to(ask(2), walk(2));
  for (std::size_t i = 0; i < wrong.landmarks.size(); ++i)
    wrong.landmarks[i].descriptor = wrong.landmarks[(i + 7) % wrong.landmarks.size()].descriptor;
  EXPECT_EQ(client.place(place, wrong), PlaceVerdict::disagrees) << "other landmarks";
  wrong = answer_to(ask(3), walk(3));
  wrong.map_from_robot.t.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(client.place(place, wrong), PlaceVerdict::unsound);
  wrong = answer_to(ask(4), walk(4));
  wrong.map = map_of(place.client, 3);
  EXPECT_EQ(client.place(place, wrong), PlaceVerdict::unsound) << "no such session";
  wrong = answer_to(ask(5), walk(5));
  wrong.landmarks.clear();
  EXPECT_EQ(client.place(place, wrong), PlaceVerdict::unsound) << "nothing to track by";
  wrong = answer_to(ask(6), walk(6));
  wrong.stamp = at(99);
  EXPECT_EQ(client.place(place, wrong), PlaceVerdict::not_asked);
  EXPECT_EQ(client.borrowed(), 0U) << "nothing stays of it";
  EXPECT_EQ(client.add(picture(7, walk(7))).state, TrackState::waiting);
  EXPECT_THAT(client.trajectory(), testing::IsEmpty());

  const PlaceRequest first = ask(8);
  for (int i = 9; i < 13; ++i) ask(i);
  EXPECT_EQ(client.place(place, answer_to(first, walk(8))), PlaceVerdict::not_asked) << "four frames are waited for";
  const PlaceRequest late = ask(13);
  for (int i = 14; i < 18; ++i) client.add(picture(i, walk(i)));  // the answer takes a quarter of a second
  EXPECT_EQ(client.place(place, answer_to(late, walk(13))), PlaceVerdict::taken);
  EXPECT_EQ(client.place(place, answer_to(late, walk(13))), PlaceVerdict::not_asked) << "again";
  for (int i = 18; i < 30; ++i) EXPECT_EQ(client.add(picture(i, walk(i))).state, TrackState::tracked) << i;
  EXPECT_FALSE(client.place_request(place)) << "it knows";
}

TEST(PlaceExchange, brings_a_lost_client_back_into_its_map) {
  VisualClient client(room.camera, 0.0, {});
  for (int i = 0; i < 12; ++i) client.add(room.frame(at(i), walk(i)));
  // Carried to where it has not been, but others have.
  const auto there = [](int i) { return walk(i + 22); };
  ASSERT_EQ(client.add(room.frame(at(12), there(12))).state, TrackState::lost);
  const auto request = client.place_request(place_of("beta"));
  ASSERT_TRUE(request);
  PlaceAnswer answer = answer_to(*request, there(12));
  const Pose3 world_from_own = compose(walk(0), inverse(test::kRobotFromCamera));
  answer.map = map_of(place_of("beta").client, 0);
  answer.map_from_robot = compose(compose(inverse(world_from_own), there(12)), inverse(test::kRobotFromCamera));
  answer.landmarks = SharingServer::in_map(server().under(room.camera, there(12)), world_from_own);
  ASSERT_EQ(client.place(place_of("beta"), answer), PlaceVerdict::taken);
  for (int i = 13; i < 25; ++i) {
    const Tracked tracked = client.add(room.frame(at(i), there(i)));
    ASSERT_EQ(tracked.state, TrackState::tracked) << i;
    EXPECT_EQ(tracked.session, 0);
    EXPECT_LT((compose(walk(0), tracked.map_from_camera).t - there(i).t).norm(), 0.06) << i;
  }
  EXPECT_THAT(client.reanchored(), testing::IsEmpty());
  EXPECT_EQ(client.sessions(), std::vector<int>{0});
}

TEST(PlaceExchange, starts_a_sensor_of_features_that_measures_no_depth) {
  test::StarryCorridor corridor(3), again(4);
  const auto pose_of = [](int i) { return test::standing(0.3 * std::sin(0.1 * i), 0.05 * i, 0.0); };
  VisualClient mapper(corridor.camera, 0.0, {}), client(corridor.camera, 0.0, waiting());
  for (int i = 0; i < 80; ++i) mapper.add(corridor.frame(at(i), pose_of(i), 0.1, 0.0002));
  SharingServer known;
  known.learn(mapper, place_of("alpha"), pose_of(0));
  std::vector<Pose3> truth;
  for (int i = 0; i < 70; ++i) {
    truth.push_back(pose_of(i));
    FeatureFrame frame = again.frame(at(i), truth.back(), 0.3, 0.0);
    std::fill(frame.inverse_depths.begin(), frame.inverse_depths.end(), 0.0F);
    const Tracked tracked = client.add(frame);
    EXPECT_EQ(tracked.state, i == 0 ? TrackState::waiting : TrackState::tracked) << i;
    const auto shared_at = [&](const Pose3& world_from_camera) {
      return SharingServer::in_map(known.under(corridor.camera, world_from_camera), known.world_from_map);
    };
    if (i == 0) {
      const auto request = client.place_request(place_of("beta"));
      ASSERT_TRUE(request);
      PlaceAnswer answer{request->stamp, MapId("team"),
                         compose(compose(inverse(known.world_from_map), pose_of(0)), inverse(test::kRobotFromCamera)),
                         shared_at(pose_of(0))};
      ASSERT_EQ(client.place(place_of("beta"), answer), PlaceVerdict::taken);
    } else if (tracked.keyframe) {
      client.borrow(place_of("beta"), 0,
                    shared_at(compose(compose(known.world_from_map, test::kRobotFromCamera), tracked.map_from_camera)));
    }
  }
  EXPECT_LT(error_of(client, truth), 0.03);
  EXPECT_TRUE(client.landmarks().empty()) << "nothing gives it the depth of anything else";
}

}  // namespace
}  // namespace mapweave::visual
