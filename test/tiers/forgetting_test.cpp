// A camera with less room than its map takes, and a camera map server that has more.
#include <mapweave/core/error.h>
#include <support/received_updates.h>

#include <gmock/gmock.h>

namespace mapweave::tiers {
namespace {

using test::apartment;
using test::FeatureTeam;
using test::sharing;

constexpr int kRoom = 20;  // keyframes of a client

class MemoryShelf : public Shelf {
 public:
  std::uint64_t put(std::string_view bytes) override {
    if (is_full) throw Error(ErrorCode::kCannotWrite, "the disk is full (0 bytes free)", "/store", "free some space");
    kept.emplace_back(bytes);
    return kept.size() - 1;
  }
  std::string get(std::uint64_t number) const override { return kept.at(number); }
  std::vector<std::string> kept;
  bool is_full = false;
};

// One robot that drives through three rooms, with a camera that has little room.
std::unique_ptr<FeatureTeam> lone_robot(const ServerOptions& options, int room,
                                        std::shared_ptr<Shelf> shelf = nullptr) {
  auto team = std::make_unique<FeatureTeam>(apartment(1, 30.0), options);
  if (shelf) team->server.use_shelf(std::move(shelf));
  FeatureTeam::Robot& robot = team->robots.front();
  robot.options.memory.keyframes = room;
  robot.client.emplace(robot.camera, 0.0, robot.options, matching::shipped_vocabulary());
  return team;
}

SessionId session_of(const FeatureTeam& team) { return *team.robots.front().client->run(team.robots.front().place); }

// The client's own map, made whole by what the server kept.
Map whole_map(const FeatureTeam& team, std::size_t* added = nullptr) {
  const FeatureTeam::Robot& robot = team.robots.front();
  Map own = robot.client->maps(robot.place).front();
  const std::size_t count =
      add_forgotten(own, team.server.kept_for(session_of(team)), robot.client->forgotten_keyframes(robot.place));
  if (added != nullptr) *added = count;
  return own;
}

// A keyframe that the client made and forgot between two updates was never sent.
bool are_nearly_all(std::size_t added, std::size_t forgotten) {
  return added <= forgotten && forgotten - added <= 1 + forgotten / 50;
}

double error_of(const FeatureTeam& team, const Map& map) {
  fusion::Component component;
  component.map = map;
  return team.error_m(component);
}

TEST(Forgetting, server_keeps_what_a_lone_client_has_no_room_for_and_shares_it_again) {
  const auto team = lone_robot(sharing(Sharing::view), kRoom);
  team->run();
  const FeatureTeam::Robot& robot = team->robots.front();
  std::size_t added = 0;
  const Map whole = whole_map(*team, &added);
  std::printf(
      "client: %zu keyframes, forgot %zu; whole map: %zu keyframes, %zu landmarks; %zu of its own borrowed again\n",
      robot.client->keyframes().size(), robot.client->forgotten(), whole.nodes.size(), whole.landmarks.size(),
      robot.borrowed_seen);
  EXPECT_LE(robot.client->keyframes().size(), static_cast<std::size_t>(kRoom));
  EXPECT_GT(robot.client->forgotten(), 20U);
  EXPECT_TRUE(are_nearly_all(added, robot.client->forgotten()));
  EXPECT_EQ(whole.nodes.size(), robot.client->keyframes().size() + added);
  EXPECT_GT(robot.borrowed_seen, 20U);
  EXPECT_LT(robot.error_m(), 0.05);
  EXPECT_LT(error_of(*team, whole), 0.05);
  for (const auto& [id, landmark] : whole.landmarks)
    for (const LandmarkSighting& sighting : landmark.seen) ASSERT_TRUE(whole.nodes.contains(sighting.node));
  EXPECT_EQ(encode(difference(Map{}, whole)), encode(decode_map_update(encode(difference(Map{}, whole)), "test")));
}

TEST(Forgetting, what_a_server_keeps_goes_over_a_wire_in_parts) {
  constexpr std::size_t kMost = std::size_t{48} << 10;
  const auto team = lone_robot(sharing(Sharing::view), kRoom);
  team->run();
  const FeatureTeam::Robot& robot = team->robots.front();
  const auto placed = robot.client->forgotten_keyframes(robot.place);
  const std::vector<KeptMap> kept = team->server.kept_to_read(session_of(*team))();
  ASSERT_EQ(kept.size(), 1U);
  const std::vector<std::string> parts = encoded_in_parts(kept.front(), kMost);
  EXPECT_GT(parts.size(), 3U);
  KeptParts here(session_of(*team), placed);
  const std::vector<Receipt> all{{{{}, kept.front().map.id}, parts.size()}};
  EXPECT_TRUE(here.is_whole({}));
  here.add(parts.back(), "test");  // before it is due
  for (const std::string& part : parts) {
    EXPECT_LE(part.size(), kMost);
    EXPECT_FALSE(here.is_whole(all));
    here.add(part, "test");
    here.add(parts.front(), "test");  // again
  }
  EXPECT_TRUE(here.is_whole(all));
  EXPECT_EQ(here.receipts().front().stored, parts.size());
  Map own = robot.client->maps(robot.place).front();
  EXPECT_GT(add_forgotten(own, here.take(), placed), 20U);
  EXPECT_EQ(encode(difference(Map{}, own)), encode(difference(Map{}, whole_map(*team))));

  const SessionId stranger{{RobotId("beta"), SensorId("front")}, 6};
  EXPECT_THROW(KeptParts(stranger, placed).add(parts.front(), "test"), Error);
  EXPECT_THROW(here.add("no part", "test"), Error);
  KeptParts forgot_nothing(session_of(*team), {});
  for (const std::string& part : parts) forgot_nothing.add(part, "test");
  for (const KeptMap& none : forgot_nothing.take()) EXPECT_TRUE(none.map.empty()) << "it asked for nothing";
}

TEST(Forgetting, client_with_room_says_what_it_said_before) {
  const auto team = lone_robot(sharing(Sharing::view), 500);
  std::size_t forgotten = 0;
  team->overheard = [&](const FeatureTeam::Robot&, const std::string& bytes) {
    const MapUpdate update = decode_map_update(bytes, "test");
    forgotten += update.forgotten_nodes.size() + update.forgotten_landmarks.size();
  };
  team->run();
  EXPECT_EQ(forgotten, 0U);
  EXPECT_EQ(team->robots.front().client->forgotten(), 0U);
  EXPECT_EQ(team->robots.front().borrowed_seen, 0U);
  EXPECT_TRUE(team->server.kept_for(session_of(*team)).empty());
}

TEST(Forgetting, keeps_on_the_disk_what_the_server_has_no_room_for) {
  ServerOptions options = sharing(Sharing::view);
  const auto in_memory = lone_robot(options, kRoom);
  in_memory->run();
  options.keyframes = 30;
  const auto shelf = std::make_shared<MemoryShelf>();
  const auto on_disk = lone_robot(options, kRoom, shelf);
  on_disk->run();
  EXPECT_GT(shelf->kept.size(), 1U);
  std::size_t added = 0;
  whole_map(*on_disk, &added);
  EXPECT_TRUE(are_nearly_all(added, on_disk->robots.front().client->forgotten()));
  EXPECT_FALSE(on_disk->server.keeping_trouble());

  // Another server that is given all of it keeps all of it.
  VisualServer other(TierId("edge"), options, {});
  other.use_shelf(std::make_shared<MemoryShelf>());
  for (auto& [session, update] : on_disk->server.snapshot()) {
    other.greet(test::hello_of(session));
    other.receive(session, update);
  }
  const auto maps = on_disk->server.maps(), copied = other.maps();
  ASSERT_EQ(maps.size(), copied.size());
  EXPECT_EQ(encode(difference(Map{}, maps.front())), encode(difference(Map{}, copied.front())));
  const auto kept = on_disk->server.kept_for(session_of(*on_disk)), again = other.kept_for(session_of(*on_disk));
  ASSERT_EQ(kept.size(), 1U);
  ASSERT_EQ(again.size(), 1U);
  EXPECT_EQ(kept.front().forgotten_nodes, again.front().forgotten_nodes);
}

TEST(Forgetting, loses_nothing_where_the_disk_is_full_and_says_so) {
  ServerOptions options = sharing(Sharing::view);
  options.keyframes = 30;
  const auto shelf = std::make_shared<MemoryShelf>();
  shelf->is_full = true;
  const auto team = lone_robot(options, kRoom, shelf);
  team->run();
  ASSERT_TRUE(team->server.keeping_trouble());
  EXPECT_THAT(*team->server.keeping_trouble(),
              testing::AllOf(testing::HasSubstr("the disk is full"), testing::HasSubstr("server.keyframes=30")));
  std::size_t added = 0;
  whole_map(*team, &added);
  EXPECT_TRUE(are_nearly_all(added, team->robots.front().client->forgotten()));
  EXPECT_EQ(team->robots.front().lost, 0);
}

TEST(Forgetting, goes_on_with_a_server_that_forgets_too) {
  ServerOptions options = sharing(Sharing::full);
  options.keyframes = 25;
  const auto team = lone_robot(options, kRoom);
  team->run();
  ASSERT_TRUE(team->server.keeping_trouble());
  EXPECT_THAT(*team->server.keeping_trouble(), testing::HasSubstr("forgot"));
  std::size_t added = 0;
  const Map whole = whole_map(*team, &added);
  EXPECT_LT(added, team->robots.front().client->forgotten());
  EXPECT_GT(whole.nodes.size(), static_cast<std::size_t>(kRoom));
  EXPECT_LT(team->robots.front().error_m(), 0.05);
}

TEST(Forgetting, client_begins_again_with_a_server_that_has_nothing_of_it) {
  const auto team = lone_robot(sharing(Sharing::view), kRoom);
  for (int round = 0; round < 40; ++round) team->round();
  FeatureTeam::Robot& robot = team->robots.front();
  robot.agent->reconnected(*robot.client, {});
  VisualServer empty(TierId("edge"), {}, {});
  empty.greet(test::hello_of(session_of(*team)));
  for (const transport::Envelope& update : robot.agent->updates(*robot.client, team->now()))
    robot.agent->stored(empty.receive(session_of(*team), update.bytes).receipt);
  EXPECT_EQ(empty.maps().front().nodes.size(), robot.client->keyframes().size());
  EXPECT_TRUE(empty.kept_for(session_of(*team)).empty());
}

TEST(Forgetting, refuses_to_forget_what_is_of_others) {
  VisualServer server(TierId("edge"), {}, {});
  const SessionId own{{RobotId("alpha"), SensorId("front")}, 5}, other{{RobotId("beta"), SensorId("front")}, 6};
  server.greet(test::hello_of(own));
  MapUpdate update;
  update.origin = {TierId(), visual::map_of(own.client, 0)};
  update.sequence = 1;
  update.forgotten_nodes = {{other, 3}};
  EXPECT_THROW(server.receive(own, encode(update)), Error);
  update.forgotten_nodes = {{own, 3}};
  server.receive(own, encode(update));
  EXPECT_TRUE(server.kept_for(own).empty()) << "it knows no such keyframe";
}

}  // namespace
}  // namespace mapweave::tiers
