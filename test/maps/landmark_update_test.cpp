#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <support/random_map.h>

#include <functional>

namespace mapweave {
namespace {

using test::RandomMaps;

// Everything a map holds, bit for bit.
std::string bytes_of(const Map& map) { return encode(difference({}, map)); }

void expect_misfit(const Map& map, const MapUpdate& update, const std::string& words) {
  try {
    updated(map, update);
    ADD_FAILURE() << "expected: " << words;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    EXPECT_THAT(error.what(), ::testing::HasSubstr(words));
    EXPECT_FALSE(error.remedy().empty());
  }
}

class LandmarkUpdate : public ::testing::Test {
 protected:
  SessionId session() const { return map_.nodes.front().first.session; }
  // Of map_ and what `change` makes of it; leads there.
  MapUpdate update_of(const std::function<void(Map&)>& change) {
    Map newer = map_;
    change(newer);
    MapUpdate update = difference(map_, newer);
    EXPECT_EQ(bytes_of(updated(map_, update)), bytes_of(newer));
    return decode_map_update(encode(update), "here");
  }
  Landmark& first(Map& map) const { return map.landmarks.begin()->second; }

  RandomMaps random_{7};
  Map map_ = random_.keyframe_map("alpha", 40);
  MapUpdate nothing_ = difference(map_, map_);
};

TEST_F(LandmarkUpdate, of_a_map_and_itself_is_empty) {
  EXPECT_TRUE(nothing_.nodes.empty() && nothing_.landmarks.empty() && nothing_.changed_landmarks.empty() &&
              nothing_.removed_landmarks.empty());
}

TEST_F(LandmarkUpdate, leads_from_any_state_of_a_map_to_any_other) {
  const Map other = random_.keyframe_map("alpha", 23);
  EXPECT_EQ(bytes_of(updated(map_, difference(map_, other))), bytes_of(other));
  EXPECT_EQ(bytes_of(updated(other, difference(other, map_))), bytes_of(map_));
}

TEST_F(LandmarkUpdate, may_come_twice) {
  const MapUpdate whole = difference({}, map_);
  EXPECT_EQ(bytes_of(updated(updated({}, whole), whole)), bytes_of(map_));
}

TEST_F(LandmarkUpdate, says_only_what_is_new_of_landmarks_that_moved_or_were_seen_again) {
  const NodeId last = map_.nodes.back().first.index % 4 == 3 ? NodeId{session(), 38} : map_.nodes.back().first;
  const MapUpdate update = update_of([&](Map& newer) {
    first(newer).point_units.x() += 7;
    Landmark& seen_again = (newer.landmarks.begin() + 4)->second;
    seen_again.seen.push_back(random_.sighting(last));
    (newer.landmarks.begin() + 8)->second.seen.front().u ^= 1;
  });
  EXPECT_TRUE(update.landmarks.empty());
  ASSERT_EQ(update.changed_landmarks.size(), 3U);
  EXPECT_TRUE(update.changed_landmarks[0].point_units);
  EXPECT_TRUE(update.changed_landmarks[0].seen.empty());
  EXPECT_FALSE(update.changed_landmarks[1].point_units);
  ASSERT_EQ(update.changed_landmarks[1].seen.size(), 1U);
  EXPECT_EQ(update.changed_landmarks[1].seen[0].node, last);
  EXPECT_EQ(update.changed_landmarks[2].seen.size(), 1U);
  EXPECT_EQ(bytes_of(updated(updated(map_, update), update)), bytes_of(updated(map_, update))) << "it may come twice";
}

TEST_F(LandmarkUpdate, sends_a_landmark_whole_when_more_of_it_changes) {
  const MapUpdate update = update_of([&](Map& newer) {
    first(newer).colour[1] ^= 1;
    (newer.landmarks.begin() + 3)->second.anchor = {session(), 6};
    (newer.landmarks.begin() + 6)->second.seen.pop_back();
  });
  EXPECT_TRUE(update.changed_landmarks.empty());
  EXPECT_EQ(update.landmarks.size(), 3U);
}

TEST_F(LandmarkUpdate, removes_landmarks) {
  const LandmarkId id = map_.landmarks.front().first;
  const MapUpdate update = update_of([&](Map& newer) { newer.landmarks.erase(id); });
  EXPECT_EQ(update.removed_landmarks, std::vector<LandmarkId>{id});
  EXPECT_TRUE(update.landmarks.empty() && update.changed_landmarks.empty());
}

TEST_F(LandmarkUpdate, of_a_keyframe_that_goes_says_nothing_of_the_landmarks_that_it_saw) {
  map_.submaps = {};
  const NodeId gone{session(), 10};
  std::size_t saw = 0, anchored = 0;
  const MapUpdate update = update_of([&](Map& newer) {
    newer.nodes.erase(gone);
    for (const std::uint32_t next : {10U, 11U})
      newer.constraints.erase({ConstraintKind::odometry, {session(), next - 1}, {session(), next}, 0});
    std::vector<LandmarkId> without_anchor;
    for (auto& [id, landmark] : newer.landmarks) {
      auto& seen = landmark.seen;
      const auto place =
          std::find_if(seen.begin(), seen.end(), [&](const auto& sighting) { return sighting.node == gone; });
      if (place == seen.end()) continue;
      seen.erase(place);
      ++saw;
      if (landmark.anchor == gone) without_anchor.push_back(id);
    }
    anchored = without_anchor.size();
    for (const LandmarkId& id : without_anchor) newer.landmarks.erase(id);
  });
  EXPECT_GT(saw, anchored);
  EXPECT_EQ(update.removed_landmarks.size(), anchored);
  EXPECT_TRUE(update.landmarks.empty() && update.changed_landmarks.empty());
}

TEST_F(LandmarkUpdate, moves_landmarks_with_their_keyframe_without_a_word) {
  const MapUpdate update = update_of([](Map& newer) { newer.nodes.begin()->second.map_from_node.t.x() += 1.0; });
  EXPECT_EQ(update.moved.size(), 1U);
  EXPECT_TRUE(update.landmarks.empty() && update.changed_landmarks.empty());
}

TEST_F(LandmarkUpdate, keeps_sightings_by_other_robots) {
  const Map beta = random_.keyframe_map("beta", 6);
  const MapUpdate update = update_of([&](Map& newer) {
    for (const auto& [id, node] : beta.nodes) newer.nodes.set(id, node);
    first(newer).seen.push_back(random_.sighting(beta.nodes.front().first));
  });
  EXPECT_EQ(update.changed_landmarks.size(), 1U);
}

TEST_F(LandmarkUpdate, is_refused_when_it_names_what_nobody_knows) {
  MapUpdate update = nothing_;
  update.removed_landmarks = {{session(), 9999}};
  expect_misfit(map_, update, "removes something that is not there");

  update = nothing_;
  update.changed_landmarks = {{{session(), 9999}, std::nullopt, {}}};
  expect_misfit(map_, update, "changes an unknown landmark");

  update = nothing_;
  update.landmarks = {map_.landmarks.front().second};
  update.landmarks[0].seen.push_back(random_.sighting({session(), 9999}));
  expect_misfit(map_, update, "hangs on an unknown node");

  update.landmarks = {map_.landmarks.front().second};
  update.landmarks[0].anchor.index = 9999;
  expect_misfit(map_, update, "hangs on an unknown node");

  update = nothing_;
  update.changed_landmarks = {{map_.landmarks.front().first, std::nullopt, {random_.sighting({session(), 9999})}}};
  expect_misfit(map_, update, "hangs on an unknown node");
}

TEST_F(LandmarkUpdate, is_refused_when_its_sessions_are_foreign) {
  const SessionId stranger{{RobotId("mallory"), SensorId("camera")}, 4};
  MapUpdate update = nothing_;
  update.landmarks = {map_.landmarks.front().second};
  update.landmarks[0].id.session = stranger;
  expect_misfit(map_, update, "anchored in another session than its own");
  update.landmarks[0].anchor.session = stranger;
  expect_misfit(map_, update, "hangs on an unknown node");
}

TEST_F(LandmarkUpdate, is_refused_when_a_node_that_it_names_is_no_keyframe) {
  const NodeId bare{session(), 3};
  ASSERT_EQ(map_.nodes.find(bare)->payload, nullptr);
  nothing_.landmarks = {map_.landmarks.front().second};
  nothing_.landmarks[0].seen = {random_.sighting(bare)};
  expect_misfit(map_, nothing_, "a node without keyframe");
  nothing_.landmarks[0].seen = {};
  nothing_.landmarks[0].anchor = bare;
  expect_misfit(map_, nothing_, "a node without keyframe");

  const Map laser = random_.map("alpha", 3);
  MapUpdate update = difference(laser, laser);
  Landmark landmark;
  landmark.id.session = landmark.anchor.session = laser.nodes.front().first.session;
  update.landmarks = {landmark};
  expect_misfit(laser, update, "a node without keyframe");
}

TEST_F(LandmarkUpdate, is_refused_when_it_leaves_a_landmark_without_its_anchor) {
  Map map = map_;
  map.submaps = {};
  map.constraints = {};
  nothing_.removed_nodes = {map.landmarks.front().second.anchor};
  expect_misfit(map, nothing_, "hangs on an unknown node");
}

TEST_F(LandmarkUpdate, is_refused_when_something_is_seen_outside_of_a_picture) {
  LandmarkSighting sighting = map_.landmarks.front().second.seen.front();
  sighting.u = 16 * 640;
  nothing_.changed_landmarks = {{map_.landmarks.front().first, std::nullopt, {sighting}}};
  expect_misfit(map_, nothing_, "seen outside of the picture");
  sighting.u -= 1;
  nothing_.changed_landmarks[0].seen = {sighting};
  EXPECT_EQ(updated(map_, nothing_).landmarks.front().second.seen.front().u, 16 * 640 - 1);
}

TEST_F(LandmarkUpdate, names_borrowed_landmarks_of_other_maps_which_are_none_of_this_one) {
  const LandmarkId foreign{{{RobotId("beta"), SensorId("camera")}, 4}, 17};
  nothing_.borrowed = {{foreign, std::nullopt, {map_.landmarks.front().second.seen.front()}}};
  const Map same = updated(map_, nothing_);
  EXPECT_EQ(same.landmarks.size(), map_.landmarks.size());
  EXPECT_FALSE(same.landmarks.contains(foreign));
  nothing_.borrowed[0].seen[0].u = 16 * 640;
  expect_misfit(map_, nothing_, "seen outside of the picture");
  nothing_.borrowed[0].seen = {random_.sighting({session(), 9999})};
  expect_misfit(map_, nothing_, "hangs on an unknown node");
}

TEST_F(LandmarkUpdate, of_changed_features_breaks_the_contract) {
  Map changed = map_;
  Node& node = changed.nodes.begin()->second;
  KeyframeFeatures keyframe = std::get<KeyframeFeatures>(*node.payload);
  keyframe.descriptors[0][0] ^= 1;
  node.payload = std::make_shared<const Payload>(keyframe);
  EXPECT_THROW(difference(map_, changed), ContractViolation);
  nothing_.nodes = {node};
  expect_misfit(map_, nothing_, "known with other content");
}

}  // namespace
}  // namespace mapweave
