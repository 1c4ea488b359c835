// Fusion in rounds: what tiers send while maps grow, and what they make of it.
#include <mapweave/tiers/round_merger.h>

#include <gmock/gmock.h>
#include <mapweave/maps/map_update.h>
#include <support/simulated_maps.h>

namespace mapweave::tiers {
namespace {

std::string bytes_of(const Map& map) {
  MapUpdate update = difference(Map{}, map);
  update.origin = {TierId("north"), map.id};
  update.sequence = 1;
  return encode(update);
}

constexpr std::size_t kRounds = 6;

// What robots' maps show in each round, of three robots of one apartment.
struct Growing {
  std::vector<std::vector<Map>> parts;  // by round and robot
  Growing() : parts(kRounds) {
    simulation::TeamOptions options;
    options.robots = 3;
    options.shared = 0.6;
    const auto team = simulation::make_apartment({}, options);
    const auto geometry = test::scan_geometry(team.laser);
    for (const auto& robot : team.robots) {
      laser::GraphMapper mapper({robot.id, SensorId("laser")}, {});
      std::size_t done = 0;
      for (std::size_t round = 0; round < kRounds; ++round) {
        for (const std::size_t end = robot.steps.size() * (round + 1) / kRounds; done < end; ++done) {
          const auto& step = robot.steps[done];
          mapper.add(laser::OdometryInput{step.stamp, spatial(step.odometry_from_robot)});
          mapper.add(laser::ScanInput{step.stamp, test::packed(step.ranges, geometry)});
        }
        parts[round].push_back(growing_part(mapper.snapshot()));
      }
    }
  }
};

const Growing& growing() {
  static const Growing shared;
  return shared;
}

TEST(GrowingMap, is_sent_once_and_arrives_whole) {
  GrowingMapSender sender(TierId("north"));
  std::optional<UpdateInbox> inbox;
  std::size_t bytes = 0, nodes = 0;
  for (std::size_t round = 0; round < kRounds; ++round) {
    const Map& part = growing().parts[round][0];
    const auto sent = sender.next(part);
    ASSERT_TRUE(sent);
    EXPECT_FALSE(sender.next(part)) << "nothing is new";
    bytes += sent->size();
    MapUpdate update = decode_map_update(*sent, "test");
    EXPECT_EQ(update.sequence, round + 1);
    EXPECT_EQ(update.base, round);
    nodes += update.nodes.size();
    if (!inbox) inbox.emplace(update.origin);
    inbox->receive(std::move(update), sent->size(), "test");
    EXPECT_TRUE(bytes_of(inbox->map()) == bytes_of(part)) << "round " << round;
    EXPECT_TRUE(bytes_of(as_if_frozen(inbox->map(), 5)) == bytes_of(as_if_frozen(part, 5)));
  }
  EXPECT_EQ(nodes, growing().parts.back()[0].nodes.size());
  EXPECT_LT(bytes, bytes_of(growing().parts.back()[0]).size() * 5 / 4);
}

TEST(GrowingMap, shows_what_grows_where_its_anchor_is) {
  std::size_t filled = 0;
  for (std::size_t round = 0; round < kRounds; ++round) {
    const Map& part = growing().parts[round][1];
    const Map whole = as_if_frozen(part, 5);
    for (const auto& [id, submap] : whole.submaps) {
      EXPECT_TRUE(submap.frozen);
      EXPECT_EQ(submap.content, content_hash(submap, whole.nodes));
      EXPECT_EQ(submap.anchor(), part.submaps.find(id)->anchor());
      filled += part.submaps.find(id)->frozen ? 0 : 1;
    }
    EXPECT_TRUE(as_if_frozen(part, 100000).submaps.size() <= whole.submaps.size());
  }
  EXPECT_GT(filled, 0u);
}

TEST(GrowingMap, begins_anew_where_its_engine_did) {
  const Map& part = growing().parts[2][0];
  Map other = part;
  Node& first = other.nodes.begin()->second;
  PackedScan scan = std::get<PackedScan>(*first.payload);
  scan.ranges[0] = static_cast<std::uint16_t>(scan.ranges[0] + 7);
  first.payload = std::make_shared<const Payload>(scan);
  EXPECT_TRUE(continues(growing().parts[1][0], part));
  EXPECT_FALSE(continues(part, other));
  other.submaps = {};
  GrowingMapSender sender(TierId("north"));
  sender.next(part);
  const auto again = sender.next(other);
  ASSERT_TRUE(again);
  const MapUpdate update = decode_map_update(*again, "test");
  EXPECT_EQ(update.base, 0u);
  EXPECT_EQ(update.nodes.size(), other.nodes.size());
}

// Two edges and a cloud through all rounds.
struct Tiers {
  RoundMerger north{TierId("north"), {}}, south{TierId("south"), {}}, cloud{TierId("cloud"), {}};
  std::vector<std::size_t> largest;  // members of the cloud's largest map, by round
  std::string everything;            // of all previews
  std::uint64_t bytes = 0;
  explicit Tiers(int threads) {
    WorkerPool pool(threads);
    const auto silent = make_silent_progress();
    for (const std::vector<Map>& parts : growing().parts) {
      north.put(parts[0]);
      north.put(parts[1]);
      south.put(parts[2]);
      for (RoundMerger* edge : {&north, &south}) {
        edge->fuse(pool, *silent);
        const RoundNews news = edge->news();
        bytes += news.bytes();
        cloud.receive(news, edge == &north ? TierId("north") : TierId("south"));
        EXPECT_EQ(edge->news().bytes(), 0u) << "all was sent";
      }
      EXPECT_TRUE(cloud.has_news());
      const auto& preview = cloud.fuse(pool, *silent);
      EXPECT_FALSE(cloud.has_news());
      largest.push_back(preview.components.empty() ? 0 : preview.components.front().members.size());
      for (const auto& component : preview.components)
        for (const auto& [id, node] : component.map.nodes)
          for (const double value : {node.map_from_node.t.x(), node.map_from_node.t.y()})
            everything.append(reinterpret_cast<const char*>(&value), sizeof value);
    }
  }
};

TEST(RoundMerger, joins_maps_of_two_edges_while_they_grow) {
  const Tiers tiers(2);
  EXPECT_EQ(tiers.largest.back(), 3u);
  EXPECT_EQ(tiers.cloud.maps().size(), 3u);
  EXPECT_TRUE(std::is_sorted(tiers.largest.begin() + 1, tiers.largest.end()))
      << "only what the first round showed may be taken back";
  std::size_t whole = 0;
  for (const Map& part : growing().parts.back()) whole += bytes_of(part).size();
  EXPECT_LT(tiers.bytes, 2 * whole) << "with the matches";
}

TEST(RoundMerger, shows_the_same_for_any_number_of_threads) { EXPECT_TRUE(Tiers(1).everything == Tiers(3).everything); }

TEST(RoundMerger, forgets_a_map_that_went_elsewhere) {
  WorkerPool pool(1);
  const auto silent = make_silent_progress();
  RoundMerger edge(TierId("north"), {});
  edge.put(growing().parts.back()[0]);
  edge.put(growing().parts.back()[1]);
  edge.fuse(pool, *silent);
  edge.put(growing().parts.back()[1]);
  EXPECT_FALSE(edge.has_news());
  edge.forget(MapId(growing().parts.back()[0].id));
  EXPECT_TRUE(edge.has_news());
  EXPECT_EQ(edge.fuse(pool, *silent).components.size(), 1u);
}

TEST(RoundMerger, takes_a_map_of_who_has_it_now_though_the_one_before_was_slow) {
  const auto part = [](std::size_t round) -> const Map& { return growing().parts[round][0]; };
  RoundMerger north(TierId("north"), {}), south(TierId("south"), {}), cloud(TierId("cloud"), {});
  const auto said = [&](RoundMerger& edge, std::size_t round) {
    edge.put(part(round));
    return edge.news();
  };
  const auto has = [&](std::size_t round) {
    return cloud.map(part(round).id)->nodes.size() == part(round).nodes.size();
  };
  cloud.receive(said(north, 1), TierId("north"));
  const RoundNews late = said(north, 2);
  cloud.receive(said(south, 3), TierId("south"));
  cloud.receive(late, TierId("north"));
  EXPECT_TRUE(has(3));
  cloud.receive(said(south, 4), TierId("south"));
  EXPECT_TRUE(has(4));
  north.forget(part(2).id);
  cloud.receive(said(north, 5), TierId("north"));
  EXPECT_TRUE(has(5)) << "it came back";
}

}  // namespace
}  // namespace mapweave::tiers
