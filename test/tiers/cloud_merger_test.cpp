#include <mapweave/maps/pair_to_judge.h>
#include <mapweave/tiers/cloud_merger.h>

#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <mapweave/tiers/edge_server.h>
#include <support/fake_mapper.h>
#include <support/simulated_maps.h>

namespace mapweave::tiers {
namespace {

const EdgeMapOptions kWhole{false, {}};

// A map sent in two updates: its first scans, then all of it.
std::vector<std::string> sent_in_two(const Map& whole, const std::string& tier) {
  Map first = whole;
  first.submaps = {};
  while (first.nodes.size() > whole.nodes.size() / 2) first.nodes.erase(NodeId(first.nodes.back().first));
  MapUpdate one = difference(Map{}, first), two = difference(first, whole);
  one.origin = two.origin = {TierId(tier), whole.id};
  one.sequence = two.base = 1;
  two.sequence = 2;
  return {encode(one), encode(two)};
}

std::string everything(const fusion::FusionResult& result) {
  std::string bytes;
  for (const auto& component : result.components) bytes += encode(difference(Map{}, component.map));
  for (Verdict verdict : result.verdicts) {
    verdict.seconds = 0.0;
    bytes += encode(verdict);
  }
  return bytes;
}

struct CloudTest : testing::Test {
  WorkerPool pool{1};
  std::unique_ptr<Progress> progress = make_silent_progress();
  CloudMerger cloud{TierId("cloud"), {}};
};

TEST_F(CloudTest, answers_alike_whatever_the_order_of_updates_and_their_repetition) {
  const auto alpha = sent_in_two(test::make_map("alpha", 6), "north"),
             beta = sent_in_two(test::make_map("beta", 4, 900.0), "south");
  for (const auto& bytes : {alpha[0], alpha[1], beta[0], beta[1]}) cloud.receive(bytes, "test");
  CloudMerger other(TierId("cloud"), {});
  for (const auto& bytes : {beta[1], alpha[1], alpha[1], alpha[0], beta[1], alpha[0], beta[0], alpha[1]})
    other.receive(bytes, "test");
  EXPECT_EQ(everything(cloud.seal(pool, *progress)), everything(other.seal(pool, *progress)));
}

TEST_F(CloudTest, fuses_maps_that_it_began_with_as_those_that_came) {
  const Map before = test::make_map("before", 6), alpha = test::make_map("alpha", 6, 100.0, 2.05);
  CloudMerger received(TierId("cloud"), {});
  received.receive(first_update(before, TierId("north")), "test");
  for (CloudMerger* one : {&cloud, &received}) one->receive(first_update(alpha, TierId("north")), "test");
  cloud.begin_with({before});
  const auto all = cloud.seal(pool, *progress);
  EXPECT_EQ(everything(all), everything(received.seal(pool, *progress)));
  EXPECT_TRUE(cloud.judging_tasks({TierId("north"), TierId("south")}, pool).empty()) << "no edge has that map";
  EXPECT_EQ(cloud.receipts().size(), 1u);

  cloud.set_refused({{MapId("alpha"), MapId("before")}});
  const auto refused = cloud.seal(pool, *progress);
  EXPECT_EQ(refused.components.size(), 2u);
  EXPECT_EQ(refused.verdicts.at(0).reason, Reason::excluded);
}

TEST_F(CloudTest, takes_an_edges_judgements_for_speed_only) {
  EdgeServer edge(TierId("north"), {RobotId("alpha"), RobotId("beta")}, {}, kWhole);
  std::size_t judgements = 0;
  CloudMerger without(TierId("cloud"), {});
  for (const auto& [robot, first_range_m] : {std::pair("alpha", 2.0), std::pair("beta", 2.05)}) {
    const auto effects =
        edge.step({RobotId(robot), test::make_map(robot, 6, 100.0, first_range_m), std::nullopt}, pool, *progress);
    for (const std::string& bytes : effects.for_cloud) {
      const MapUpdate update = decode_map_update(bytes, "test");
      judgements += update.judgements.size();
      cloud.receive(bytes, "test");
      if (update.judgements.empty()) without.receive(bytes, "test");
    }
  }
  EXPECT_GT(judgements, 0u);
  EXPECT_EQ(everything(cloud.seal(pool, *progress)), everything(without.seal(pool, *progress)));
}

TEST_F(CloudTest, has_edges_judge_what_lies_on_two_of_them_and_joins_as_it_would_alone) {
  EdgeServer north(TierId("north"), {RobotId("alpha"), RobotId("gamma")}, {}, kWhole),
      south(TierId("south"), {RobotId("beta")}, {}, kWhole);
  CloudMerger alone(TierId("cloud"), {});
  const auto send = [&](EdgeServer& edge, const char* robot, int scans, double first_range_m) {
    const Map map = test::make_map(robot, scans, 100.0, first_range_m);  // no copies of one recording
    for (const std::string& bytes : edge.step({RobotId(robot), map, std::nullopt}, pool, *progress).for_cloud) {
      cloud.receive(bytes, "test");
      alone.receive(bytes, "test");
    }
  };
  send(north, "alpha", 6, 2.0);
  send(north, "gamma", 4, 2.12);
  send(south, "beta", 6, 2.05);
  EXPECT_TRUE(cloud.judging_tasks({TierId("north")}, pool).empty()) << "south does not answer";
  const auto judging_tasks = cloud.judging_tasks({north.id(), south.id()}, pool);
  ASSERT_EQ(judging_tasks.size(), 2u) << "two pairs, one each";
  std::size_t judgements = 0;
  for (EdgeServer* edge : {&north, &south}) {
    const JudgingTask& judging_task = judging_tasks.at(edge->id());
    EXPECT_EQ(decode_pairs_to_judge(judging_task.pairs, "test").size(), 1u);
    EXPECT_EQ(judging_task.updates.size(), 1u);
    for (const std::string& bytes : edge->step(judging_task, pool, *progress).for_cloud) {
      judgements += decode_map_update(bytes, "test").judgements.size();
      cloud.receive(bytes, "test");
    }
  }
  EXPECT_GT(judgements, 0u);
  EXPECT_EQ(everything(cloud.seal(pool, *progress)), everything(alone.seal(pool, *progress)));
}

TEST_F(CloudTest, lets_whoever_holds_no_map_judge_what_tiers_begin_with) {
  const Map alpha = test::make_map("alpha", 6, 100.0, 2.0), beta = test::make_map("beta", 6, 100.0, 2.05),
            gamma = test::make_map("gamma", 4, 100.0, 2.12);
  const auto judged = [&](const JudgingWork& work) {
    std::vector<Judgement> judgements;
    for (const JudgingTask& task : shared_out(work, 2))
      for (Judgement& one :
           decode_judgements(encode(judge(work_of(task, "test"), {}, nullptr, pool, *progress)), "test"))
        judgements.push_back(std::move(one));
    return judgements;
  };
  EdgeServer north(TierId("north"), {RobotId("alpha"), RobotId("gamma")}, {}, kWhole),
      unaided(TierId("north"), {RobotId("alpha"), RobotId("gamma")}, {}, kWhole);
  CloudMerger aided(TierId("cloud"), {});
  const auto of_north = judged(north.first_work({&alpha, &gamma}, pool));
  EXPECT_FALSE(of_north.empty());
  north.know(of_north);
  for (const Map* map : {&alpha, &gamma}) {
    const RobotOutcome outcome{RobotId(map->id.str()), *map, std::nullopt};
    const auto effects = north.step(outcome, pool, *progress);
    EXPECT_EQ(effects.for_cloud, unaided.step(outcome, pool, *progress).for_cloud);
    for (const std::string& bytes : effects.for_cloud)
      for (CloudMerger* merger : {&cloud, &aided}) merger->receive(bytes, "test");
  }
  EXPECT_EQ(everything(north.result()), everything(unaided.result()));

  // Beta maps on board, without an edge.
  for (CloudMerger* merger : {&cloud, &aided}) merger->receive(first_update(beta, TierId("beta")), "test");
  const JudgingWork work = cloud.first_work({north.id()}, pool);
  ASSERT_EQ(work.pairs.size(), 2u) << "alpha and gamma are north's";
  EXPECT_EQ(shared_out(work, 1).size(), 1u);
  EXPECT_EQ(shared_out(work, 5).size(), 2u);
  const auto of_cloud = judged(work);
  EXPECT_FALSE(of_cloud.empty());
  aided.know(of_cloud);
  EXPECT_EQ(everything(aided.seal(pool, *progress)), everything(cloud.seal(pool, *progress)));

  JudgingTask task = shared_out(work, 1).front();
  task.updates.pop_back();
  EXPECT_THROW(work_of(task, "test"), Error) << "a map is missing";
  task.updates.push_back(first_update(alpha, TierId("north")));
  EXPECT_THROW(work_of(task, "test"), Error) << "a map is there twice";
  EXPECT_THROW(work_of({"nonsense", {}}, "test"), Error);
  EXPECT_THROW(decode_judgements("nonsense", "test"), Error);
}

TEST_F(CloudTest, merges_what_an_edge_merged_and_takes_whole_maps_in_their_place) {
  EdgeServer edge(TierId("north"), {RobotId("alpha"), RobotId("beta")}, {});
  EdgeServer::Effects effects;
  for (const auto& [robot, first_range_m] : {std::pair("alpha", 2.0), std::pair("beta", 2.05)})
    effects =
        edge.step({RobotId(robot), test::make_map(robot, 6, 100.0, first_range_m), std::nullopt}, pool, *progress);
  ASSERT_GE(effects.for_cloud.size(), 2u);
  for (const std::string& bytes : effects.for_cloud) cloud.receive(bytes, "test");
  for (const std::string& bytes : effects.merged) cloud.receive_merged(bytes, "test");
  EXPECT_THROW(cloud.receive_merged("nonsense", "test"), Error);
  const fusion::FusionResult result = cloud.seal(pool, *progress);
  EXPECT_EQ(result.components.size(), edge.result().components.size());
  EXPECT_TRUE(cloud.wanted_as_whole(result).empty());
  fusion::FusionResult reopened;
  reopened.reopened = {{MapId("alpha"), MapId("beta")}};
  const auto wanted = cloud.wanted_as_whole(reopened);
  ASSERT_EQ(wanted.size(), 1u);
  for (const std::string& bytes : edge.whole_maps(wanted.at(TierId("north"))).for_cloud) cloud.receive(bytes, "test");
  CloudMerger from_whole(TierId("cloud"), {});
  for (const auto& [robot, first_range_m] : {std::pair("alpha", 2.0), std::pair("beta", 2.05)})
    from_whole.receive(first_update(test::make_map(robot, 6, 100.0, first_range_m), TierId("north")), "test");
  EXPECT_EQ(everything(cloud.seal(pool, *progress)), everything(from_whole.seal(pool, *progress)));
}

// What thinned maps leave open, all scans may decide.
TEST_F(CloudTest, wants_thinned_maps_whole_that_stayed_apart_in_doubt) {
  const auto team = simulation::make_apartment({}, {});
  const Map map = test::mapped(team.robots[0], team.laser);
  EdgeServer edge(TierId("north"), {team.robots[0].id}, {});
  for (const std::string& bytes : edge.step({team.robots[0].id, map, std::nullopt}, pool, *progress).for_cloud)
    cloud.receive(bytes, "test");
  const Map other = test::make_map("zeta", 6, 100.0, 2.0);
  cloud.receive(first_update(other, TierId("south")), "test");
  fusion::FusionResult apart;
  for (const MapId& id : {map.id, other.id}) {
    apart.components.emplace_back();
    apart.components.back().members = {id};
  }
  apart.verdicts.emplace_back();
  apart.verdicts[0].a = map.id;
  apart.verdicts[0].b = other.id;
  apart.verdicts[0].probability = 0.001;
  EXPECT_TRUE(cloud.wanted_as_whole(apart).empty()) << "nothing may fit";
  apart.verdicts[0].probability = 0.85;
  EXPECT_TRUE(cloud.wanted_as_whole(apart).empty()) << "their teams may fit, but nothing of them matches";
  apart.verdicts[0].alignment.emplace();
  const std::map<TierId, std::vector<MapId>> thinned{{TierId("north"), {map.id}}};
  EXPECT_EQ(cloud.wanted_as_whole(apart), thinned) << "of one robot all is here";
  EXPECT_THAT(cloud.notes(apart), testing::ElementsAre(testing::AllOf(
                                      testing::HasSubstr("edge north did not send the maps '" + map.id.str() + "'"),
                                      testing::HasSubstr("cloud.thin_maps=false"))));
  EXPECT_TRUE(cloud.notes({}).empty()) << "it is decided";
  EXPECT_TRUE(cloud.wanted_as_whole(apart).empty()) << "it was asked for";
  for (const std::string& bytes : edge.whole_maps({map.id}).for_cloud) cloud.receive(bytes, "test");
  EXPECT_TRUE(cloud.wanted_as_whole(apart).empty());
  EXPECT_THAT(cloud.notes(apart), testing::ElementsAre(testing::HasSubstr("edge north sent whole maps")));
}

// Seals with these results.
struct ScriptedCloud {
  CloudMerger& cloud;
  std::vector<fusion::FusionResult> results;
  std::size_t seals = 0;
  fusion::FusionResult seal(WorkerPool& pool, Progress& progress) {
    cloud.seal(pool, progress);
    return results.at(seals++);
  }
  auto wanted_as_whole(const fusion::FusionResult& result) { return cloud.wanted_as_whole(result); }
  bool is_newer_than_sealed() const { return cloud.is_newer_than_sealed(); }
};

TEST_F(CloudTest, asks_for_whole_maps_until_no_more_are_wanted) {
  EdgeServer edge(TierId("north"), {RobotId("alpha"), RobotId("beta"), RobotId("gamma")}, {});
  EdgeServer::Effects effects;
  for (const auto& [robot, first_range_m] : {std::pair("alpha", 2.0), std::pair("beta", 2.05), std::pair("gamma", 2.1)})
    effects =
        edge.step({RobotId(robot), test::make_map(robot, 6, 100.0, first_range_m), std::nullopt}, pool, *progress);
  std::vector<fusion::FusionResult> results(3);
  results[0].reopened = {{MapId("alpha"), MapId("beta")}};
  results[1].reopened = {{MapId("beta"), MapId("gamma")}};
  using Asked = std::vector<std::vector<MapId>>;
  const auto asked_of = [&](bool answers) {
    CloudMerger merger(TierId("cloud"), {});
    for (const std::string& bytes : effects.for_cloud) merger.receive(bytes, "test");
    ScriptedCloud scripted{merger, results};
    Asked asked;
    const auto ask = [&](const TierId& id, const std::vector<MapId>& maps) {
      EXPECT_EQ(id, edge.id());
      asked.push_back(maps);
      if (!answers) return;
      for (const std::string& bytes : edge.whole_maps(maps).for_cloud) merger.receive(bytes, "test");
    };
    seal_by_whole_maps(scripted, ask, pool, *progress);
    EXPECT_EQ(scripted.seals, answers ? 3u : 1u);
    EXPECT_EQ(merger.notes({}).size(), 1u);
    return asked;
  };
  EXPECT_EQ(asked_of(false), (Asked{{MapId("alpha"), MapId("beta")}}));
  EXPECT_EQ(asked_of(true), (Asked{{MapId("alpha"), MapId("beta")}, {MapId("gamma")}}));
}

// An edge merged two robots and thinned their maps; when the cloud takes them apart, the edge is gone.
TEST_F(CloudTest, keeps_every_pose_where_the_edge_that_thinned_the_maps_is_gone) {
  simulation::TeamOptions options;
  options.robots = 2;
  options.shared = 0.6;
  const auto team = simulation::make_apartment({}, options);
  const RobotId one = team.robots[0].id, other = team.robots[1].id;
  EdgeServer edge(TierId("north"), {one, other}, {});
  Table<MapId, Map> whole;
  EdgeServer::Effects effects;
  for (const auto& robot : team.robots) {
    const Map map = test::mapped(robot, team.laser);
    whole.set(map.id, map);
    effects = edge.step({robot.id, map, std::nullopt}, pool, *progress);
  }
  ASSERT_EQ(effects.merged.size(), 1u);
  for (const std::string& bytes : effects.for_cloud) cloud.receive(bytes, "test");
  for (const std::string& bytes : effects.merged) cloud.receive_merged(bytes, "test");
  const auto together = cloud.seal(pool, *progress);
  EXPECT_EQ(together.components.size(), 1u);
  EXPECT_TRUE(cloud.notes(together).empty());

  const std::vector<MapId> members{whole.begin()->first, std::next(whole.begin())->first};
  cloud.set_refused({{members[0], members[1]}});
  const auto apart = cloud.seal(pool, *progress);
  EXPECT_EQ(cloud.wanted_as_whole(apart).at(TierId("north")), members);
  EXPECT_EQ(everything(cloud.seal(pool, *progress)), everything(apart)) << "nobody answers";
  ASSERT_EQ(apart.components.size(), 2u);
  for (const auto& component : apart.components) {
    const Map& own = *whole.find(component.members.at(0));
    ASSERT_EQ(component.map.nodes.size(), own.nodes.size());
    double most_m = 0.0;
    for (const auto& [id, node] : component.map.nodes)
      most_m = std::max(most_m, (node.map_from_node.t - own.nodes.find(id)->map_from_node.t).norm());
    EXPECT_LT(most_m, 0.1) << component.members[0].str();
  }
  const auto notes = cloud.notes(apart);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_THAT(
      notes[0],
      testing::AllOf(testing::HasSubstr("edge north"), testing::HasSubstr("'" + members[0].str() + "'"),
                     testing::HasSubstr("'" + members[1].str() + "'"), testing::HasSubstr("cloud.thin_maps=false")));

  for (const std::string& bytes : edge.whole_maps(members).for_cloud) cloud.receive(bytes, "test");
  const auto from_whole = cloud.seal(pool, *progress);
  EXPECT_THAT(cloud.notes(from_whole), testing::ElementsAre(testing::HasSubstr("edge north sent whole maps")))
      << "it came back";
  std::size_t scans = 0, thinned_scans = 0;
  const auto has_scan = [](const auto& entry) { return entry.second.payload != nullptr; };
  for (std::size_t i = 0; i < 2; ++i) {
    const auto &all = from_whole.components[i].map.nodes, &few = apart.components[i].map.nodes;
    scans += static_cast<std::size_t>(std::count_if(all.begin(), all.end(), has_scan));
    thinned_scans += static_cast<std::size_t>(std::count_if(few.begin(), few.end(), has_scan));
  }
  EXPECT_LT(thinned_scans, scans / 2);
}

TEST_F(CloudTest, gives_edges_no_judging_task_that_they_cannot_do) {
  EdgeServer north(TierId("north"), {RobotId("alpha")}, {});
  north.step({RobotId("alpha"), test::make_map("alpha", 6), std::nullopt}, pool, *progress);
  using Pairs = std::vector<PairToJudge>;
  const std::string unknown = encode(Pairs{{MapId("beta"), MapId("gamma"), {}}}),
                    half_known = encode(Pairs{{MapId("alpha"), MapId("beta"), {}}});
  EXPECT_THROW(north.step(JudgingTask{unknown, {}}, pool, *progress), Error) << "neither is here";
  EXPECT_THROW(north.step(JudgingTask{half_known, {}}, pool, *progress), Error) << "beta was not sent along";
  EXPECT_THROW(north.step(JudgingTask{half_known, {"nonsense"}}, pool, *progress), Error);
  EXPECT_THROW(north.step(JudgingTask{"nonsense", {}}, pool, *progress), Error);
  EXPECT_TRUE(north.step(JudgingTask{encode(Pairs{}), {}}, pool, *progress).for_cloud.empty());
}

TEST_F(CloudTest, says_what_is_missing_and_does_not_seal_before_it_has_come) {
  const auto alpha = sent_in_two(test::make_map("alpha", 6), "north");
  const Receipt gap = cloud.receive(alpha[1], "test");
  EXPECT_EQ(gap.stored, 0u);
  EXPECT_EQ(gap.awaited, 1u);
  EXPECT_THROW(cloud.seal(pool, *progress), Error);
  const Receipt whole = cloud.receive(alpha[0], "test");
  EXPECT_EQ(whole.stored, 2u);
  EXPECT_EQ(whole.awaited, 0u);
  const auto result = cloud.seal(pool, *progress);
  ASSERT_EQ(result.components.size(), 1u);
  EXPECT_EQ(result.components[0].map.nodes.size(), 6u);
}

TEST_F(CloudTest, stores_nothing_of_bytes_that_cannot_be_decoded) {
  std::string bytes = sent_in_two(test::make_map("alpha", 6), "north")[0];
  bytes.resize(bytes.size() / 2);
  EXPECT_THROW(cloud.receive(bytes, "test"), Error);
  EXPECT_THROW(cloud.receive("not a message", "test"), Error);
  EXPECT_TRUE(cloud.receipts().empty());
}

TEST_F(CloudTest, stores_nothing_of_an_update_that_does_not_fit) {
  const Map alpha = test::make_map("alpha", 6);
  MapUpdate update;
  update.origin = {TierId("north"), alpha.id};
  update.sequence = 1;
  update.moved.push_back({alpha.nodes.front().first, Pose3{}});  // of a node that was never sent
  EXPECT_THROW(cloud.receive(encode(update), "test"), Error);
  EXPECT_TRUE(cloud.receipts().empty());
  update.moved.clear();
  update.base = 1;  // builds on itself
  EXPECT_THROW(cloud.receive(encode(update), "test"), Error);
}

TEST_F(CloudTest, refuses_a_map_that_two_edges_send) {
  cloud.receive(sent_in_two(test::make_map("alpha", 6), "north")[0], "test");
  EXPECT_THROW(cloud.receive(sent_in_two(test::make_map("alpha", 6), "south")[1], "test"), Error);
  ASSERT_EQ(cloud.receipts().size(), 1u);
  EXPECT_EQ(cloud.receipts()[0].origin.tier, TierId("north"));
}

}  // namespace
}  // namespace mapweave::tiers
