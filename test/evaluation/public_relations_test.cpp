// The reference trajectories of the public logs against their relations: sparse laser poses, joined by the odometry of
// the log. What they should score stands in the README beside the data.
#include <gtest/gtest.h>
#include <mapweave/core/files.h>
#include <mapweave/evaluation/relations.h>
#include <support/data.h>
#include <zlib.h>

#include <algorithm>
#include <sstream>

namespace mapweave::evaluation {
namespace {

struct Expectation {
  const char* name;
  double translation_mean_m, translation_std_m, rotation_mean_deg, rotation_std_deg;
};

void PrintTo(const Expectation& expectation, std::ostream* out) { *out << expectation.name; }

// Stamp and odometry of every scan: of `FLASER n r_1..r_n x y th odom_x odom_y odom_th stamp host logger_stamp` the
// columns after the first pose.
std::vector<std::pair<Stamp, Pose2>> odometry_of(const std::filesystem::path& carmen_log) {
  std::vector<std::pair<Stamp, Pose2>> odometry;
  const gzFile file = gzopen(carmen_log.c_str(), "rb");
  std::string line(1 << 16, '\0');
  while (gzgets(file, line.data(), static_cast<int>(line.size())) != nullptr) {
    std::istringstream words(line.c_str());
    std::string word;
    int rays = 0;
    if (!(words >> word >> rays) || word != "FLASER") continue;
    for (int skipped = 0; skipped < rays + 3; ++skipped) words >> word;
    double x = 0.0, y = 0.0, yaw = 0.0, stamp = 0.0;
    if (words >> x >> y >> yaw >> stamp) odometry.emplace_back(stamp_from_seconds(stamp), Pose2(x, y, yaw));
  }
  gzclose(file);
  return odometry;
}

// `stamp x y theta` a line: poses of the laser.
Trajectory reference_of(const std::filesystem::path& file) {
  Trajectory trajectory;
  std::istringstream lines(read_file(file));
  for (std::string line; std::getline(lines, line);) {
    double stamp = 0.0, x = 0.0, y = 0.0, yaw = 0.0;
    std::istringstream words(line);
    if (words >> stamp >> x >> y >> yaw) trajectory.push_back({stamp_from_seconds(stamp), spatial(Pose2(x, y, yaw))});
  }
  return trajectory;
}

class PublicRelations : public testing::TestWithParam<Expectation> {};

TEST_P(PublicRelations, reference_trajectory_scores_what_its_readme_says) {
  const Expectation expected = GetParam();
  const std::string name = expected.name;
  MAPWEAVE_NEED_DATA(folder, "laser/" + name);
  const auto odometry = odometry_of(folder / (name + ".clf.gz"));
  const Trajectory sparse = reference_of(folder / (name + "_reference.txt"));

  // The laser of fr079 stands 0.04 m ahead of the robot; odometry is the robot's.
  const Pose2 robot_from_laser(name == "fr079" ? 0.04 : 0.0, 0.0, 0.0);
  struct Anchor {
    Stamp stamp;
    Pose2 world_from_laser, odometry_from_laser;
  };
  std::vector<Anchor> anchors;
  for (const auto& [stamp, world_from_robot] : odometry) {
    const auto* point = nearest_point(sparse, stamp, 1e-6);
    if (point != nullptr && (anchors.empty() || anchors.back().stamp < stamp))
      anchors.push_back({stamp, planar(point->pose), compose(world_from_robot, robot_from_laser)});
  }

  // Between two anchors: odometry onwards from the one, backwards from the other, and from one to the other by time.
  Trajectory dense;
  for (const auto& [stamp, world_from_robot] : odometry) {
    const auto after =
        std::find_if(anchors.begin(), anchors.end(), [s = stamp](const Anchor& anchor) { return s <= anchor.stamp; });
    if (after == anchors.end() || (after == anchors.begin() && !(after->stamp == stamp)) ||
        (!dense.empty() && !(dense.back().stamp < stamp)))
      continue;
    const Anchor& later = *after;
    const Anchor& earlier = later.stamp == stamp ? later : *std::prev(after);
    const Pose2 odometry_from_laser = compose(world_from_robot, robot_from_laser);
    const Pose2 forth = compose(earlier.world_from_laser, between(earlier.odometry_from_laser, odometry_from_laser));
    const Pose2 back = compose(later.world_from_laser, between(later.odometry_from_laser, odometry_from_laser));
    const double share =
        &earlier == &later ? 0.0 : seconds_between(earlier.stamp, stamp) / seconds_between(earlier.stamp, later.stamp);
    dense.push_back({stamp, spatial(Pose2(forth.x + share * (back.x - forth.x), forth.y + share * (back.y - forth.y),
                                          wrap_angle(forth.phi + share * wrap_angle(back.phi - forth.phi))))});
  }

  const RelationError error = relation_error(dense, read_relations(folder / (name + ".relations")));
  RecordProperty("translation_mean_m", std::to_string(error.translation_mean_m));
  RecordProperty("rotation_mean_deg", std::to_string(error.rotation_mean_deg));
  EXPECT_GT(error.used, error.count * 99 / 100);
  EXPECT_NEAR(error.translation_mean_m, expected.translation_mean_m, 0.1 * expected.translation_mean_m);
  EXPECT_NEAR(error.translation_std_m, expected.translation_std_m, 0.15 * expected.translation_std_m);
  EXPECT_NEAR(error.rotation_mean_deg, expected.rotation_mean_deg, 0.1 * expected.rotation_mean_deg);
  EXPECT_NEAR(error.rotation_std_deg, expected.rotation_std_deg, 0.15 * expected.rotation_std_deg);
}

INSTANTIATE_TEST_SUITE_P(Logs, PublicRelations,
                         testing::Values(Expectation{"intel", 0.0283, 0.0209, 1.01, 0.93},
                                         Expectation{"fr079", 0.0581, 0.0418, 0.71, 0.69},
                                         Expectation{"mit-killian", 0.0406, 0.0362, 1.12, 1.83}),
                         [](const auto& tested) {
                           const std::string name = tested.param.name;
                           return name.substr(0, name.find('-'));
                         });

}  // namespace
}  // namespace mapweave::evaluation
