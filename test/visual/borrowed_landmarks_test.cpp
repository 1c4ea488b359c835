#include "sharing/borrowed_landmarks.h"

#include <mapweave/core/error.h>

#include <gmock/gmock.h>
#include <random>

namespace mapweave::visual {
namespace {

const SessionId kAlpha{{RobotId("alpha"), SensorId("front")}, 7};

// A camera that sees nine landmarks of others, and a keyframe for what is seen.
class BorrowedLandmarksTest : public testing::Test {
 protected:
  BorrowedLandmarksTest() {
    map.camera = {320, 240, 260.0, 260.0, 159.5, 119.5};
    map.add(Keyframe());
    std::mt19937_64 random(1);
    for (std::uint32_t i = 0; i < 9; ++i) {
      matching::DescribedLandmark one;
      one.id = {kAlpha, i};
      one.point_in_map = {-0.8 + 0.2 * i, 0.1 * (i % 3), 3.0};
      one.descriptor = {random(), random(), random(), random()};
      landmarks.push_back(one);
      const Eigen::Vector2d pixel = map.camera.project(one.point_in_map);
      features.points.push_back({static_cast<float>(pixel.x()) + 1.0F, static_cast<float>(pixel.y()), 0, 0});
      features.descriptors.push_back(one.descriptor);
    }
  }
  std::vector<Match> look(const std::vector<Match>& matches = {}, double radius_px = 5.0) {
    FeatureFrame frame;
    frame.features = features;
    frame.inverse_depths.assign(features.points.size(), 0.0F);
    return borrowed.look(map, {FrameFeatureGrid(frame, map.camera), 0.0, 0, View(), Motion()}, matches, radius_px);
  }
  void see(const std::vector<Match>& matches) {
    for (const Match& match : matches) map.see(match.landmark, {0, map.sighting_of(match, 0.5)});
  }
  LandmarkMap map;
  BorrowedLandmarks borrowed;
  std::vector<matching::DescribedLandmark> landmarks;
  matching::OrbFeatures features;
};

TEST_F(BorrowedLandmarksTest, become_landmarks_once_a_keyframe_shows_them) {
  EXPECT_EQ(borrowed.receive(map, 0, landmarks), 9);
  EXPECT_TRUE(map.landmarks.empty());
  const auto found = look();
  ASSERT_EQ(found.size(), 9U);
  for (const Match& match : found) {
    const ClientLandmark& landmark = map.landmark(match.landmark);
    ASSERT_TRUE(landmark.borrowed);
    EXPECT_EQ(landmark.point, landmarks[landmark.borrowed->id.index].point_in_map);
    EXPECT_NEAR(match.pixel.x(), map.camera.project(landmark.point).x() + 1.0, 1e-4);
  }
  see(found);
  EXPECT_TRUE(look(found).empty()) << "already matched";
  EXPECT_EQ(look().size(), 9U) << "seen again, in no other slot";
  EXPECT_EQ(map.landmarks.size(), 9U);
}

TEST_F(BorrowedLandmarksTest, are_looked_for_where_their_feature_lies_and_matched_where_they_are_themselves) {
  for (auto& one : landmarks) one.feature_from_point.y() = 3.0 * 10.0 / map.camera.fy;  // ten pixels below
  for (auto& point : features.points) point.v_px += 10.0F;
  borrowed.receive(map, 0, landmarks);
  const auto found = look();
  ASSERT_EQ(found.size(), 9U);
  for (const Match& match : found)
    EXPECT_LT((match.pixel - map.camera.project(map.landmark(match.landmark).point)).norm(), 1.01);
}

TEST_F(BorrowedLandmarksTest, are_not_looked_for_from_behind_or_far_away) {
  landmarks[0].direction = -Eigen::Vector3d::UnitZ();
  landmarks[1].nearest_m = landmarks[1].farthest_m = 0.5;
  borrowed.receive(map, 0, landmarks);
  EXPECT_EQ(look().size(), 7U);
}

TEST_F(BorrowedLandmarksTest, take_their_new_place_when_they_are_shared_again) {
  borrowed.receive(map, 0, landmarks);
  const auto found = look();
  see(found);
  for (auto& one : landmarks) one.point_in_map.z() += 0.5;
  borrowed.receive(map, 0, landmarks);
  EXPECT_EQ(borrowed.size(), 9U);
  for (const Match& match : found) EXPECT_EQ(map.landmark(match.landmark).point.z(), 3.5);
}

TEST_F(BorrowedLandmarksTest, go_where_they_are_not_found_until_they_are_said_to_be_elsewhere) {
  borrowed.receive(map, 0, landmarks);
  const auto found = look();
  see(found);
  const int liar = found[4].landmark;
  const std::uint32_t name = map.landmark(liar).borrowed->id.index;
  for (const Match& match : found) {
    map.landmark(match.landmark).tried = 12;
    map.landmark(match.landmark).found = match.landmark == liar ? 2 : 11;
  }
  borrowed.tidy(map, 0, View());
  EXPECT_TRUE(map.landmark(liar).gone);
  EXPECT_EQ(look().size(), 8U);
  landmarks[name].point_in_map.y() += 0.01;
  borrowed.receive(map, 0, {landmarks[name]});
  EXPECT_EQ(look().size(), 8U) << "hardly moved";
  landmarks[name].point_in_map.y() -= 0.04;
  borrowed.receive(map, 0, {landmarks[name]});
  EXPECT_EQ(look().size(), 9U);
}

TEST_F(BorrowedLandmarksTest, that_do_not_fit_are_landmarks_of_nobody) {
  borrowed.receive(map, 0, landmarks);
  auto found = look();
  std::vector<char> fits(found.size(), 1);
  fits[2] = fits[5] = 0;
  borrowed.keep(map, found, fits);
  EXPECT_EQ(found.size(), 7U);
  EXPECT_EQ(
      std::count_if(map.landmarks.begin(), map.landmarks.end(), [](const ClientLandmark& one) { return !one.gone; }),
      7);
  see(found);
  EXPECT_EQ(look(found).size(), 2U) << "they are looked for again";
}

TEST_F(BorrowedLandmarksTest, are_forgotten_out_of_view_and_with_their_session) {
  borrowed.receive(map, 0, landmarks);
  see(look());
  View away;
  away.translation.z() = -10.0;
  for (int i = 0; i < 25; ++i) borrowed.tidy(map, 0, away);
  EXPECT_EQ(borrowed.size(), 9U);
  for (int i = 0; i < 10; ++i) borrowed.tidy(map, 0, away);
  EXPECT_EQ(borrowed.size(), 0U);
  EXPECT_TRUE(map.keyframe(0).landmarks.empty());
  borrowed.receive(map, 0, landmarks);
  see(look());
  borrowed.forget(map, 1);
  EXPECT_EQ(borrowed.size(), 9U);
  borrowed.forget(map, 0);
  EXPECT_EQ(borrowed.size(), 0U);
  EXPECT_TRUE(map.keyframe(0).landmarks.empty());
}

TEST_F(BorrowedLandmarksTest, outlive_the_sighting_that_did_not_fit) {
  borrowed.receive(map, 0, landmarks);
  const auto found = look();
  see(found);
  map.forget(found[0].landmark, 0);
  EXPECT_TRUE(map.landmark(found[0].landmark).gone);
  EXPECT_EQ(look().size(), 9U) << "another chance";
}

}  // namespace
}  // namespace mapweave::visual
