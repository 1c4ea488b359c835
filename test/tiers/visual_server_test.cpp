#include <mapweave/core/error.h>
#include <support/received_updates.h>

#include <support/landmark_sharing.h>

#include <gmock/gmock.h>

namespace mapweave::tiers {
namespace {

using simulation::PlanKind;
using test::camera_world;
using test::FeatureTeam;
using test::sharing;

using test::two_in_an_apartment;

// The apartment seen at once by two, once for all tests that look at what came of it.
FeatureTeam& apartment() {
  static FeatureTeam* const team = [] {
    auto* result = new FeatureTeam(two_in_an_apartment(), sharing(Sharing::view));
    result->run();
    return result;
  }();
  return *team;
}

std::string sealed_bytes(const fusion::FusionResult& sealed) {
  std::string bytes;
  for (const auto& component : sealed.components) bytes += encode(difference(Map{}, component.map));
  return bytes;
}

TEST(VisualServer, merges_what_its_clients_publish_and_shares_it_with_them) {
  FeatureTeam& team = apartment();
  ASSERT_EQ(team.server.merged().components.size(), 1U);
  for (const auto& robot : team.robots) {
    std::printf("%s: error %.4f m, %zu borrowed landmarks seen; sent %.1f kB, received %.1f kB in %.0f s\n",
                robot.place.client.robot.str().c_str(), robot.error_m(), robot.borrowed_seen,
                1e-3 * static_cast<double>(robot.agent->sent_bytes()),
                1e-3 * static_cast<double>(robot.agent->received_bytes()), static_cast<double>(robot.next) / 12.0);
    EXPECT_LT(robot.error_m(), 0.05);
    EXPECT_EQ(robot.agent->waiting_bytes(), 0U);
  }
  EXPECT_GT(team.robots[0].borrowed_seen + team.robots[1].borrowed_seen, 100U);
  EXPECT_LT(team.error_m(team.server.merged().components.front()), 0.05);
}

TEST(VisualServer, begins_with_the_map_of_a_session_before) {
  Map before;
  for (Map& map : apartment().server.maps())
    if (map.robots().front() == RobotId("alpha")) before = std::move(map);
  ASSERT_FALSE(before.empty());
  auto options = two_in_an_apartment();
  options.robots.erase(options.robots.begin());
  for (const bool begins_with_map : {false, true}) {
    FeatureTeam lone(options, sharing(Sharing::view));
    if (begins_with_map) lone.server.begin_with({before, Map{}});
    lone.run();
    EXPECT_EQ(lone.server.maps().size(), begins_with_map ? 2U : 1U);
    EXPECT_EQ(lone.robots[0].borrowed_seen > 20, begins_with_map) << lone.robots[0].borrowed_seen;
    EXPECT_LT(lone.robots[0].error_m(), 0.05);
    ASSERT_EQ(lone.server.merged().components.size(), 1U) << "joined while it drives";
    EXPECT_EQ(lone.server.merged().components.front().members.size(), begins_with_map ? 2U : 1U);
    std::size_t of_clients = 0;
    for (const auto& [from, update] : lone.server.snapshot()) of_clients += from.client == lone.robots[0].place.client;
    EXPECT_EQ(lone.server.snapshot().size(), of_clients) << "what it began with is no client's";
  }
}

TEST(VisualServer, takes_nothing_from_the_map_of_another_building) {
  auto options = camera_world(PlanKind::apartment, 19, 1);
  options.robots[0].id = "before";
  options.robots[0].length_m = 10.0;
  FeatureTeam elsewhere(options, sharing(Sharing::none));
  elsewhere.robots[0].shoot = test::in_other_looks(elsewhere.robots[0].shoot);
  elsewhere.run();
  options = two_in_an_apartment();
  options.robots.resize(1);
  options.robots[0].length_m = 10.0;
  std::map<bool, std::string> published;
  for (const bool begins_with_map : {false, true}) {
    FeatureTeam lone(options, sharing(Sharing::global));
    if (begins_with_map) lone.server.begin_with(elsewhere.server.maps());
    lone.run();
    EXPECT_EQ(lone.robots[0].borrowed_seen, 0U);
    EXPECT_TRUE(lone.robots[0].client->shared_keyframes().empty());
    EXPECT_EQ(lone.server.merged().components.size(), begins_with_map ? 2U : 1U);
    for (const Map& map : lone.robots[0].client->maps(lone.robots[0].place))
      published[begins_with_map] += encode(difference(Map{}, map));
    if (!begins_with_map) continue;
    for (const Verdict& verdict : lone.server.merged().verdicts) EXPECT_NE(verdict.decision, Decision::accepted);
  }
  EXPECT_EQ(published[true], published[false]) << "the client's map is as without";
}

TEST(VisualServer, knows_a_picture_again_by_a_map_of_a_session_before) {
  Map before;
  for (Map& map : apartment().server.maps())
    if (map.robots().front() == RobotId("alpha")) before = std::move(map);
  const auto& [id, node] = before.nodes.begin()[static_cast<std::ptrdiff_t>(before.nodes.size() / 2)];
  VisualServer server(TierId("edge"), sharing(Sharing::view), {});
  server.begin_with({before});
  WorkerPool pool(1);
  server.advance(node.stamp, pool);  // the first merge begins
  server.advance({node.stamp.ns + 5'000'000'000}, pool);
  const SessionId lost{{RobotId("beta"), SensorId("front")}, 7};
  server.greet(test::hello_of(lost));
  PlaceRequest request;
  request.stamp = node.stamp;
  request.features = *keyframe_of(node);
  const auto place = server.place(lost, request, pool);
  ASSERT_TRUE(place);
  EXPECT_EQ(place->map, before.id);
  EXPECT_LT((place->map_from_robot.t - node.map_from_node.t).norm(), 0.1);
  EXPECT_GT(place->landmarks.size(), 20U);
}

TEST(VisualServer, joins_step_by_step_about_as_it_seals) {
  VisualServer& server = apartment().server;
  WorkerPool pool(1);
  const auto sealed = server.seal(pool, *make_silent_progress());
  ASSERT_EQ(sealed.components.size(), 1U);
  std::vector<matching::PointPair> pairs;
  for (const auto& [id, node] : server.merged().components.front().map.nodes)
    if (const Node* other = sealed.components.front().map.nodes.find(id))
      pairs.push_back({node.map_from_node.t, other->map_from_node.t});
  ASSERT_GT(pairs.size(), 50U);
  std::printf("steps end %.4f m from the seal; errors %.4f m, %.4f m\n", FeatureTeam::laid(pairs),
              apartment().error_m(server.merged().components.front()), apartment().error_m(sealed.components.front()));
  EXPECT_LT(FeatureTeam::laid(pairs), 0.03);
  VisualServer at_once(TierId("edge"), {}, {});
  for (auto& [session, update] : server.snapshot()) {
    at_once.greet(test::hello_of(session));
    at_once.receive(session, update);
  }
  EXPECT_EQ(sealed_bytes(sealed), sealed_bytes(at_once.seal(pool, *make_silent_progress())))
      << "a seal knows nothing of the steps";
}

TEST(VisualServer, has_every_map_as_its_client_has_it) {
  for (auto& robot : apartment().robots) {
    Map whole;
    visual::VisualClient& client = *robot.client;
    const auto maps = apartment().server.maps();
    const auto published = std::find_if(
        maps.begin(), maps.end(), [&](const Map& map) { return map.id == visual::map_of(robot.place.client, 0); });
    ASSERT_NE(published, maps.end());
    std::size_t keyframes = 0;
    for (const visual::PlacedFrame& frame : client.keyframes()) keyframes += frame.session == 0;
    EXPECT_EQ(published->nodes.size(), keyframes);
    for (const auto& [id, node] : published->nodes) EXPECT_EQ(id.session, *client.run(robot.place));
    for (const auto& [id, landmark] : published->landmarks) EXPECT_EQ(id.session, *client.run(robot.place));
  }
}

using test::hello_of;
using test::received_updates;
using test::ReceivedUpdate;
using test::sealed;

TEST(VisualServer, seals_the_same_whatever_order_updates_come_in) {
  VisualServer in_order(TierId("edge"), {}, {}), shuffled(TierId("edge"), {}, {});
  std::vector<ReceivedUpdate> mixed = received_updates();
  ASSERT_GT(mixed.size(), 8U);
  for (std::size_t i = 0; i + 3 < mixed.size(); i += 4) std::swap(mixed[i], mixed[i + 3]);
  mixed.insert(mixed.end(), received_updates().begin(), received_updates().begin() + 5);
  for (VisualServer* server : {&in_order, &shuffled}) {
    std::uint64_t awaited = 0;
    for (const ReceivedUpdate& one : server == &in_order ? received_updates() : mixed) {
      server->greet(hello_of(one.from));
      const auto received = server->receive(one.from, one.bytes);
      awaited = std::max(awaited, received.receipt.awaited);
      for (const std::string& stored : received.stored)
        EXPECT_TRUE(std::any_of(received_updates().begin(), received_updates().end(),
                                [&](const ReceivedUpdate& published) { return published.bytes == stored; }));
    }
    EXPECT_EQ(awaited > 0, server == &shuffled) << "a gap is noticed";
  }
  const std::string bytes = sealed(in_order);
  EXPECT_EQ(bytes, sealed(shuffled));
  EXPECT_EQ(bytes, sealed(in_order, 2));
}

// The same bytes, with NaN instead of the number.
std::string with_nan(std::string bytes, double number) {
  const auto bytes_of = [](double value) { return std::string(reinterpret_cast<const char*>(&value), sizeof value); };
  const std::size_t at = bytes.find(bytes_of(number));
  EXPECT_NE(at, std::string::npos);
  if (at != std::string::npos) bytes.replace(at, sizeof number, bytes_of(std::numeric_limits<double>::quiet_NaN()));
  return bytes;
}

TEST(VisualServer, takes_clients_of_the_vocabulary_that_it_was_given_and_no_others) {
  matching::VocabularyPictures picture;
  picture.add({matching::OrbDescriptor{}, {1, 2, 3, 4}});
  const matching::BinaryVocabulary own = matching::train_vocabulary(picture, {}, *make_silent_progress());
  fusion::FusionOptions options;
  options.visual.vocabulary = matching::ChosenVocabulary(own);
  VisualServer server(TierId("edge"), {}, options);
  EXPECT_EQ(server.vocabulary(), own.hash());
  const SessionId alpha = received_updates().front().from;
  EXPECT_NO_THROW(server.greet({alpha, own.hash()}));
  EXPECT_THROW(server.greet(hello_of(alpha)), Error);
}

TEST(VisualServer, refuses_what_is_not_a_clients_own_and_others_do_not_notice) {
  VisualServer server(TierId("edge"), {}, {});
  const SessionId alpha = received_updates().front().from;
  const auto other = std::find_if(received_updates().begin(), received_updates().end(),
                                  [&](const ReceivedUpdate& one) { return one.from != alpha; });
  ASSERT_NE(other, received_updates().end());
  const SessionId beta = other->from;
  const auto code_of = [&](const SessionId& from, const std::string& bytes) {
    try {
      server.receive(from, bytes);
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(to_string(from)), std::string::npos) << error.what();
      return error.code();
    }
    return ErrorCode::kInternal;
  };
  EXPECT_EQ(code_of(alpha, received_updates().front().bytes), ErrorCode::kMissing) << "has not greeted";
  Hello strange = hello_of(alpha);
  strange.vocabulary.bytes[0] ^= 1;
  EXPECT_THROW(server.greet(strange), Error);
  server.greet(hello_of(alpha));
  server.greet(hello_of(beta));
  EXPECT_EQ(code_of(alpha, other->bytes), ErrorCode::kBadInput) << "another client's map";
  EXPECT_EQ(code_of(beta, "garbage"), ErrorCode::kCorrupt);
  MapUpdate update = decode_map_update(received_updates().front().bytes, "test");
  update.origin.map = visual::map_of(beta.client, 0);
  EXPECT_EQ(code_of(beta, encode(update)), ErrorCode::kBadInput) << "another client's keyframes in its own map";
  update = decode_map_update(received_updates().front().bytes, "test");
  update.nodes = {update.nodes.front()};
  update.nodes.front().payload = nullptr;
  update.landmarks.clear();
  EXPECT_EQ(code_of(alpha, encode(update)), ErrorCode::kBadInput) << "a node that is no keyframe";
  update = decode_map_update(received_updates().front().bytes, "test");
  update.nodes.front().map_from_node.t.x() = 1e300;
  EXPECT_EQ(code_of(alpha, encode(update)), ErrorCode::kBadInput) << "a pose beyond the Earth";
  update = decode_map_update(received_updates().front().bytes, "test");
  update.nodes.front().map_from_node.t.x() = 12.345678;
  EXPECT_EQ(code_of(alpha, with_nan(encode(update), 12.345678)), ErrorCode::kCorrupt) << "a pose that is not a number";
  update = decode_map_update(received_updates().front().bytes, "test");
  const NodeId unknown{alpha, 4000};
  update.moved.push_back({unknown, {}});
  EXPECT_EQ(code_of(alpha, encode(update)), ErrorCode::kBadInput) << "a keyframe that nobody published";
  std::string newer = received_updates().front().bytes;
  const std::size_t version = newer.find('\x08');  // the header begins with it
  ASSERT_NE(version, std::string::npos);
  newer[version + 1] = 9;
  EXPECT_EQ(code_of(alpha, newer), ErrorCode::kUnsupported);
  EXPECT_TRUE(server.maps().empty());
  for (const ReceivedUpdate& one : received_updates()) EXPECT_NO_THROW(server.receive(one.from, one.bytes));
  EXPECT_EQ(server.maps().size(), 2U);
}

TEST(VisualServer, bounds_what_waits_of_one_client_in_all_of_its_maps) {
  VisualServer server(TierId("edge"), {}, {});
  const SessionId alpha = received_updates().front().from;
  server.greet(hello_of(alpha));
  MapUpdate late;
  late.sequence = 5;
  late.base = 4;
  const std::string bytes(std::size_t{1} << 20, ' ');
  int waiting = 0;
  for (int map = 0; map < 100; ++map) {
    late.origin.map = visual::map_of(alpha.client, map);
    waiting += server.receive(alpha, late, bytes).receipt.awaited != 0;
  }
  EXPECT_EQ(waiting, 63);
  server.leave(alpha);
  EXPECT_THROW(server.receive(alpha, received_updates().front().bytes), Error) << "it told nothing, and left";
  for (const ReceivedUpdate& one : received_updates()) {
    server.greet(hello_of(one.from));
    server.receive(one.from, one.bytes);
  }
  const std::string before = sealed(server);
  server.leave(alpha);
  EXPECT_EQ(sealed(server), before) << "maps stay";
  EXPECT_FALSE(server.greet(hello_of(alpha)).empty());
}

TEST(VisualServer, goes_on_where_it_was_with_what_it_had_stored) {
  VisualServer whole(TierId("edge"), {}, {});
  for (const ReceivedUpdate& one : received_updates()) {
    whole.greet(hello_of(one.from));
    whole.receive(one.from, one.bytes);
  }
  VisualServer again(TierId("edge"), {}, {});
  for (std::size_t i = 0; i < received_updates().size() / 2; ++i) {
    again.greet(hello_of(received_updates()[i].from));
    again.receive(received_updates()[i].from, received_updates()[i].bytes);
  }
  for (const ReceivedUpdate& one : received_updates()) {  // clients say hello again and repeat what was not stored
    std::uint64_t stored = 0;
    const MapUpdate update = decode_map_update(one.bytes, "test");
    for (const Receipt& receipt : again.greet(hello_of(one.from)))
      if (receipt.origin.map == update.origin.map) stored = receipt.stored;
    if (update.sequence > stored) again.receive(one.from, one.bytes);
  }
  EXPECT_EQ(sealed(whole), sealed(again));
}

TEST(VisualServer, takes_apart_what_rested_on_a_vetoed_judgement) {
  VisualServer server(TierId("edge"), {}, {});
  for (const ReceivedUpdate& one : received_updates()) {
    server.greet(hello_of(one.from));
    server.receive(one.from, one.bytes);
  }
  WorkerPool pool(1);
  server.advance(received_updates().front().from.run == 0 ? Stamp{} : Stamp{received_updates().front().from.run}, pool);
  server.pending()->run();
  server.advance({std::numeric_limits<std::int64_t>::max()}, pool);
  ASSERT_EQ(server.merged().components.size(), 1U);
  for (int round = 0; round < 20 && server.merged().components.size() == 1; ++round) {
    for (const Verdict& verdict : server.merged().verdicts)
      for (const Hash& witness : verdict.witnesses) server.veto(witness);
    server.advance({std::numeric_limits<std::int64_t>::max() - 1000000000000}, pool);
    server.pending()->run();
    server.advance({std::numeric_limits<std::int64_t>::max()}, pool);
  }
  EXPECT_EQ(server.merged().components.size(), 2U);
}

// A corridor that closes on itself: alpha, who sees well, drives where beta begins and ends; beta drives around and
// stops before it sees again what it saw first (CORB-SLAM, figure 5).
TEST(VisualServer, closes_a_clients_loop_on_anothers_keyframes) {
  using test::StarryCorridor;
  constexpr std::size_t kStanding = 60;  // frames at the end
  constexpr double kStep_m = 0.06, kAround_m = 2.0 * M_PI * StarryCorridor::kRadius_m;
  std::map<Sharing, double> error_m;
  for (const Sharing share : {Sharing::none, Sharing::full}) {
    ServerOptions options = sharing(share);
    options.correct_m = 0.03;
    options.retrieval.most = 1;  // shared landmarks help too: not here
    FeatureTeam team(options);
    StarryCorridor good(1, true), poor(2, true);
    struct Noise {
      double pixels, inverse_depth, offset;
    };
    const auto drive = [&](StarryCorridor& corridor, const char* name, double begin_m, double end_m,
                           const Noise& noise) {
      visual::ClientOptions seeing;
      seeing.window.learn_depth_offset = false;
      team.add(
          test::place_of(name), corridor.camera, static_cast<std::size_t>((end_m - begin_m) / kStep_m) + kStanding,
          [=, &corridor](std::size_t i) {
            const Pose3 there = StarryCorridor::along_ring(std::min(end_m, begin_m + kStep_m * static_cast<double>(i)));
            return FeatureTeam::Shot{
                corridor.frame(test::at(static_cast<int>(i)), there, noise.pixels, noise.inverse_depth, noise.offset),
                there};
          },
          seeing);
    };
    drive(good, "alpha", -9.0, 9.0, {0.1, 0.0002, 0.0});
    drive(poor, "beta", 2.0, kAround_m - 2.0, {0.7, 0.01, 0.01});
    team.run();
    const auto& beta = team.robots[1];
    error_m[share] = beta.error_m();
    std::printf("beta: error %.3f m, %zu loops of its own, corrected %d times, %d frames lost; %zu components\n",
                beta.error_m(), beta.client->loops().size(), beta.corrections, beta.lost,
                team.server.merged().components.size());
    EXPECT_TRUE(beta.client->loops().empty());
    EXPECT_EQ(beta.corrections > 0, share == Sharing::full);
    const fusion::FusionResult sealed = team.server.seal(team.pool, *make_silent_progress());
    EXPECT_LT(team.error_m(team.server.merged().components.front()), 1.05 * team.error_m(sealed.components.front()));
  }
  EXPECT_LT(error_m[Sharing::full], 0.87 * error_m[Sharing::none]);
}

TEST(VisualServer, sends_a_single_camera_its_pose_at_true_scale) {
  auto options = two_in_an_apartment();
  options.robots[1] = options.robots[0];
  options.robots[1].id = "beta";
  options.robots[1].length_m = 15.0;
  FeatureTeam team(options, sharing(Sharing::view));
  auto& beta = team.robots[1];
  beta.has_depth = false;
  beta.begin = 0;
  beta.options.session.await_place = true;
  beta.client.emplace(beta.camera, 0.0, beta.options, matching::shipped_vocabulary());
  beta.agent.emplace(beta.place);
  // Alpha is there first.
  beta.begin = 12 * 45;
  team.run();
  double scale = 0.0;
  const double error_m = beta.error_m(0, true, &scale);
  std::printf("beta: placed %d times, error %.3f m, scale %.3f, lost %d of %zu\n", beta.placed, error_m, scale,
              beta.lost, beta.next);
  EXPECT_GE(beta.placed, 1);
  EXPECT_NEAR(scale, 1.0, 0.02);
  EXPECT_LT(error_m, 0.05);
}

TEST(VisualServer, loses_nothing_of_a_client_that_was_cut_off) {
  auto options = two_in_an_apartment();
  for (auto& robot : options.robots) robot.length_m = 40.0;
  FeatureTeam team(options, sharing(Sharing::none));
  auto& alpha = team.robots[0];
  int missed = 0;
  for (int round = 0; team.round(); ++round) {
    const bool was = alpha.cut_off;
    alpha.cut_off = round > 20 && round <= 140;  // two a second
    missed += alpha.cut_off;
    if (was && !alpha.cut_off) alpha.greeted = false;  // says hello again
  }
  EXPECT_EQ(missed, 120) << "a minute";
  alpha.greeted = alpha.cut_off = false;
  team.run();
  std::size_t there = 0;
  for (const Map& map : team.server.maps())
    if (map.nodes.begin()->first.session.client.robot == RobotId("alpha")) there += map.nodes.size();
  EXPECT_EQ(there, alpha.client->keyframes().size());
  EXPECT_EQ(alpha.agent->waiting_bytes(), 0U);
  EXPECT_EQ(alpha.lost, 0);
}

TEST(VisualServer, joins_a_robot_that_comes_back_another_day) {
  VisualServer server(TierId("edge"), {}, {});
  WorkerPool pool(1);
  const auto silent = make_silent_progress();
  std::vector<std::size_t> components;
  for (const double start_s : {0.0, 86400.0}) {
    auto options = camera_world(PlanKind::apartment, 7, 1);
    options.seed = start_s > 0.0 ? 8 : 7;  // another drive through the same building
    options.robots[0].last_room = 2;
    options.robots[0].length_m = 10.0;
    options.robots[0].start_s = start_s;
    FeatureTeam team(options, sharing(Sharing::none));
    team.overheard = [&](const FeatureTeam::Robot& robot, const std::string& bytes) {
      server.greet(hello_of(*robot.client->run(robot.place)));
      server.receive(*robot.client->run(robot.place), bytes);
    };
    team.run();
    components.push_back(server.seal(pool, *silent).components.size());
  }
  EXPECT_THAT(components, testing::ElementsAre(1U, 1U));
  const auto maps = server.maps();
  ASSERT_EQ(maps.size(), 2U);
  EXPECT_EQ(maps[0].id.str(), "alpha.camera");
  EXPECT_EQ(maps[1].id.str(), "alpha.camera-2");
}

TEST(VisualServer, keeps_within_a_clients_wire_by_sharing_less) {
  auto options = two_in_an_apartment();
  for (auto& robot : options.robots) robot.length_m = 15.0;
  std::map<double, std::uint64_t> received_updates;
  for (const double cap : {0.0, 1.0}) {
    ServerOptions narrow = sharing(Sharing::view);
    narrow.most_bytes_per_s = 1e3 * cap;
    FeatureTeam team(options, narrow);
    team.run();
    for (const auto& robot : team.robots) {
      received_updates[cap] += robot.agent->received_bytes();
      const double kB_per_s =
          1e-3 * static_cast<double>(robot.agent->received_bytes()) * 12.0 / static_cast<double>(robot.next);
      std::printf("bound %.0f kB/s: %.2f kB/s, %zu borrowed landmarks seen\n", cap, kB_per_s, robot.borrowed_seen);
      if (cap > 0.0) {
        EXPECT_LT(kB_per_s, 1.1 * cap);
      }
    }
    EXPECT_GT(team.robots[0].borrowed_seen + team.robots[1].borrowed_seen, 20U);
  }
  EXPECT_LT(received_updates[1.0], received_updates[0.0] / 2);
}

}  // namespace
}  // namespace mapweave::tiers
