#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/maps/map_update.h>
#include <mapweave/rig/rig.h>
#include <support/starry_maps.h>

namespace mapweave::fusion {
namespace {

FusionResult fused(std::vector<Map> maps, int threads = 1, Memo* memo = nullptr, std::set<Hash> vetoed = {}) {
  WorkerPool pool(threads);
  Memo own;
  const auto progress = make_silent_progress();
  return fuse({std::move(maps), std::move(vetoed), TierId("cloud")}, {}, memo != nullptr ? *memo : own, pool,
              *progress);
}

std::string bytes_of(const Component& component) {
  MapUpdate update = difference({}, component.map);
  update.origin = {TierId("cloud"), component.map.id};
  update.sequence = 1;
  return encode(update);
}

struct TwoRobots {
  test::StarryBuilding building{{1}};
  std::vector<Pose2> path_a = test::look_around(-1.0, -0.5, 0.0, 2.4, 14),
                     path_b = test::look_around(0.5, 0.7, 1.4, 4.0, 14);
  Map a = building.keyframe_map("alpha", path_a), b = building.keyframe_map("beta", path_b);
  Pose2 a_from_b = between(path_a.front(), path_b.front());
};

void expect_at(const Component& team, const char* map, const Pose2& truth, double most_m, double most_rad) {
  const Pose2 pose = planar(*team.team_from_map.find(MapId(map)));
  EXPECT_LT(std::hypot(pose.x - truth.x, pose.y - truth.y), most_m) << map;
  EXPECT_LT(std::abs(wrap_angle(pose.phi - truth.phi)), most_rad) << map;
}

TEST(VisualFuse, joins_two_robots_that_saw_one_room) {
  const TwoRobots robots;
  const auto result = fused({robots.a, robots.b});
  ASSERT_EQ(result.verdicts.size(), 1U);
  EXPECT_EQ(result.verdicts[0].decision, Decision::accepted) << to_text(result.verdicts[0].reason);
  EXPECT_EQ(result.verdicts[0].kind, "vision");
  EXPECT_GE(result.verdicts[0].witnesses.size(), 2U);
  ASSERT_FALSE(result.verdicts[0].hypotheses.empty());
  const PairHypothesis& best = result.verdicts[0].hypotheses[0];
  EXPECT_EQ(best.sense, Sense::cameras);
  EXPECT_EQ(best.matches, result.verdicts[0].witnesses.size());
  EXPECT_LT((best.a_from_b.pose.t - spatial(robots.a_from_b).t).norm(), 0.05);
  ASSERT_EQ(result.components.size(), 1U);
  expect_at(result.components[0], "alpha", {}, 1e-6, 1e-6);
  expect_at(result.components[0], "beta", robots.a_from_b, 0.02, 0.005);
}

TEST(VisualFuse, makes_landmarks_that_both_saw_one_and_keeps_owners) {
  const TwoRobots robots;
  const auto result = fused({robots.a, robots.b});
  ASSERT_EQ(result.components.size(), 1U);
  const Component& team = result.components[0];
  EXPECT_GT(team.same_as.size(), 100U);
  EXPECT_EQ(team.map.landmarks.size() + team.same_as.size(), robots.a.landmarks.size() + robots.b.landmarks.size());
  for (const auto& [gone, kept] : team.same_as) {
    EXPECT_EQ(gone.session.client.robot, RobotId("beta"));
    EXPECT_FALSE(team.map.landmarks.contains(gone));
    ASSERT_TRUE(team.map.landmarks.contains(kept));
    EXPECT_EQ(kept.session.client.robot, RobotId("alpha"));
  }
}

TEST(VisualFuse, corrects_a_map_that_bends_by_one_that_does_not) {
  const test::StarryBuilding building({1});
  const auto path = test::look_around(-1.0, 0.0, 0.0, 3.0, 24);
  test::StarryOptions bent;
  bent.drift_rad_per_keyframe = 0.002;
  const Map straight = building.keyframe_map("alpha", path), drifted = building.keyframe_map("beta", path, bent);
  const auto result = fused({straight, drifted});
  ASSERT_EQ(result.components.size(), 1U);
  const auto error = [&](const Map& map, const Pose3& team_from_map) {
    double most = 0.0;
    for (std::uint32_t i = 0; i < path.size(); ++i) {
      const NodeId id{{{RobotId("beta"), SensorId("camera")}, 1'000'000'000}, i};
      const Pose2 truth = between(path.front(), path[i]),
                  pose = planar(compose(team_from_map, map.nodes.find(id)->map_from_node));
      most = std::max(most, std::abs(wrap_angle(pose.phi - truth.phi)));
    }
    return most;
  };
  EXPECT_GT(error(drifted, {}), 0.04);
  EXPECT_LT(error(result.components[0].map, {}), 0.01);
}

TEST(VisualFuse, finds_the_scale_of_a_single_camera_by_a_map_with_depth) {
  const test::StarryBuilding building({1});
  const auto path_a = test::look_around(-1.0, -0.5, 0.0, 2.4, 14);
  std::vector<Pose2> path_b;
  for (int i = 0; i < 14; ++i) path_b.push_back({-1.5 + 0.15 * i, 0.3, 1.0});
  test::StarryOptions single;
  single.depth = false;
  single.scale = 0.4;
  const auto result = fused({building.keyframe_map("alpha", path_a), building.keyframe_map("beta", path_b, single)});
  ASSERT_EQ(result.components.size(), 1U) << to_text(result.verdicts[0].reason);
  ASSERT_NE(result.components[0].scales.find(MapId("beta")), nullptr);
  EXPECT_NEAR(*result.components[0].scales.find(MapId("beta")), 2.5, 0.05);
  const SessionId session{{RobotId("beta"), SensorId("camera")}, 1'000'000'000};
  const Map& team = result.components[0].map;
  EXPECT_NEAR((team.nodes.find({session, 0})->map_from_node.t - team.nodes.find({session, 13})->map_from_node.t).norm(),
              0.15 * 13, 0.03);
}

TEST(VisualFuse, leaves_strangers_apart_and_says_why) {
  const test::StarryBuilding building({1, 2, 3});  // walls hide nothing: not next door
  const auto result = fused({building.keyframe_map("alpha", test::look_around(-1.0, 0.0, 0.0, 3.0, 12)),
                             building.keyframe_map("beta", test::look_around(23.0, 0.0, 0.0, 3.0, 12))});
  EXPECT_EQ(result.components.size(), 2U);
  EXPECT_EQ(result.verdicts[0].decision, Decision::refused);
  EXPECT_NE(result.verdicts[0].reason, Reason::none);
}

TEST(VisualFuse, defers_where_a_robot_has_seen_two_rooms_that_look_alike) {
  for (int look = 1; look <= 8; ++look) {
    const test::StarryBuilding building({look, look, look});
    std::vector<Pose2> both = test::look_around(-1.0, 0.0, 0.0, 3.0, 12);
    for (const Pose2& pose : test::look_around(11.0, 0.0, 0.1 * look, 3.0, 12)) both.push_back(pose);
    const auto result = fused({building.keyframe_map("alpha", both),
                               building.keyframe_map("beta", test::look_around(23.0, 0.3, 0.0, 3.0, 12))});
    EXPECT_EQ(result.components.size(), 2U) << look;
    EXPECT_EQ(result.verdicts[0].decision, Decision::deferred) << look;
    EXPECT_EQ(result.verdicts[0].reason, Reason::ambiguous) << look;
    ASSERT_GE(result.verdicts[0].hypotheses.size(), 2U) << look;
    EXPECT_GT(result.verdicts[0].hypotheses[0].elsewhere, 0U) << look;
  }
}

TEST(VisualFuse, believes_no_two_robots_what_a_third_has_seen_twice) {
  const test::StarryBuilding building({1, 1, 2, 3, 1, 4, 5, 1});  // walls hide nothing
  std::vector<Pose2> both = test::look_around(-1.0, 0.0, 0.0, 3.0, 12);
  for (const Pose2& pose : test::look_around(11.0, 0.0, 0.1, 3.0, 12)) both.push_back(pose);
  const Map alpha = building.keyframe_map("alpha", both),
            beta = building.keyframe_map("beta", test::look_around(47.0, 0.3, 0.0, 3.0, 12)),
            gamma = building.keyframe_map("gamma", test::look_around(83.0, -0.2, 0.0, 3.0, 12));
  EXPECT_EQ(fused({beta, gamma}).components.size(), 1U);  // who has seen one room cannot know
  const auto result = fused({alpha, beta, gamma});
  EXPECT_EQ(result.components.size(), 3U);
  for (const Verdict& verdict : result.verdicts) {
    EXPECT_EQ(verdict.decision, Decision::deferred) << verdict.a.str() << " " << verdict.b.str();
    EXPECT_EQ(verdict.reason, Reason::ambiguous);
    EXPECT_FALSE(verdict.contradicted.empty());
  }
}

TEST(VisualFuse, gives_the_same_bytes_for_any_order_threads_and_memo) {
  const TwoRobots robots;
  Memo memo;
  const auto one = fused({robots.a, robots.b}, 1, &memo);
  const auto other = fused({robots.b, robots.a}, 2), again = fused({robots.a, robots.b}, 1, &memo);
  ASSERT_EQ(one.components.size(), 1U);
  EXPECT_EQ(bytes_of(one.components[0]), bytes_of(other.components[0]));
  EXPECT_EQ(bytes_of(one.components[0]), bytes_of(again.components[0]));
}

TEST(VisualFuse, comes_apart_again_when_its_witnesses_are_vetoed) {
  const TwoRobots robots;
  const auto joined = fused({robots.a, robots.b});
  std::set<Hash> vetoed;
  for (const Judgement& judgement : joined.judgements) vetoed.insert(judgement.id);
  const auto apart = fused({robots.a, robots.b}, 1, nullptr, vetoed);
  ASSERT_EQ(apart.components.size(), 2U);
  EXPECT_EQ(apart.verdicts[0].reason, Reason::vetoed);
  EXPECT_EQ(content_hash(apart.components[1].map), content_hash(robots.b));
}

FusionResult answer_to(const FusionInput& input) {
  WorkerPool pool(1);
  Memo memo;
  const auto progress = make_silent_progress();
  return fuse(input, {}, memo, pool, *progress);
}

TEST(VisualFuse, does_not_judge_again_what_was_judged_when_maps_were_smaller) {
  const TwoRobots robots;
  Map younger = robots.b;
  const NodeId last = younger.nodes.back().first;
  younger.nodes.erase(last);
  for (auto& [id, landmark] : younger.landmarks)
    landmark.seen.erase(
        std::remove_if(landmark.seen.begin(), landmark.seen.end(), [&](const auto& s) { return s.node == last; }),
        landmark.seen.end());
  for (auto landmark = younger.landmarks.begin(); landmark != younger.landmarks.end();)
    if (landmark->second.seen.empty() || landmark->second.anchor == last) {
      const LandmarkId id = landmark->first;
      younger.landmarks.erase(id);
      landmark = younger.landmarks.begin();
    } else {
      ++landmark;
    }
  const auto before = fused({robots.a, younger});
  ASSERT_EQ(before.components.size(), 1U);
  FusionInput grown{{robots.a, robots.b}, {}, TierId("edge")};
  const auto cold = answer_to(grown);
  grown.judged = before.judgements;
  const auto warm = answer_to(grown);
  ASSERT_EQ(warm.components.size(), 1U);
  std::map<std::pair<SubmapId, SubmapId>, Hash> known;
  for (const Judgement& judgement : before.judgements)
    known.emplace(std::make_pair(judgement.a, judgement.b), judgement.id);
  std::size_t again = 0;
  for (const Judgement& judgement : warm.judgements) {
    const auto found = known.find({judgement.a, judgement.b});
    if (found == known.end()) continue;
    EXPECT_EQ(found->second, judgement.id);
    ++again;
  }
  EXPECT_GT(again, 0U);
  const Pose3 apart = between(*warm.components[0].team_from_map.find(MapId("beta")),
                              *cold.components[0].team_from_map.find(MapId("beta")));
  EXPECT_LT(apart.t.norm(), 0.005);

  PreviousMerge& team = grown.teams.emplace_back();
  team.members = before.components[0].members;
  for (const auto& [id, node] : before.components[0].map.nodes) team.team_from_node.set(id, node.map_from_node);
  for (const Map* map : {&robots.a, &static_cast<const Map&>(younger)})
    for (const auto& [id, node] : map->nodes) team.map_from_node.set(id, node.map_from_node);
  const auto kept = answer_to(grown);
  ASSERT_EQ(kept.components.size(), 1U);
  EXPECT_LT(kept.judgements.size(), warm.judgements.size());
  std::size_t stayed = 0, moved = 0;
  for (const auto& [id, node] : kept.components[0].map.nodes) {
    const Pose3* was = team.team_from_node.find(id);
    if (was != nullptr) ++((was->t - node.map_from_node.t).norm() < 1e-9 ? stayed : moved);
    EXPECT_LT((cold.components[0].map.nodes.find(id)->map_from_node.t - node.map_from_node.t).norm(), 0.02)
        << to_string(id);
  }
  EXPECT_GT(stayed, moved);
  EXPECT_GT(moved, 0U) << "beside what is new";
}

// What keyframes of b would report of landmarks that a shared with them: where they saw their own landmarks at those
// places.
std::vector<LandmarkChange> borrowed_between(const Map& a, const Map& b, const Pose3& a_from_b) {
  std::map<LandmarkId, LandmarkChange> changes;
  for (const auto& [id_b, own] : b.landmarks) {
    const Eigen::Vector3d point =
        transformed(transformed(own.point_in_anchor(), b.nodes.find(own.anchor)->map_from_node), a_from_b);
    const Landmark* nearest = nullptr;
    double least = 0.03;
    for (const auto& [id_a, other] : a.landmarks) {
      const double apart =
          (transformed(other.point_in_anchor(), a.nodes.find(other.anchor)->map_from_node) - point).norm();
      if (apart < least) {
        least = apart;
        nearest = &other;
      }
    }
    if (nearest == nullptr) continue;
    LandmarkChange& change = changes[nearest->id];
    change.id = nearest->id;
    for (const LandmarkSighting& sighting : own.seen)
      if (change.seen.empty() || change.seen.back().node < sighting.node) change.seen.push_back(sighting);
  }
  std::vector<LandmarkChange> result;
  for (auto& entry : changes) result.push_back(std::move(entry.second));
  return result;
}

// The same things under another light: each looks the same from everywhere, but other than before.
Map in_another_light(const Map& map, std::uint64_t bits) {
  Map result = map;
  for (auto& entry : result.nodes) {
    KeyframeFeatures features = *keyframe_of(entry.second);
    for (BinaryDescriptor& descriptor : features.descriptors) {
      const std::uint64_t first = descriptor[0] % 256;
      for (std::uint64_t i = 0; i < bits; ++i) {
        const std::uint64_t bit = (first + 37 * i) % 256;
        descriptor[bit / 64] ^= std::uint64_t{1} << bit % 64;
      }
    }
    entry.second.payload = std::make_shared<const Payload>(std::move(features));
  }
  return result;
}

TEST(VisualFuse, joins_by_what_clients_published_where_words_find_nothing) {
  const TwoRobots robots;
  FusionInput input{{robots.a, in_another_light(robots.b, 57)}, {}, TierId("edge")};
  const std::size_t by_words = answer_to(input).components.size();
  EXPECT_EQ(by_words, 2U);
  input.borrowed = borrowed_between(robots.a, robots.b, spatial(robots.a_from_b));
  ASSERT_GT(input.borrowed.size(), 50U);
  const auto with_sightings = answer_to(input);
  ASSERT_EQ(with_sightings.components.size(), 1U) << to_text(with_sightings.verdicts[0].reason);
  EXPECT_GE(with_sightings.verdicts[0].witnesses.size(), 2U);
  EXPECT_LE(with_sightings.verdicts[0].witnesses.size(), with_sightings.judgements.size());
  expect_at(with_sightings.components[0], "beta", robots.a_from_b, 0.02, 0.005);
}

TEST(VisualFuse, does_not_believe_a_client_that_lies_about_what_it_saw) {
  const test::StarryBuilding building({1, 2, 3});
  const Map a = building.keyframe_map("alpha", test::look_around(-1.0, 0.0, 0.0, 3.0, 12)),
            b = building.keyframe_map("beta", test::look_around(23.0, 0.0, 0.0, 3.0, 12));
  FusionInput input{{a, b}, {}, TierId("edge")};
  // Every keyframe of b claims what a's of the same number sees, exactly there.
  for (const auto& [id, landmark] : a.landmarks) {
    LandmarkChange change{id, std::nullopt, {}};
    for (LandmarkSighting sighting : landmark.seen) {
      sighting.node.session = b.nodes.front().first.session;
      if (b.nodes.find(sighting.node) != nullptr) change.seen.push_back(sighting);
    }
    input.borrowed.push_back(change);
  }
  const auto result = answer_to(input);
  EXPECT_EQ(result.components.size(), 2U);
  EXPECT_NE(result.verdicts[0].decision, Decision::accepted);
  EXPECT_GT(result.judgements.size(), 0U) << "it was looked into";
}

TEST(VisualFuse, hardly_moves_for_lies_within_a_team) {
  const TwoRobots robots;
  FusionInput input{{robots.a, robots.b}, {}, TierId("edge")};
  const auto honest = answer_to(input);
  input.borrowed = borrowed_between(robots.a, robots.b, spatial(robots.a_from_b));
  for (LandmarkChange& change : input.borrowed)
    for (LandmarkSighting& sighting : change.seen)
      sighting.u = static_cast<std::uint16_t>(std::min(639 * 16, sighting.u + 16 * 30));
  const auto lied = answer_to(input);
  ASSERT_EQ(lied.components.size(), 1U);
  expect_at(lied.components[0], "beta", robots.a_from_b, 0.02, 0.005);
  EXPECT_LT((lied.components[0].team_from_map.find(MapId("beta"))->t -
             honest.components[0].team_from_map.find(MapId("beta"))->t)
                .norm(),
            0.005);
}

// The map of a camera that looks backwards: of the same robot, of another sensor.
Map facing_back(const Map& map) {
  const Pose3 turned{{0, 0, 0}, Eigen::Quaterniond(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()))};
  const auto session = [](SessionId id) {
    id.client.sensor = SensorId("rear");
    return id;
  };
  auto geometry = std::make_shared<CameraGeometry>(*keyframe_of(map.nodes.front().second)->geometry);
  geometry->robot_from_camera = compose(turned, geometry->robot_from_camera);
  Map result;
  result.id = map.id;
  for (auto [id, node] : map.nodes) {
    KeyframeFeatures features = *keyframe_of(node);
    features.geometry = geometry;
    node.id.session = session(id.session);
    node.map_from_node = compose(node.map_from_node, turned);
    node.payload = std::make_shared<const Payload>(std::move(features));
    result.nodes.set(node.id, node);
  }
  for (auto [id, landmark] : map.landmarks) {
    landmark.id.session = session(id.session);
    landmark.anchor.session = session(landmark.anchor.session);
    landmark.point_units = landmark_units(transformed(landmark.point_in_anchor(), turned));
    for (LandmarkSighting& sighting : landmark.seen) sighting.node.session = session(sighting.node.session);
    result.landmarks.set(landmark.id, landmark);
  }
  return result;
}

TEST(VisualFuse, keeps_cameras_of_one_robot_together_where_one_of_them_is_corrected) {
  const test::StarryBuilding building({1});
  const auto path = test::look_around(-1.0, 0.0, 0.0, 2.6, 24);
  std::vector<Pose2> path_of_rear = path;
  for (Pose2& pose : path_of_rear) pose.phi = wrap_angle(pose.phi + M_PI);
  test::StarryOptions bent;
  bent.drift_rad_per_keyframe = 0.002;
  const Map straight = building.keyframe_map("alpha", path), ahead = building.keyframe_map("beta", path, bent);
  rig::RigMerge rig = rig::merge_rig(
      {{"camera", ahead, {}}, {"rear", facing_back(building.keyframe_map("beta", path_of_rear, bent)), {}}}, {});
  ASSERT_EQ(rig.maps.size(), 1U);
  const auto result = fused({straight, rig.maps[0].map});
  ASSERT_EQ(result.components.size(), 1U);
  const Map& team = result.components[0].map;
  double moved = 0.0;
  for (std::uint32_t i = 0; i < path.size(); ++i) {
    const NodeId id{{{RobotId("beta"), SensorId("camera")}, 1'000'000'000}, i},
        rear_id{{{RobotId("beta"), SensorId("rear")}, 1'000'000'000}, i};
    const Pose3 &here = team.nodes.find(id)->map_from_node, &there = team.nodes.find(rear_id)->map_from_node;
    EXPECT_LT((here.t - there.t).norm(), 0.01) << i;
    EXPECT_LT(here.q.angularDistance(there.q), 0.006) << i;
    moved = std::max(moved, std::abs(wrap_angle(planar(here).phi - planar(ahead.nodes.find(id)->map_from_node).phi)));
  }
  EXPECT_GT(moved, 0.03);
  EXPECT_TRUE(std::any_of(team.constraints.begin(), team.constraints.end(),
                          [](const auto& entry) { return entry.first.kind == ConstraintKind::extrinsic; }));
}

TEST(VisualFuse, takes_maps_of_one_run_that_share_no_keyframe) {
  const test::StarryBuilding building({1});
  Map whole = building.keyframe_map("alpha", test::look_around(-1.0, 0.0, 0.0, 3.0, 12)), first = whole, second = whole;
  first.landmarks = second.landmarks = {};
  second.id = MapId("alpha.1");
  for (const auto& [id, node] : whole.nodes) (id.index < 6 ? second : first).nodes.erase(id);
  EXPECT_NO_THROW(fused({first, second}));
  EXPECT_THROW(fused({whole, second}), Error);
}

}  // namespace
}  // namespace mapweave::fusion
