#include <mapweave/visual/visual_client.h>
#include <support/painted_room.h>

#include <gmock/gmock.h>

namespace mapweave::visual {
namespace {

const test::PaintedRoom room{{4.0, 1.5, 4.0}, {240, 180, 195.0, 195.0, 119.5, 89.5}};
const ClientPlace kPlace{{RobotId("alpha"), SensorId("front")},
                         {{0.1, 0.0, 0.4}, Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5)}};

Stamp at(int frame) { return stamp_from_seconds(100.0 + frame / 15.0); }

Pose3 walk(double frame) {
  return test::standing(0.8 * std::sin(0.05 * frame), 0.8 - 0.8 * std::cos(0.05 * frame), 0.04 * frame,
                        0.1 * std::sin(0.1 * frame));
}

// What a server holds after each of the updates, as bytes went over a wire.
Map received(Map map, const std::vector<MapUpdate>& updates) {
  for (const MapUpdate& update : updates) {
    map.id = update.origin.map;
    map = updated(std::move(map), decode_map_update(encode(update), "test"));
  }
  return map;
}

TEST(MapPublisher, publishes_all_that_the_client_knows) {
  VisualClient client(room.camera, 0.0, {});
  Map server;
  std::uint64_t sequence = 0;
  for (int i = 0; i < 60; ++i) {
    const Tracked tracked = client.add(room.frame(at(i), walk(i)));
    if (!tracked.keyframe) continue;
    const auto updates = client.take_updates(kPlace, PublishedDetail::light);
    ASSERT_EQ(updates.size(), 1U);
    EXPECT_EQ(updates[0].origin.map, MapId("alpha.front"));
    EXPECT_EQ(updates[0].base, sequence);
    EXPECT_EQ(updates[0].sequence, ++sequence);
    server = received(std::move(server), updates);
  }
  client.finish();
  server = received(std::move(server), client.take_updates(kPlace, PublishedDetail::exact));

  const auto keyframes = client.keyframes();
  ASSERT_EQ(server.nodes.size(), keyframes.size());
  std::size_t i = 0;
  for (const auto& [id, node] : server.nodes) {
    EXPECT_EQ(node.stamp, keyframes[i].stamp);
    const Pose3 expected =
        compose(compose(kPlace.robot_from_camera, keyframes[i].map_from_camera), inverse(kPlace.robot_from_camera));
    EXPECT_EQ(node.map_from_node.t, expected.t) << "exact in the end";
    ASSERT_TRUE(node.payload);
    EXPECT_GT(std::get<KeyframeFeatures>(*node.payload).points.size(), 50U);
    ++i;
  }
  EXPECT_EQ(server.landmarks.size(), client.landmarks().size());
  // They lie on the walls, where the room is seen from the robot's first pose.
  const Pose3 room_from_map = compose(walk(0), inverse(kPlace.robot_from_camera));
  for (const auto& [id, landmark] : server.landmarks) {
    const Eigen::Vector3d in_map =
        transformed(landmark.point_in_anchor(), server.nodes.find(landmark.anchor)->map_from_node);
    EXPECT_LT((transformed(in_map, room_from_map).cwiseAbs() - room.half).maxCoeff(), 0.2) << to_string(id);
    EXPECT_FALSE(landmark.seen.empty());
    EXPECT_EQ(landmark.colour[0], landmark.colour[1]) << "grey pictures";
  }
}

TEST(MapPublisher, publishes_features_once_and_then_what_moved) {
  VisualClient client(room.camera, 0.0, {});
  int keyframes = 0;
  std::size_t published = 0, first_bytes = 0;
  for (int i = 0; i < 60; ++i) {
    if (!client.add(room.frame(at(i), walk(i))).keyframe) continue;
    ++keyframes;
    const auto updates = client.take_updates(kPlace, PublishedDetail::light);
    ASSERT_EQ(updates.size(), 1U);
    published += updates[0].nodes.size();
    if (keyframes == 1) first_bytes = encode(updates[0]).size();
    EXPECT_LE(updates[0].nodes.size(), 1U) << "the new keyframe alone";
  }
  ASSERT_GT(keyframes, 3);
  EXPECT_EQ(published, static_cast<std::size_t>(keyframes));
  EXPECT_GT(first_bytes, 2000U);
  EXPECT_TRUE(client.take_updates(kPlace, PublishedDetail::light).empty()) << "nothing is new";
}

TEST(MapPublisher, says_what_it_has_forgotten_and_takes_back_what_is_gone) {
  ClientOptions options;
  options.memory.keyframes = 20;
  VisualClient client(room.camera, 0.0, options);
  Map server;
  std::set<NodeId> forgotten;
  const auto receive = [&](const std::vector<MapUpdate>& updates) {
    for (const MapUpdate& update : updates)
      forgotten.insert(update.forgotten_nodes.begin(), update.forgotten_nodes.end());
    server = received(std::move(server), updates);
  };
  for (int i = 0; i < 400; ++i) {
    const Tracked tracked = client.add(room.frame(at(i), test::standing(0.5 * std::sin(0.03 * i), 0.0, 0.11 * i, 0.0)));
    ASSERT_NE(tracked.state, TrackState::waiting);
    if (i % 50 == 49) receive(client.take_updates(kPlace, PublishedDetail::light));
  }
  receive(client.take_updates(kPlace, PublishedDetail::exact));
  EXPECT_LE(client.keyframes().size(), 20U);
  EXPECT_GT(forgotten.size(), 20U);
  EXPECT_EQ(server.nodes.size(), client.keyframes().size() + forgotten.size()) << "the server keeps what is forgotten";
  EXPECT_GT(server.landmarks.size(), client.landmarks().size());
}

}  // namespace
}  // namespace mapweave::visual
