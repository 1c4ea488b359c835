#include <mapweave/core/error.h>
#include <mapweave/matching/landmark_description.h>
#include <mapweave/matching/landmark_index.h>
#include <support/random_map.h>

#include <gmock/gmock.h>

namespace mapweave::matching {
namespace {

const SessionId kAlpha{{RobotId("alpha"), SensorId("front")}, 7}, kBeta{{RobotId("beta"), SensorId("front")}, 5};
const Pinhole kPinhole{640, 480, 500.0, 510.0, 318.0, 243.0};
// Optical axes of a camera that looks along x of the map, y to the left, z up.
const Eigen::Quaterniond kForward(0.5, -0.5, 0.5, -0.5);

DescribedLandmark landmark(std::uint32_t index, const Eigen::Vector3d& point) {
  DescribedLandmark result;
  result.id = {kAlpha, index};
  result.point_in_map = point;
  result.updated_by = kAlpha.client;
  return result;
}

Frustum looking(const Eigen::Vector3d& from, double yaw, double pitch) {
  Frustum frustum;
  frustum.pinhole = kPinhole;
  frustum.map_from_camera = {from, Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())) *
                                       Eigen::Quaterniond(Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY())) *
                                       kForward};
  return frustum;
}

std::vector<std::uint32_t> indices(const std::vector<DescribedLandmark>& landmarks) {
  std::vector<std::uint32_t> result;
  for (const DescribedLandmark& one : landmarks) result.push_back(one.id.index);
  return result;
}

// By the definition, one after the other.
bool is_retrieved(const DescribedLandmark& one, const Frustum& frustum, const RetrievalOptions& options) {
  const Eigen::Vector3d p = transformed(one.point_in_map, inverse(frustum.map_from_camera));
  if (p.z() < frustum.near_m || p.z() > frustum.far_m) return false;
  const double u = kPinhole.cx + kPinhole.fx * p.x() / p.z(), v = kPinhole.cy + kPinhole.fy * p.y() / p.z(),
               m = options.margin_px;
  if (u < -m || v < -m || u > kPinhole.width - 1 + m || v > kPinhole.height - 1 + m) return false;
  const Eigen::Vector3d ray = one.point_in_map - frustum.map_from_camera.t;
  if (one.direction.norm() > 0.0 &&
      std::acos(std::min(1.0, ray.normalized().dot(one.direction))) > options.most_turn_rad)
    return false;
  return one.farthest_m == 0.0 || (ray.norm() * options.most_range_ratio >= one.nearest_m &&
                                   ray.norm() <= one.farthest_m * options.most_range_ratio);
}

class RandomLandmarks : public test::RandomMaps {
 public:
  using RandomMaps::RandomMaps;
  DescribedLandmark next(std::uint32_t index, const Eigen::Vector3d& around) {
    DescribedLandmark one =
        landmark(index, around + Eigen::Vector3d(uniform(-12, 12), uniform(-12, 12), uniform(-2, 3)));
    if (below(4) == 0)
      one.point_in_map.head<2>() = (2.0 * one.point_in_map.head<2>()).array().round() / 2.0;  // on corners of cells
    if (below(3) > 0) one.direction = Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-0.3, 0.3)).normalized();
    if (below(3) > 0) {
      one.nearest_m = uniform(0.5, 5);
      one.farthest_m = one.nearest_m + uniform(0, 4);
    }
    return one;
  }
  Frustum camera(const Eigen::Vector3d& around) {
    const double kPitches[] = {0.0, M_PI / 2, -M_PI / 2, uniform(-1.5, 1.5)};
    Frustum frustum = looking(around + Eigen::Vector3d(uniform(-10, 10), uniform(-10, 10), uniform(-1, 2)),
                              uniform(-4, 4), kPitches[below(4)]);
    if (below(4) == 0) frustum.map_from_camera.q = (frustum.map_from_camera.q * pose().q).normalized();
    frustum.near_m = uniform(0.05, 1.0);
    frustum.far_m = frustum.near_m + uniform(0.1, 12.0);
    return frustum;
  }
};

class LandmarkIndexAgainstBruteForce : public testing::TestWithParam<bool> {};

TEST_P(LandmarkIndexAgainstBruteForce, retrieves_the_same_for_any_camera_while_landmarks_come_move_and_go) {
  std::size_t retrieved = 0, cameras_that_see = 0;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    RandomLandmarks random(seed);
    const Eigen::Vector3d around(random.uniform(-60, 60), random.uniform(-60, 60), 0.0);  // maps reach below zero
    LandmarkIndex index({random.uniform(0.1, 3.0), GetParam()});
    std::map<std::uint32_t, DescribedLandmark> known;
    for (int round = 0; round < 20; ++round) {
      for (int change = 0; change < 150; ++change) {
        const auto number = static_cast<std::uint32_t>(random.below(1500));
        if (random.below(4) == 0) {
          EXPECT_EQ(index.remove({kAlpha, number}), known.erase(number) == 1);
        } else {
          known[number] = random.next(number, around);
          index.set(known[number]);
        }
      }
      ASSERT_EQ(index.size(), known.size());
      const Frustum frustum = random.camera(around);
      RetrievalOptions options;
      options.margin_px = random.uniform(0, 30);
      options.most_turn_rad = random.uniform(0.2, 3.0);
      options.most = 100000;
      std::vector<std::uint32_t> expected;
      for (const auto& [number, one] : known)
        if (is_retrieved(one, frustum, options)) expected.push_back(number);
      EXPECT_EQ(indices(index.retrieve(frustum, options)), expected) << "seed " << seed << " round " << round;
      retrieved += expected.size();
      cameras_that_see += !expected.empty();
    }
  }
  EXPECT_GT(cameras_that_see, 150U);
  EXPECT_GT(retrieved, 3000U);
}
INSTANTIATE_TEST_SUITE_P(FlatAndSpatial, LandmarkIndexAgainstBruteForce, testing::Bool());

TEST(LandmarkIndex, finds_what_lies_in_cells_whose_middle_is_outside_of_the_frustum) {
  LandmarkIndex index({4.0, false});
  index.set(landmark(1, {5.0, 0.1, 0.0}));  // the cell's middle is at (6, 2)
  Frustum frustum = looking({0, 0, 0}, 0.0, 0.0);
  frustum.far_m = 5.5;
  EXPECT_THAT(indices(index.retrieve(frustum)), testing::ElementsAre(1));
}

TEST(LandmarkIndex, looks_straight_down_and_straight_up) {
  LandmarkIndex index;
  index.set(landmark(1, {-3.2, -7.1, -2.0}));
  index.set(landmark(2, {-3.2, -7.1, 2.0}));
  EXPECT_THAT(indices(index.retrieve(looking({-3, -7, 0}, 0.4, M_PI / 2))), testing::ElementsAre(1));
  EXPECT_THAT(indices(index.retrieve(looking({-3, -7, 0}, 0.4, -M_PI / 2))), testing::ElementsAre(2));
}

TEST(LandmarkIndex, leaves_out_what_the_asking_client_updated_last) {
  LandmarkIndex index;
  DescribedLandmark mine = landmark(1, {3, 0, 0}), other = landmark(2, {3, 0.1, 0});
  other.updated_by = kBeta.client;
  index.set(mine);
  index.set(other);
  const Frustum frustum = looking({0, 0, 0}, 0.0, 0.0);
  EXPECT_THAT(indices(index.retrieve(frustum)), testing::ElementsAre(1, 2));
  EXPECT_THAT(indices(index.retrieve(frustum, {}, kAlpha.client)), testing::ElementsAre(2));
  other.updated_by = kAlpha.client;
  index.set(other);
  EXPECT_THAT(index.retrieve(frustum, {}, kAlpha.client), testing::IsEmpty());
}

TEST(LandmarkIndex, prefers_those_seen_from_the_same_side_and_answers_by_id_whatever_came_first) {
  RandomLandmarks random(3);
  std::vector<DescribedLandmark> landmarks;
  for (std::uint32_t i = 0; i < 300; ++i) {
    landmarks.push_back(landmark(i, {random.uniform(3, 4), random.uniform(-1, 1), random.uniform(-0.5, 0.5)}));
    landmarks.back().direction = Eigen::Vector3d(1.0, i % 3 == 0 ? 0.0 : 0.8, 0.0).normalized();
  }
  RetrievalOptions options;
  options.most = 100;
  LandmarkIndex index, reversed;
  for (const DescribedLandmark& one : landmarks) index.set(one);
  for (auto one = landmarks.rbegin(); one != landmarks.rend(); ++one) reversed.set(*one);
  const Frustum frustum = looking({0, 0, 0}, 0.0, 0.0);
  const auto best = indices(index.retrieve(frustum, options));
  ASSERT_EQ(best.size(), 100U);
  EXPECT_TRUE(std::is_sorted(best.begin(), best.end()));
  EXPECT_GT(std::count_if(best.begin(), best.end(), [](std::uint32_t i) { return i % 3 == 0; }), 90);
  EXPECT_EQ(best, indices(reversed.retrieve(frustum, options)));
}

TEST(LandmarkIndex, refuses_what_is_no_number_or_out_of_reach) {
  LandmarkIndex index;
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinite = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, infinite, 1e12, -1e300}) {
    EXPECT_THROW(index.set(landmark(1, {0, bad, 0})), Error);
    Frustum frustum = looking({0, 0, 0}, 0, 0);
    frustum.map_from_camera.t.x() = bad;
    EXPECT_THROW(index.retrieve(frustum), Error);
    frustum = looking({0, 0, 0}, 0, 0);
    frustum.far_m = bad;
    EXPECT_THROW(index.retrieve(frustum), Error);
    frustum = looking({0, 0, 0}, 0, 0);
    frustum.map_from_camera.q.x() = bad;
    EXPECT_THROW(index.retrieve(frustum), Error);
    frustum = looking({0, 0, 0}, 0, 0);
    frustum.pinhole.cx = bad;
    EXPECT_THROW(index.retrieve(frustum), Error);
  }
  Frustum wide = looking({0, 0, 0}, 0, 0);
  wide.pinhole.fx = 1e-300;
  EXPECT_THROW(index.retrieve(wide), Error);
  DescribedLandmark odd = landmark(1, {1, 0, 0});
  odd.direction = {0.5, 0, 0};
  EXPECT_THROW(index.set(odd), Error);
  odd = landmark(1, {1, 0, 0});
  odd.nearest_m = 2.0;
  odd.farthest_m = 1.0;
  EXPECT_THROW(index.set(odd), Error);
  EXPECT_EQ(index.size(), 0U);
  EXPECT_FALSE(index.remove({kAlpha, 1}));
}

TEST(LandmarkIndex, looks_across_a_whole_country_without_counting_its_cells) {
  LandmarkIndex index({0.05, true});
  index.set(landmark(1, {2e5, 3.0, 1.0}));
  Frustum frustum = looking({0, 0, 0}, 0.0, 0.0);
  frustum.far_m = 4e5;
  EXPECT_THAT(indices(index.retrieve(frustum)), testing::ElementsAre(1));
}

// A keyframe at the map's origin that looks along x, with a feature two pixels right of where it sees a landmark 4 m
// ahead.
TEST(LandmarkDescription, takes_the_descriptor_of_the_feature_beside_and_says_where_that_lies) {
  CameraGeometry camera{
      kPinhole.width, kPinhole.height, kPinhole.fx, kPinhole.fy, kPinhole.cx, kPinhole.cy, 0.0, 1.2, {}};
  camera.robot_from_camera.q = kForward;
  KeyframeFeatures keyframe;
  keyframe.geometry = std::make_shared<const CameraGeometry>(camera);
  keyframe.points = {{pixel_units(100), pixel_units(100), 0, 0, 0}, {pixel_units(320), pixel_units(243), 0, 0, 0}};
  keyframe.descriptors = {{1, 1, 1, 1}, {2, 3, 4, 5}};
  Map map;
  const NodeId id{kBeta, 0};
  map.nodes.set(id, {id, {kBeta.run}, {}, std::make_shared<const Payload>(keyframe)});
  Landmark seen{{kBeta, 9}, id, landmark_units({4.0, 0.0, 0.0}), {}, {{id, pixel_units(318), pixel_units(243), 0, 0}}};
  const auto found = LandmarkDescriber(map).described(seen);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->descriptor, keyframe.descriptors[1]);
  EXPECT_LT((found->point_in_map - Eigen::Vector3d(4, 0, 0)).norm(), 1e-9);
  EXPECT_LT((found->feature_from_point - Eigen::Vector3d(0, -4.0 * 2.0 / kPinhole.fx, 0)).norm(), 1e-3);
  EXPECT_LT((found->direction - Eigen::Vector3d::UnitX()).norm(), 1e-9);
  EXPECT_NEAR(found->nearest_m, 4.0, 1e-9);
  EXPECT_EQ(found->updated_by.robot, RobotId("beta"));
  seen.seen[0].u = pixel_units(400);
  EXPECT_FALSE(LandmarkDescriber(map).described(seen)) << "no feature there";
  seen.anchor.index = 3;
  EXPECT_FALSE(LandmarkDescriber(map).described(seen)) << "it hangs on nothing";
}

}  // namespace
}  // namespace mapweave::matching
