#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/matching/alignment_search.h>

#include <random>

namespace mapweave::matching {
namespace {

class Draws {
 public:
  explicit Draws(std::uint64_t seed) : random_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(random_() >> 11) * 0x1p-53;
  }
  double about(double deviation) {  // a sum of uniform numbers: nearly normal
    double sum = 0.0;
    for (int i = 0; i < 12; ++i) sum += uniform(-0.5, 0.5);
    return deviation * sum;
  }

 private:
  std::mt19937_64 random_;
};

const Pinhole kCamera{640, 480, 520.0, 515.0, 320.0, 240.0};

struct World {
  Sim3 a_from_b;
  AlignmentProblem problem;
  std::size_t right = 0;  // the first pairs are right
};

enum class Knows { both, only_a, only_b };

// Two cameras at the sides' origins that see the same points; of `share_wrong` of the pairs b's side is that of another
// point.
World world(std::uint64_t seed, Freedom freedom, Knows knows, double share_wrong, double noise_px) {
  Draws draws(seed);
  World world;
  world.problem.freedom = freedom;
  world.problem.cameras_a = {{kCamera, {}}};
  world.problem.cameras_b = {{kCamera, {}}};
  world.a_from_b.pose.t = {0.4, -0.2, 0.3};
  world.a_from_b.pose.q = Eigen::AngleAxisd(0.25, Eigen::Vector3d(0.3, 1.0, -0.4).normalized());
  world.a_from_b.scale = freedom == Freedom::similarity ? 2.5 : 1.0;
  const Sim3 b_from_a = inverse(world.a_from_b);
  std::vector<FeaturePair> pairs;
  while (pairs.size() < 100) {
    const Eigen::Vector3d in_a(draws.uniform(-2, 2), draws.uniform(-1.5, 1.5), draws.uniform(1.5, 5)),
        in_b = transformed(in_a, b_from_a);
    if (in_b.z() < 0.1 || !kCamera.shows(kCamera.project(in_a)) || !kCamera.shows(kCamera.project(in_b))) continue;
    FeaturePair pair;
    pair.pixel_a = kCamera.project(in_a) + Eigen::Vector2d(draws.about(noise_px), draws.about(noise_px));
    pair.pixel_b = kCamera.project(in_b) + Eigen::Vector2d(draws.about(noise_px), draws.about(noise_px));
    if (knows != Knows::only_b) pair.point_in_a = in_a;
    if (knows != Knows::only_a) pair.point_in_b = in_b;
    pairs.push_back(pair);
  }
  world.right = static_cast<std::size_t>(100.0 * (1.0 - share_wrong) + 0.5);
  for (std::size_t i = world.right; i < pairs.size(); ++i) {
    const FeaturePair& other = pairs[(i * 7 + 3) % world.right];
    pairs[i].pixel_b = other.pixel_b;
    pairs[i].point_in_b = other.point_in_b;
  }
  world.problem.pairs = pairs;
  return world;
}

void expect_near(const Sim3& found, const Sim3& truth, double metres, double radians, double scale) {
  EXPECT_LT((found.pose.t - truth.pose.t).norm(), metres);
  EXPECT_LT(found.pose.q.angularDistance(truth.pose.q), radians);
  EXPECT_NEAR(found.scale / truth.scale, 1.0, scale);
}

TEST(SearchAlignment, is_exact_without_noise) {
  for (const Freedom freedom : {Freedom::rigid, Freedom::similarity}) {
    const World exact = world(1, freedom, Knows::both, 0.0, 0.0);
    const auto fit = search_alignment(exact.problem);
    ASSERT_TRUE(fit);
    expect_near(fit->a_from_b, exact.a_from_b, 1e-6, 1e-6, 1e-6);
    EXPECT_EQ(fit->inliers.size(), 100U);
  }
}

TEST(SearchAlignment, finds_the_right_among_three_fifths_wrong) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    for (const Knows knows : {Knows::both, Knows::only_a, Knows::only_b}) {
      const World noisy = world(seed, Freedom::rigid, knows, 0.6, 0.5);
      const auto fit = search_alignment(noisy.problem);
      ASSERT_TRUE(fit) << seed;
      expect_near(fit->a_from_b, noisy.a_from_b, 0.02, 0.006, 1e-12);
      std::size_t right = 0;
      for (const std::uint32_t i : fit->inliers) right += i < noisy.right;
      EXPECT_GE(right, 38U);
      EXPECT_LE(fit->inliers.size() - right, 2U);
    }
    const World similar = world(seed, Freedom::similarity, Knows::both, 0.6, 0.5);
    const auto fit = search_alignment(similar.problem);
    ASSERT_TRUE(fit) << seed;
    expect_near(fit->a_from_b, similar.a_from_b, 0.03, 0.008, 0.02);
  }
}

TEST(SearchAlignment, reports_how_sure_it_is) {
  // Errors of many worlds, in the deviations that the fits claim.
  double sum = 0.0, sum_scale = 0.0;
  constexpr int kWorlds = 40;
  for (std::uint64_t seed = 1; seed <= kWorlds; ++seed) {
    const World noisy = world(seed, Freedom::similarity, Knows::both, 0.2, 1.0);
    const auto fit = search_alignment(noisy.problem);
    ASSERT_TRUE(fit);
    const Sim3 error = {between(fit->a_from_b.pose, noisy.a_from_b.pose), noisy.a_from_b.scale / fit->a_from_b.scale};
    const Eigen::Vector3d motion = error.pose.t / fit->a_from_b.scale;
    sum += motion.dot(fit->covariance.topLeftCorner<3, 3>().inverse() * motion) / 3.0 / kWorlds;
    sum_scale += std::pow(std::log(error.scale), 2) / fit->covariance(6, 6) / kWorlds;
    EXPECT_NEAR(fit->rms_sigma, 1.0, 0.2);
  }
  EXPECT_GT(sum, 0.4);
  EXPECT_LT(sum, 2.0);
  EXPECT_GT(sum_scale, 0.3);
  EXPECT_LT(sum_scale, 2.2);
}

TEST(SearchAlignment, gives_the_same_bits_again) {
  const World noisy = world(5, Freedom::rigid, Knows::both, 0.5, 0.7);
  const auto first = search_alignment(noisy.problem), second = search_alignment(noisy.problem);
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->a_from_b.pose.t, second->a_from_b.pose.t);
  EXPECT_EQ(first->a_from_b.pose.q.coeffs(), second->a_from_b.pose.q.coeffs());
  EXPECT_EQ(first->inliers, second->inliers);
}

TEST(SearchAlignment, finds_nothing_in_nothing) {
  const World hopeless = world(1, Freedom::rigid, Knows::both, 0.95, 0.5);
  EXPECT_FALSE(search_alignment(hopeless.problem));
  World few = world(1, Freedom::rigid, Knows::both, 0.0, 0.0);
  few.problem.pairs.resize(5);
  EXPECT_FALSE(search_alignment(few.problem));
  few.problem.pairs.clear();
  EXPECT_FALSE(search_alignment(few.problem));
  World same = world(1, Freedom::rigid, Knows::both, 0.0, 0.0);  // all at one place
  for (FeaturePair& pair : same.problem.pairs) pair = same.problem.pairs.front();
  EXPECT_FALSE(search_alignment(same.problem));
}

TEST(SearchAlignment, refuses_points_in_a_line) {
  World line = world(1, Freedom::rigid, Knows::both, 0.0, 0.0);
  for (std::size_t i = 0; i < line.problem.pairs.size(); ++i) {
    FeaturePair& pair = line.problem.pairs[i];
    pair.point_in_a = Eigen::Vector3d(-1.0, 0.5, 2.0) + 0.02 * static_cast<double>(i) * Eigen::Vector3d(1.0, 0.1, 0.5);
    pair.point_in_b = transformed(*pair.point_in_a, inverse(line.a_from_b));
    pair.pixel_a = kCamera.project(*pair.point_in_a);
    pair.pixel_b = kCamera.project(*pair.point_in_b);
  }
  EXPECT_FALSE(search_alignment(line.problem));
  line.problem.freedom = Freedom::similarity;
  EXPECT_FALSE(search_alignment(line.problem));
  EXPECT_FALSE(refine_alignment(line.problem, line.a_from_b));  // a direction is open, even from the truth
}

TEST(RefineAlignment, leads_a_rough_guess_home) {
  const World noisy = world(3, Freedom::similarity, Knows::both, 0.3, 0.5);
  Sim3 guess = noisy.a_from_b;
  guess.pose.t += Eigen::Vector3d(0.004, -0.004, 0.004);
  guess.scale *= 1.002;
  const auto fit = refine_alignment(noisy.problem, guess);
  ASSERT_TRUE(fit);
  expect_near(fit->a_from_b, noisy.a_from_b, 0.02, 0.006, 0.01);
  Sim3 far = guess;
  far.pose.t.x() += 3.0;
  EXPECT_FALSE(refine_alignment(noisy.problem, far));
}

TEST(RefineAlignment, uses_every_camera_of_a_side) {
  // Half of the pairs are seen by a second camera of b, turned and moved.
  World two = world(4, Freedom::rigid, Knows::both, 0.0, 0.0);
  Pose3 b_from_second;
  b_from_second.t = {0.3, 0.0, -0.2};
  b_from_second.q = Eigen::AngleAxisd(-0.1, Eigen::Vector3d::UnitY());
  two.problem.cameras_b.push_back({kCamera, b_from_second});
  for (std::size_t i = 0; i < two.problem.pairs.size(); i += 2) {
    two.problem.pairs[i].camera_b = 1;
    two.problem.pairs[i].pixel_b =
        kCamera.project(transformed(*two.problem.pairs[i].point_in_b, inverse(b_from_second)));
  }
  const auto fit = search_alignment(two.problem);
  ASSERT_TRUE(fit);
  EXPECT_EQ(fit->inliers.size(), 100U);
  expect_near(fit->a_from_b, two.a_from_b, 1e-6, 1e-6, 1e-12);
}

TEST(SearchAlignment, asks_for_sound_problems) {
  World broken = world(1, Freedom::rigid, Knows::both, 0.0, 0.0);
  broken.problem.pairs[0].camera_a = 1;
  EXPECT_THROW(search_alignment(broken.problem), ContractViolation);
  broken.problem.pairs[0].camera_a = 0;
  broken.problem.pairs[0].point_in_a.reset();
  broken.problem.pairs[0].point_in_b.reset();
  EXPECT_THROW(search_alignment(broken.problem), ContractViolation);
}

}  // namespace
}  // namespace mapweave::matching
