#include <gtest/gtest.h>
#include <mapweave/matching/branch_and_bound.h>
#include <support/pose_matchers.h>
#include <support/simulated_maps.h>

namespace mapweave::matching {
namespace {

using test::IsNear;

struct Pair {
  Map map_a, map_b;
  std::vector<SubmapModel> a, b;
  Pose2 a_from_b_maps;  // of the map frames: the truth
  Pair() {
    simulation::TeamOptions options;
    options.robots = 2;
    options.shared = 1.0;
    const auto team = simulation::make_apartment({}, options);
    map_a = test::truth_map(team.robots[0], team.laser);
    map_b = test::truth_map(team.robots[1], team.laser);
    for (const auto& [id, submap] : map_a.submaps) a.emplace_back(submap, map_a.nodes);
    for (const auto& [id, submap] : map_b.submaps) b.emplace_back(submap, map_b.nodes);
    a_from_b_maps =
        between(team.robots[0].steps.front().world_from_robot, team.robots[1].steps.front().world_from_robot);
  }
  Pose2 truth(std::size_t i, std::size_t j) const {
    const auto anchor = [](const Map& map, std::size_t n) {
      return planar(
          map.nodes.find((map.submaps.begin() + static_cast<std::ptrdiff_t>(n))->second.anchor())->map_from_node);
    };
    return between(anchor(map_a, i), compose(a_from_b_maps, anchor(map_b, j)));
  }
};

const Pair& pair() {
  static const Pair shared;
  return shared;
}

// The submap of a whose middle lies nearest to that of submap j of b.
std::size_t partner(std::size_t j) {
  std::size_t best = 0;
  double nearest = 1e300;
  for (std::size_t i = 0; i < pair().a.size(); ++i) {
    const Pose2 t = pair().truth(i, j);
    const auto p = pair().b[j].centre();
    const double x = t.x + std::cos(t.phi) * p.x - std::sin(t.phi) * p.y - pair().a[i].centre().x,
                 y = t.y + std::sin(t.phi) * p.x + std::cos(t.phi) * p.y - pair().a[i].centre().y;
    if (std::hypot(x, y) < nearest) {
      nearest = std::hypot(x, y);
      best = i;
    }
  }
  return best;
}

TEST(BranchAndBound, finds_the_true_alignment_all_around) {
  std::size_t right = 0;
  for (std::size_t j = 0; j < pair().b.size(); ++j) {
    const std::size_t i = partner(j);
    const auto centre_a = pair().a[i].centre(), centre_b = pair().b[j].centre();
    const auto peaks =
        search_peaks(pair().a[i], pair().b[j], {{centre_a.x - centre_b.x, centre_a.y - centre_b.y, 0.0}, 8.0, M_PI});
    if (peaks.empty()) continue;
    const Pose2 apart = between(pair().truth(i, j), peaks.front().a_from_b);
    right += std::hypot(apart.x, apart.y) < 0.4 && std::abs(apart.phi) < 0.1;
  }
  EXPECT_GE(right * 4, pair().b.size() * 3) << right << " of " << pair().b.size();
}

TEST(BranchAndBound, scores_as_high_as_brute_force) {
  const std::size_t i = partner(0);
  const SubmapModel &a = pair().a[i], &b = pair().b[0];
  const Pose2 guess = compose(pair().truth(i, 0), {0.3, -0.2, 0.05});
  // Windows of less than a block of the pyramid, of some, and of many; the last one where walls of b lie outside all
  // that a knows.
  const struct { double x, radius_m; } windows[] = {{0.0, 0.25}, {0.0, 0.8}, {0.0, 2.0}, {3.0, 1.7}};
  for (const auto& window : windows) {
    const Pose2 middle = compose(guess, {window.x, 0.0, 0.0});
    const int reach = static_cast<int>(std::ceil(window.radius_m * 10.0));
    SearchOptions options;
    options.min_score = 0.05;
    const auto peaks = search_peaks(a, b, {middle, window.radius_m, 0.15}, options);
    ASSERT_FALSE(peaks.empty()) << window.radius_m;
    double best = 0;
    for (double yaw = -0.15; yaw <= 0.15; yaw += 0.01)
      for (int y = -reach; y <= reach; ++y)
        for (int x = -reach; x <= reach; ++x) {
          // Turned about b's middle, as the search does.
          const auto c = b.centre();
          const double mx = middle.x + std::cos(middle.phi) * c.x - std::sin(middle.phi) * c.y + 0.1 * x,
                       my = middle.y + std::sin(middle.phi) * c.x + std::cos(middle.phi) * c.y + 0.1 * y;
          const double cs = std::cos(middle.phi + yaw), sn = std::sin(middle.phi + yaw);
          double sum = 0;
          for (const auto& p : b.query()) {
            const double dx = p.x - c.x, dy = p.y - c.y;
            sum += a.pyramid()[0].get(cell_of(mx + cs * dx - sn * dy, 10.0), cell_of(my + sn * dx + cs * dy, 10.0));
          }
          best = std::max(best, sum / (255.0 * static_cast<double>(b.query().size())));
        }
    EXPECT_NEAR(peaks.front().score, best, 0.05) << window.x << ' ' << window.radius_m;
  }
}

TEST(BranchAndBound, answers_distinct_peaks_best_first) {
  const std::size_t i = partner(0);
  SearchOptions options;
  options.rival_ratio = 0.3;
  options.min_score = 0.15;
  const auto peaks = search_peaks(pair().a[i], pair().b[0], {pair().truth(i, 0), 6.0, M_PI}, options);
  ASSERT_GT(peaks.size(), 1U);
  for (std::size_t k = 1; k < peaks.size(); ++k) {
    EXPECT_LE(peaks[k].score, peaks[k - 1].score);
    EXPECT_GE(peaks[k].score, 0.3 * peaks[0].score - 0.01);
  }
}

TEST(BranchAndBound, finds_nothing_where_nothing_fits) {
  EXPECT_TRUE(search_peaks(pair().a[0], pair().b[0], {{500.0, 0.0, 0.0}, 3.0, 0.5}).empty());
}

}  // namespace
}  // namespace mapweave::matching
