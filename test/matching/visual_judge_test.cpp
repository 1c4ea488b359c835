#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/matching/visual_judge.h>

#include <memory>
#include <random>

namespace mapweave::matching {
namespace {

class Draws {
 public:
  explicit Draws(std::uint64_t seed) : random_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(random_() >> 11) * 0x1p-53;
  }
  std::uint64_t bits() { return random_(); }
  OrbDescriptor descriptor() { return {random_(), random_(), random_(), random_()}; }
  OrbDescriptor with_flips(OrbDescriptor descriptor, int flips) {
    for (int i = 0; i < flips; ++i) {
      const std::uint64_t bit = random_() % 256;
      descriptor[bit / 64] ^= std::uint64_t{1} << (bit % 64);
    }
    return descriptor;
  }

 private:
  std::mt19937_64 random_;
};

const Pinhole kCamera{640, 480, 520.0, 520.0, 320.0, 240.0};

struct Thing {
  Eigen::Vector3d at;  // world
  OrbDescriptor looks{};
};
using Room = std::vector<Thing>;

Room room(std::uint64_t seed, int things = 300) {
  Draws draws(seed);
  Room room;
  for (int i = 0; i < things; ++i)
    room.push_back({{draws.uniform(-3, 3), draws.uniform(-2, 2), draws.uniform(2.5, 5)}, draws.descriptor()});
  return room;
}

Pose3 pose(double x, double y, double z, double yaw) {
  Pose3 pose;
  pose.t = {x, y, z};
  pose.q = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY());
  return pose;
}

struct SideOptions {
  bool with_map = true;
  double unit = 1.0;  // metres of the world in one of the side
  int strangers = 100;
  double noise_px = 0.5;
};

// What a robot makes of a room from some poses; the side's frame is that of its first camera.
struct Side {
  PlaceView view;
  Pose3 world_from_side;
  std::vector<std::unique_ptr<OrbFeatures>> features;
  std::vector<std::unique_ptr<std::vector<std::int32_t>>> landmark_of_feature;

  Side(std::uint32_t index, const Room& room, const std::vector<Pose3>& world_from_cameras,
       const SideOptions& options = {}) {
    Draws draws(100 + index);
    world_from_side = world_from_cameras.front();
    view.id = {{{RobotId("alpha"), SensorId("camera")}, 1}, index};
    view.content = hash_of_bytes(std::to_string(index));
    view.metric = options.unit == 1.0;
    std::vector<std::int32_t> landmark_of_thing(room.size(), -1);
    for (const Pose3& world_from_camera : world_from_cameras) {
      auto seen = std::make_unique<OrbFeatures>();
      auto landmarks = std::make_unique<std::vector<std::int32_t>>();
      for (std::size_t i = 0; i < room.size(); ++i) {
        const Eigen::Vector3d point = transformed(room[i].at, inverse(world_from_camera));
        if (point.z() < 0.2 || !kCamera.shows(kCamera.project(point))) continue;
        const Eigen::Vector2d pixel =
            kCamera.project(point) + options.noise_px * Eigen::Vector2d(draws.uniform(-1, 1), draws.uniform(-1, 1));
        seen->points.push_back({static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 10.0f, 0});
        seen->descriptors.push_back(draws.with_flips(room[i].looks, 10));
        if (options.with_map && landmark_of_thing[i] < 0) {
          landmark_of_thing[i] = static_cast<std::int32_t>(view.landmarks.size());
          const Eigen::Vector3d in_side = transformed(room[i].at, inverse(world_from_side));
          view.landmarks.push_back({in_side * draws.uniform(0.99, 1.01) / options.unit, seen->descriptors.back()});
        }
        landmarks->push_back(landmark_of_thing[i]);
      }
      for (int i = 0; i < options.strangers; ++i) {
        seen->points.push_back(
            {static_cast<float>(draws.uniform(0, 639)), static_cast<float>(draws.uniform(0, 479)), 10.0f, 0});
        seen->descriptors.push_back(draws.descriptor());
        landmarks->push_back(-1);
      }
      KeyframeView keyframe;
      keyframe.camera = kCamera;
      keyframe.side_from_camera = between(world_from_side, world_from_camera);
      keyframe.side_from_camera.t /= options.unit;
      keyframe.features = view_of(*seen);
      keyframe.landmark_of_feature = landmarks->data();
      view.keyframes.push_back(keyframe);
      features.push_back(std::move(seen));
      landmark_of_feature.push_back(std::move(landmarks));
    }
  }
};

void expect_right(const VisualJudgement& result, const Side& a, const Side& b, double scale = 1.0) {
  ASSERT_FALSE(result.judgement.hypotheses.empty());
  const Sim3& found = result.judgement.hypotheses.front().a_from_b;
  const Pose3 error = between(between(a.world_from_side, b.world_from_side), found.pose);
  EXPECT_LT(error.t.norm(), 0.05);
  EXPECT_LT(2.0 * error.q.vec().norm(), 0.015);
  EXPECT_NEAR(found.scale, scale, 0.02 * scale);
  EXPECT_EQ(result.judgement.doubt, Reason::none);
  EXPECT_GT(result.judgement.probability, 0.8);
}

TEST(VisualJudge, aligns_two_views_of_one_room) {
  const Room one = room(1);
  const Side a(1, one, {pose(0, 0, 0, 0)}), b(2, one, {pose(0.5, 0.1, 0.4, 0.2)});
  const VisualJudgement result = judge_places(a.view, b.view);
  expect_right(result, a, b);
  EXPECT_GT(result.matches.size(), 60U);
  for (const auto& match : result.matches)  // the same thing on both sides
    EXPECT_LE(hamming(a.features[0]->descriptors[match.a.feature], b.features[0]->descriptors[match.b.feature]), 20);
  const auto& covariance = result.judgement.hypotheses.front().covariance;
  EXPECT_GT(covariance.diagonal().minCoeff(), 0.0);
  EXPECT_LT(covariance.diagonal().maxCoeff(), 0.01);
  EXPECT_EQ(result.judgement.a, a.view.id);
  EXPECT_EQ(result.judgement.id, visual_judgement_id(a.view.content, b.view.content, {}));
}

TEST(VisualJudge, finds_a_picture_in_a_map) {
  const Room one = room(2);
  SideOptions picture;
  picture.with_map = false;
  const Side a(1, one, {pose(0, 0, 0, 0)}), b(2, one, {pose(0.5, 0.1, 0.4, 0.2)}, picture);
  expect_right(judge_places(a.view, b.view), a, b);
  const Side c(3, one, {pose(0, 0, 0, 0)}, picture), d(4, one, {pose(0.5, 0.1, 0.4, 0.2)});  // the map is the second
  expect_right(judge_places(c.view, d.view), c, d);
  const Side e(5, one, {pose(0.5, 0.1, 0.4, 0.2)}, picture);  // two pictures have no points
  EXPECT_TRUE(judge_places(c.view, e.view).judgement.hypotheses.empty());
}

TEST(VisualJudge, finds_the_scale_of_a_map_without_one) {
  const Room one = room(3);
  SideOptions mono;
  mono.unit = 0.4;
  const Side a(1, one, {pose(0, 0, 0, 0)}), b(2, one, {pose(0.5, 0.1, 0.4, 0.2)}, mono);
  expect_right(judge_places(a.view, b.view), a, b, 0.4);
}

TEST(VisualJudge, finds_more_with_neighbours) {
  const Room one = room(4);
  const std::vector<Pose3> near = {pose(0, 0, 0, 0), pose(0.6, 0, 0, 0.3), pose(-0.6, 0, 0, -0.3)};
  SideOptions picture;
  picture.with_map = false;
  const Side alone(1, one, {near[0]}), together(1, one, near), b(2, one, {pose(0.6, 0.1, 0.2, 0.5)}, picture);
  const VisualJudgement few = judge_places(alone.view, b.view), more = judge_places(together.view, b.view);
  EXPECT_GT(more.matches.size(), few.matches.size() + 15);
  expect_right(more, together, b);
}

TEST(VisualJudge, finds_nothing_in_another_room) {
  const Side a(1, room(5), {pose(0, 0, 0, 0)}), b(2, room(6), {pose(0, 0, 0, 0)});
  const VisualJudgement result = judge_places(a.view, b.view);
  EXPECT_EQ(result.judgement.probability, 0.0);
  EXPECT_EQ(result.judgement.doubt, Reason::little_overlap);
  EXPECT_TRUE(result.matches.empty());
}

TEST(VisualJudge, refuses_a_poster_that_hangs_twice) {
  // b sees a poster that hangs at two places in a; one of them looks a little more alike.
  Draws draws(9);
  Room two, single;
  for (int i = 0; i < 80; ++i) {
    const Thing thing{{draws.uniform(-0.6, 0.6), draws.uniform(-0.8, 0.8), draws.uniform(3.9, 4.1)},
                      draws.descriptor()};
    single.push_back(thing);
    two.push_back({thing.at - Eigen::Vector3d(1.2, 0, 0), thing.looks});
    two.push_back({thing.at + Eigen::Vector3d(1.2, 0, 0), draws.with_flips(thing.looks, 24)});
  }
  VisualJudgeOptions options;
  options.matching.ratio = 0.95;
  const Side a(1, two, {pose(0, 0, 0, 0)}), b(2, single, {pose(0, 0, 1.0, 0)});
  const VisualJudgement result = judge_places(a.view, b.view, options);
  EXPECT_EQ(result.judgement.doubt, Reason::ambiguous);
  EXPECT_GT(result.judgement.evidence.second_best_ratio, 0.6);
  EXPECT_GE(result.judgement.hypotheses.size(), 2U);
  EXPECT_LT(result.judgement.probability, 0.1);
  options.max_second_best = 1.0;
  EXPECT_EQ(judge_places(a.view, b.view, options).judgement.doubt, Reason::none);  // nothing else speaks against it
  options.max_second_best = VisualJudgeOptions{}.max_second_best;
  const Side c(3, single, {pose(0.2, 0, 0.2, 0)});  // hangs once
  EXPECT_EQ(judge_places(b.view, c.view, options).judgement.doubt, Reason::none);
}

TEST(VisualJudge, refuses_what_agrees_in_one_corner_of_the_picture_only) {
  Draws draws(9);
  Room shelf = room(10, 0);
  for (int i = 0; i < 60; ++i)
    shelf.push_back({{draws.uniform(1.0, 1.2), draws.uniform(0.8, 1.0), draws.uniform(3.9, 4.1)}, draws.descriptor()});
  const Side a(1, shelf, {pose(0, 0, 0, 0)}), b(2, shelf, {pose(0.1, 0, 0, 0)});
  const VisualJudgement result = judge_places(a.view, b.view);
  EXPECT_EQ(result.judgement.doubt, Reason::unobservable);
  EXPECT_LT(result.judgement.probability, 0.1);
}

TEST(VisualJudge, doubts_what_the_other_side_saw_through) {
  // A poster was carried one room further: it looks the same, and behind it b sees a wall that a's poster would hide.
  Draws draws(11);
  Room poster, here = room(12, 0), there = room(13, 0);
  for (int i = 0; i < 40; ++i)
    poster.push_back({{draws.uniform(-0.8, 0.8), draws.uniform(-0.8, 0.8), 4.0}, draws.descriptor()});
  here = there = poster;
  for (int i = 0; i < 200; ++i)
    here.push_back({{draws.uniform(-2, 2), draws.uniform(-1.5, 1.5), 2.4}, draws.descriptor()});
  for (int i = 0; i < 400; ++i)
    there.push_back({{draws.uniform(-4, 4), draws.uniform(-3, 3), 7.0}, draws.descriptor()});
  const Side a(1, here, {pose(0, 0, 0, 0)}), b(2, there, {pose(0.1, 0, 0, 0)});
  const VisualJudgement result = judge_places(a.view, b.view);
  EXPECT_EQ(result.judgement.doubt, Reason::contradiction);
  EXPECT_GT(result.judgement.evidence.conflict, 0.35);
  EXPECT_LT(result.judgement.probability, 0.1);
  VisualJudgeOptions trusting;
  trusting.max_conflict = 1.0;
  EXPECT_NE(judge_places(a.view, b.view, trusting).judgement.doubt, Reason::contradiction);  // nor is too little found
}

TEST(VisualJudge, gives_the_same_bits_again) {
  const Room one = room(1);
  const Side a(1, one, {pose(0, 0, 0, 0)}), b(2, one, {pose(0.5, 0.1, 0.4, 0.2)});
  const VisualJudgement first = judge_places(a.view, b.view), second = judge_places(a.view, b.view);
  EXPECT_EQ(first.judgement.probability, second.judgement.probability);
  EXPECT_EQ(first.judgement.hypotheses.front().a_from_b.pose.t, second.judgement.hypotheses.front().a_from_b.pose.t);
  EXPECT_EQ(first.judgement.hypotheses.front().covariance, second.judgement.hypotheses.front().covariance);
}

TEST(VisualJudge, survives_views_without_features_and_asks_for_sound_ones) {
  const Side a(1, room(1), {pose(0, 0, 0, 0)});
  SideOptions blank;
  blank.strangers = 0;
  const Side nothing(2, {}, {pose(0, 0, 0, 0)}, blank);
  EXPECT_EQ(judge_places(a.view, nothing.view).judgement.doubt, Reason::little_overlap);
  EXPECT_THROW(judge_places(nothing.view, a.view), ContractViolation);
  PlaceView broken = nothing.view;
  broken.keyframes.front().camera.fx = 0.0;
  EXPECT_THROW(judge_places(a.view, broken), ContractViolation);
  broken.keyframes.clear();
  EXPECT_THROW(judge_places(a.view, broken), ContractViolation);
}

}  // namespace
}  // namespace mapweave::matching
