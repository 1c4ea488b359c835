#include "mapping/culling.h"

#include <gmock/gmock.h>

namespace mapweave::visual {
namespace {

View at(double x) {
  View view;
  view.translation = Eigen::Vector3d(-x, 0, 0);
  return view;
}

// Keyframes along x, each of which sees these landmarks.
struct Story {
  LandmarkMap map;
  Story() { map.camera = {320, 240, 260.0, 260.0, 159.5, 119.5}; }
  int keyframe(int session = 0) {
    Keyframe keyframe;
    keyframe.session = session;
    keyframe.view = at(0.1 * map.keyframes_made);
    return map.add(std::move(keyframe));
  }
  int landmark(const std::vector<int>& keyframes) {
    ClientLandmark landmark;
    landmark.point = {0, 0, 3};
    landmark.appearances.push_back({Patch(), {}, keyframes.front(), View()});
    const int id = map.add(std::move(landmark));
    for (int k : keyframes) map.see(id, {k, Sighting()});
    return id;
  }
};

TEST(LandmarkMap, uses_slots_again_but_never_serial_numbers) {
  Story story;
  const int a = story.keyframe(), b = story.keyframe();
  const int landmark = story.landmark({b});
  story.map.remove_keyframe(b, a);
  EXPECT_TRUE(story.map.landmark(landmark).gone) << "nobody sees it any more";
  EXPECT_EQ(story.keyframe(), b);
  EXPECT_EQ(story.map.keyframe(b).serial, 2U);
  EXPECT_EQ(story.landmark({b}), landmark);
  EXPECT_EQ(story.map.landmark(landmark).serial, 1U);
  EXPECT_EQ(story.map.keyframe_count(), 2);
}

TEST(LandmarkMap, keeps_frames_and_looks_of_a_keyframe_that_goes_where_they_were) {
  Story story;
  const int a = story.keyframe(), b = story.keyframe(), c = story.keyframe();
  const int landmark = story.landmark({b, a, c}), seen_once_more = story.landmark({b, a});
  const View frame = at(0.37), look = story.map.view_of(story.map.landmark(landmark).appearances[0]);
  story.map.keyframe(b).frames.push_back(anchored(Stamp{5}, frame * story.map.keyframe(b).view.inverse()));
  story.map.remove_keyframe(b, a);
  ASSERT_EQ(story.map.keyframe(a).frames.size(), 1U);
  const View now = frame_from_keyframe(story.map.keyframe(a).frames[0]) * story.map.keyframe(a).view;
  EXPECT_LT((now.centre() - frame.centre()).norm(), 1e-6);
  EXPECT_TRUE(story.map.landmark(seen_once_more).gone);
  EXPECT_LT((story.map.view_of(story.map.landmark(landmark).appearances[0]).centre() - look.centre()).norm(), 1e-9);
}

TEST(LandmarkMap, gives_back_the_room_of_keyframes_that_see_a_landmark_no_more) {
  Story story;
  std::vector<int> all;
  for (int i = 0; i < 100; ++i) all.push_back(story.keyframe());
  const int landmark = story.landmark(all);
  for (int k : all)
    if (k >= 3) story.map.forget(landmark, k);
  EXPECT_EQ(story.map.landmark(landmark).seen.size(), 3U);
  EXPECT_LT(story.map.landmark(landmark).seen.capacity(), 12U);
}

TEST(LandmarkMap, fuses_two_landmarks_into_one_that_every_keyframe_sees_once) {
  Story story;
  const int a = story.keyframe(), b = story.keyframe(), c = story.keyframe();
  const int kept = story.landmark({a, b}), other = story.landmark({b, c});
  story.map.fuse(kept, other);
  EXPECT_TRUE(story.map.landmark(other).gone);
  EXPECT_EQ(story.map.landmark(kept).seen.size(), 3U);
  for (int k : {a, b, c}) EXPECT_THAT(story.map.keyframe(k).landmarks, testing::ElementsAre(kept));
}

TEST(Culling, removes_landmarks_that_are_looked_for_in_vain) {
  Story story;
  const int a = story.keyframe();
  const int lost = story.landmark({a}), found = story.landmark({a});
  story.map.recent_landmarks = {{lost, 0}, {found, 0}};
  story.map.landmark(lost).tried = 10;
  story.map.landmark(lost).found = 1;
  story.map.landmark(found).tried = 10;
  story.map.landmark(found).found = 9;
  cull_landmarks(story.map, a, {});
  EXPECT_TRUE(story.map.landmark(lost).gone);
  EXPECT_FALSE(story.map.landmark(found).gone);
}

TEST(Culling, removes_a_keyframe_whose_landmarks_three_others_see_but_no_recent_one) {
  Story story;
  std::vector<int> all;
  for (int i = 0; i < 8; ++i) all.push_back(story.keyframe());
  for (int i = 0; i < 20; ++i) story.landmark(all);
  const int number = keyframe_to_cull(story.map, all.back(), {});
  EXPECT_GT(number, all[0]);
  EXPECT_LT(number, all[5]);
  MemoryOptions options;
  options.redundant_views = 20;
  EXPECT_EQ(keyframe_to_cull(story.map, all.back(), options), -1);
}

TEST(Culling, holds_the_bound_on_keyframes_at_the_least_loss) {
  Story story;
  std::vector<int> all;
  for (int i = 0; i < 30; ++i) all.push_back(story.keyframe());
  for (int k : all)
    for (int i = 0; i < (k == 7 ? 2 : 5); ++i) story.landmark({k});
  MemoryOptions options;
  options.keyframes = 29;
  EXPECT_EQ(keyframe_to_cull(story.map, all.back(), options), -1) << "each shows something of its own";
  EXPECT_EQ(keyframe_to_forget(story.map, all.back(), options), 7);
  story.map.remove_keyframe(7, new_parent_of(story.map, 7));
  EXPECT_EQ(keyframe_to_forget(story.map, all.back(), options), -1);
}

TEST(LandmarkMap, remembers_where_a_keyframe_was_that_it_forgot) {
  Story story;
  std::vector<int> all;
  for (int i = 0; i < 4; ++i) all.push_back(story.keyframe());
  const int alone = story.landmark({all[1]}), shared = story.landmark({all[0], all[1], all[2]});
  story.map.remembers_forgotten = true;
  const View forgotten = story.map.keyframe(all[1]).view;
  const std::uint32_t serial = story.map.keyframe(all[1]).serial, landmark = story.map.landmark(alone).serial;
  story.map.forget_keyframe(all[1], all[0]);
  EXPECT_THAT(story.map.forgotten_landmarks, testing::ElementsAre(landmark));
  EXPECT_FALSE(story.map.landmark(shared).gone);
  story.map.remove_keyframe(all[0], all[2]);
  ASSERT_EQ(story.map.keyframe(all[2]).forgotten.size(), 1U) << "it hangs on who takes over";
  const ForgottenKeyframe& one = story.map.keyframe(all[2]).forgotten.front();
  EXPECT_EQ(one.serial, serial);
  const View now = frame_from_keyframe(one.place) * story.map.keyframe(all[2]).view;
  EXPECT_LT((now.centre() - forgotten.centre()).norm(), 1e-5);
}

TEST(Culling, thins_a_trajectory_that_is_too_long_but_leaves_every_keyframe_a_frame) {
  Story story;
  const int a = story.keyframe(), b = story.keyframe();
  story.map.keyframe(a).frames.push_back(anchored(Stamp{1}, View()));
  for (int i = 2; i < 9; ++i) story.map.keyframe(b).frames.push_back(anchored(Stamp{i}, View()));
  EXPECT_EQ(thin_frames(story.map, 8), 8U) << "no longer than it may be";
  EXPECT_EQ(thin_frames(story.map, 7), 5U);
  EXPECT_EQ(story.map.keyframe(a).frames.size(), 1U);
  std::vector<std::int64_t> stamps;
  for (const AnchoredFrame& frame : story.map.keyframe(b).frames) stamps.push_back(frame.stamp.ns);
  EXPECT_THAT(stamps, testing::ElementsAre(2, 4, 6, 8));
  EXPECT_EQ(thin_frames(story.map, 1), 3U);
  EXPECT_EQ(thin_frames(story.map, 1), 2U);
  EXPECT_EQ(thin_frames(story.map, 1), 2U) << "one for each keyframe";
}

}  // namespace
}  // namespace mapweave::visual
