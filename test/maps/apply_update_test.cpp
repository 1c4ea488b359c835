#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <support/random_map.h>

#include <functional>
#include <map>
#include <set>

namespace mapweave {
namespace {

using test::RandomMaps;

std::string bytes_of(const Map& map) { return encode(difference({}, map)); }

// What apply() says, value by value.
Map one_by_one(Map map, const MapUpdate& update) {
  for (const LandmarkId& id : update.removed_landmarks) map.landmarks.erase(id);
  for (const ConstraintId& id : update.removed_constraints) map.constraints.erase(id);
  for (const SubmapId& id : update.removed_submaps) map.submaps.erase(id);
  for (const NodeId& gone : update.removed_nodes) {
    map.nodes.erase(gone);
    for (auto& [id, landmark] : map.landmarks)
      for (std::size_t i = landmark.seen.size(); i-- > 0;)
        if (landmark.seen[i].node == gone) landmark.seen.erase(landmark.seen.begin() + static_cast<std::ptrdiff_t>(i));
  }
  for (const Node& node : update.nodes) map.nodes.set(node.id, node);
  for (const MovedNode& moved : update.moved) map.nodes.find(moved.id)->map_from_node = moved.map_from_node;
  for (const Submap& submap : update.submaps) map.submaps.set(submap.id, submap);
  for (const Constraint& constraint : update.constraints) map.constraints.set(constraint.id, constraint);
  for (const Landmark& landmark : update.landmarks) map.landmarks.set(landmark.id, landmark);
  for (const LandmarkChange& change : update.changed_landmarks) {
    Landmark& landmark = *map.landmarks.find(change.id);
    landmark.point_units = change.point_units.value_or(landmark.point_units);
    std::map<NodeId, LandmarkSighting> seen;
    for (const LandmarkSighting& sighting : landmark.seen) seen[sighting.node] = sighting;
    for (const LandmarkSighting& sighting : change.seen) seen[sighting.node] = sighting;
    landmark.seen.clear();
    for (const auto& entry : seen) landmark.seen.push_back(entry.second);
  }
  return map;
}

std::map<NodeId, std::set<LandmarkId>> hanging_in(const Map& map) {
  std::map<NodeId, std::set<LandmarkId>> result;
  for (const auto& [id, landmark] : map.landmarks) {
    result[landmark.anchor].insert(id);
    for (const LandmarkSighting& sighting : landmark.seen) result[sighting.node].insert(id);
  }
  return result;
}

// A map of keyframes and landmarks that changes in every way that an update can say.
class ApplyTest : public ::testing::Test {
 protected:
  ApplyTest() {
    apply(map_, known_, difference({}, random_.keyframe_map("alpha", 24)));
    session_ = map_.nodes.front().first.session;
  }

  std::vector<NodeId> keyframes() const {
    std::vector<NodeId> result;
    for (const auto& [id, node] : map_.nodes)
      if (keyframe_of(node) != nullptr) result.push_back(id);
    return result;
  }
  bool chance(std::uint64_t one_in) { return random_.below(one_in) == 0; }

  // All that hangs on a node that goes, goes.
  void remove(MapUpdate& update, const NodeId& gone) const {
    update.removed_nodes.push_back(gone);
    for (const auto& [id, submap] : map_.submaps)
      if (std::any_of(submap.submap_from_node.begin(), submap.submap_from_node.end(),
                      [&](const auto& m) { return m.first == gone; }))
        update.removed_submaps.push_back(id);
    for (const auto& [id, constraint] : map_.constraints)
      if (id.from == gone || id.to == gone) update.removed_constraints.push_back(id);
    for (const auto& [id, landmark] : map_.landmarks)
      if (landmark.anchor == gone) update.removed_landmarks.push_back(id);
  }

  Landmark landmark(std::uint32_t index, const std::vector<NodeId>& seen) {
    Landmark result;
    result.id = {session_, index};
    result.anchor = seen.front();
    result.point_units = landmark_units({random_.uniform(-9, 9), 1.0, 2.0});
    for (const NodeId& id : seen) result.seen.push_back(random_.sighting(id));
    return result;
  }

  MapUpdate random_update() {
    MapUpdate update;
    update.origin.map = map_.id;
    update.sequence = ++sequence_;
    update.base = sequence_ - 1;
    const std::vector<NodeId> before = keyframes();
    for (const NodeId& id : before)
      if (before.size() > 6 && chance(12)) remove(update, id);
    // One of them comes back at once, and two new ones, one of a session that stands before.
    const SessionId earlier{{RobotId("aaron"), SensorId("camera")}, 5};
    const auto camera = std::get<KeyframeFeatures>(*map_.nodes.find(before.front())->payload).geometry;
    std::set<NodeId> brought = {{session_, next_++}, {earlier, next_++}};
    if (!update.removed_nodes.empty() && chance(2)) brought.insert(update.removed_nodes.front());
    for (const NodeId& id : brought)
      update.nodes.push_back({id, {static_cast<std::int64_t>(next_)}, random_.pose(), random_.keyframe(camera, 3)});
    std::sort(update.removed_nodes.begin(), update.removed_nodes.end());
    std::vector<NodeId> after;
    for (const NodeId& id : before)
      if (!std::binary_search(update.removed_nodes.begin(), update.removed_nodes.end(), id)) after.push_back(id);
    for (const NodeId& id : after) {
      if (chance(5)) update.moved.push_back({id, random_.pose()});
      if (chance(9)) {
        update.nodes.push_back(*map_.nodes.find(id));
        update.nodes.back().map_from_node = random_.pose();
      }
    }
    after.insert(after.end(), brought.begin(), brought.end());
    std::sort(after.begin(), after.end());
    const auto some_of_own = [&] {
      std::vector<NodeId> some;
      for (const NodeId& id : after)
        if (id.session == session_ && chance(4)) some.push_back(id);
      if (some.empty()) some.push_back({session_, next_ - 2});
      return some;
    };
    for (const auto& [id, old] : map_.landmarks) {
      if (chance(15)) update.removed_landmarks.push_back(id);
      if (chance(15)) update.landmarks.push_back(landmark(id.index, some_of_own()));
    }
    for (int i = 0; i < 5; ++i) update.landmarks.push_back(landmark(next_landmark_++, some_of_own()));
    Constraint constraint;
    constraint.id = {ConstraintKind::loop, after.front(), after.back(), 7};
    constraint.information = random_.symmetric();
    update.constraints = {constraint};
    Submap submap;
    submap.id = {session_, 100 + next_};
    submap.submap_from_node = {{after[1], {}}, {after.back(), random_.pose()}};
    update.submaps = {submap};
    const auto put_in_order = [](auto& ids) {
      std::sort(ids.begin(), ids.end());
      ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
    };
    put_in_order(update.removed_landmarks);
    put_in_order(update.removed_constraints);
    put_in_order(update.removed_submaps);
    std::sort(update.nodes.begin(), update.nodes.end(), [](const Node& a, const Node& b) { return a.id < b.id; });
    const auto change = [&](const LandmarkId& id) {
      LandmarkChange one{id, std::nullopt, {}};
      if (chance(2)) one.point_units = Eigen::Vector3i(1, 2, static_cast<int>(random_.below(1000)));
      for (const NodeId& node : after)
        if (chance(6)) one.seen.push_back(random_.sighting(node));
      update.changed_landmarks.push_back(one);
    };
    std::set<LandmarkId> there;
    for (const auto& [id, old] : map_.landmarks)
      if (!std::binary_search(update.removed_landmarks.begin(), update.removed_landmarks.end(), id)) there.insert(id);
    for (const Landmark& whole : update.landmarks) there.insert(whole.id);
    for (const LandmarkId& id : there)
      if (chance(6)) change(id);
    return update;
  }

  void expect_known() const {
    const auto hanging = hanging_in(map_);
    std::set<NodeId> nodes = ever_;
    for (const auto& entry : hanging) nodes.insert(entry.first);
    for (const NodeId& id : nodes) {
      const auto found = known_.at(id);
      const auto expected = hanging.find(id);
      EXPECT_EQ(std::set<LandmarkId>(found.begin(), found.end()),
                expected == hanging.end() ? std::set<LandmarkId>() : expected->second)
          << to_string(id);
      EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
    }
  }

  RandomMaps random_{11};
  Map map_;
  SessionId session_;
  LandmarksByNode known_;
  std::uint64_t sequence_ = 1;
  std::uint32_t next_ = 1000, next_landmark_ = 1000;
  std::set<NodeId> ever_;
};

TEST_F(ApplyTest, in_place_comes_to_the_same_as_value_by_value) {
  std::size_t removed = 0, came_back = 0, replaced = 0;
  for (int round = 0; round < 120; ++round) {
    const MapUpdate update = random_update();
    const Map before = map_;
    for (const auto& entry : before.nodes) ever_.insert(entry.first);
    const std::string expected = bytes_of(one_by_one(before, update));
    removed += update.removed_nodes.size();
    for (const Node& node : update.nodes)
      came_back += std::binary_search(update.removed_nodes.begin(), update.removed_nodes.end(), node.id);
    for (const Landmark& landmark : update.landmarks) replaced += before.landmarks.contains(landmark.id);
    Map looked_through = before;
    apply(looked_through, update);
    apply(map_, known_, update);
    ASSERT_EQ(bytes_of(map_), expected) << round;
    ASSERT_EQ(bytes_of(looked_through), expected) << "without what is known of nodes, " << round;
    ASSERT_EQ(bytes_of(updated(before, update)), expected) << round;
    expect_known();
    ASSERT_FALSE(HasFailure()) << round;
  }
  EXPECT_GT(removed, 50U);
  EXPECT_GT(came_back, 10U);
  EXPECT_GT(replaced, 100U);
}

TEST_F(ApplyTest, changes_nothing_where_an_update_does_not_fit) {
  const NodeId stranger{session_, 999999};
  const std::vector<std::pair<const char*, std::function<void(MapUpdate&)>>> misfits = {
      {"applied to map", [](MapUpdate& u) { u.origin.map = MapId("beta"); }},
      {"removes something",
       [&](MapUpdate& u) {
         u.removed_landmarks.push_back({session_, 999999});
       }},
      {"removes something", [&](MapUpdate& u) { u.removed_nodes.push_back(stranger); }},
      {"removes something",
       [&](MapUpdate& u) {
         u.removed_submaps.push_back({session_, 999999});
       }},
      {"removes something",
       [&](MapUpdate& u) {
         u.removed_constraints = {{ConstraintKind::loop, stranger, stranger, 9}};
       }},
      {"known with other content",
       [&](MapUpdate& u) {
         u = difference(map_, map_);
         u.nodes = {map_.nodes.front().second};
         u.nodes[0].stamp.ns += 1;
       }},
      {"moves an unknown node",
       [&](MapUpdate& u) {
         u.moved.push_back({stranger, {}});
       }},
      {"holds an unknown node", [&](MapUpdate& u) { u.submaps[0].submap_from_node[1].first = stranger; }},
      {"holds no nodes", [](MapUpdate& u) { u.submaps[0].submap_from_node.clear(); }},
      {"other content than its hash says", [](MapUpdate& u) { u.submaps[0].frozen = true; }},
      {"ends at an unknown node", [&](MapUpdate& u) { u.constraints[0].id.from = stranger; }},
      {"hangs on an unknown node", [&](MapUpdate& u) { u.landmarks.back().anchor = stranger; }},
      {"hangs on an unknown node", [&](MapUpdate& u) { u.landmarks.back().seen = {random_.sighting(stranger)}; }},
      {"anchored in another session", [](MapUpdate& u) { u.landmarks.back().anchor.session.run += 1; }},
      {"outside of the picture", [](MapUpdate& u) { u.landmarks.back().seen.back().u = 16 * 640; }},
      {"changes an unknown landmark",
       [&](MapUpdate& u) {
         u.changed_landmarks.push_back({{session_, 999999}, std::nullopt, {}});
       }},
      {"hangs on an unknown node",
       [&](MapUpdate& u) { u.changed_landmarks.back().seen = {random_.sighting(stranger)}; }},
      {"hangs on an unknown node",
       [&](MapUpdate& u) {
         u.borrowed = {{{session_, 1}, std::nullopt, {random_.sighting(stranger)}}};
       }},
  };
  for (std::size_t i = 0; i < misfits.size(); ++i) {
    MapUpdate update = random_update();
    const std::string before = bytes_of(map_);
    misfits[i].second(update);
    try {
      apply(map_, known_, update);
      ADD_FAILURE() << i << ": expected: " << misfits[i].first;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kBadInput);
      EXPECT_THAT(error.what(), ::testing::HasSubstr(misfits[i].first)) << i;
    }
    EXPECT_EQ(bytes_of(map_), before) << i;
    expect_known();
  }
}

TEST_F(ApplyTest, changes_nothing_where_something_would_be_left_hanging) {
  const NodeId gone = map_.landmarks.front().second.anchor;
  MapUpdate whole;
  whole.origin.map = map_.id;
  remove(whole, gone);
  std::vector<MapUpdate> hanging(3, whole);
  hanging[0].removed_submaps.clear();
  hanging[1].removed_constraints.clear();
  hanging[2].removed_landmarks.clear();
  const Map as_it_was = map_;
  const std::string before = bytes_of(map_);
  for (const MapUpdate& update : hanging) {
    EXPECT_THROW(apply(map_, known_, update), Error);
    EXPECT_THROW(apply(map_, update), Error);
    EXPECT_EQ(bytes_of(map_), before);
  }
  expect_known();
  apply(map_, known_, whole);
  EXPECT_EQ(bytes_of(map_), bytes_of(one_by_one(as_it_was, whole)));
}

TEST_F(ApplyTest, of_lists_out_of_order_breaks_the_contract) {
  MapUpdate update = random_update();
  std::swap(update.landmarks.front(), update.landmarks.back());
  const std::string before = bytes_of(map_);
  EXPECT_THROW(apply(map_, known_, update), ContractViolation);
  EXPECT_EQ(bytes_of(map_), before);
}

TEST(LandmarksByNode, returns_those_of_several_sessions_in_order_and_forgets_them) {
  const SessionId alpha{{RobotId("alpha"), SensorId("camera")}, 1}, beta{{RobotId("beta"), SensorId("camera")}, 1};
  const NodeId first{alpha, 0}, second{beta, 3};
  LandmarksByNode known;
  for (const LandmarkId& id : {LandmarkId{beta, 2}, LandmarkId{alpha, 9}, LandmarkId{alpha, 4}, LandmarkId{alpha, 9}})
    known.add(first, id);
  known.add(second, {beta, 2});
  EXPECT_THAT(known.at(first), ::testing::ElementsAre(LandmarkId{alpha, 4}, LandmarkId{alpha, 9}, LandmarkId{beta, 2}));
  known.remove(first, {alpha, 9});
  known.remove(first, {alpha, 5});
  known.remove(first, {beta, 2});
  known.remove(second, {alpha, 4});
  EXPECT_THAT(known.at(first), ::testing::ElementsAre(LandmarkId{alpha, 4}));
  EXPECT_THAT(known.at(second), ::testing::ElementsAre(LandmarkId{beta, 2}));
  EXPECT_TRUE(known.at({beta, 0}).empty());
}

}  // namespace
}  // namespace mapweave
