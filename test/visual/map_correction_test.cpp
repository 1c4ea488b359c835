#include "loops/map_correction.h"

#include <gtest/gtest.h>

namespace mapweave::visual {
namespace {

// Two sessions of one camera alone saw the same three places; the second one's scale is half the first one's, and its
// frame is turned.
TEST(MapCorrection, joins_sessions_of_different_scale) {
  const View second_from_first =
      view_of({{0.4, -0.2, 1.0}, Eigen::Quaterniond(Eigen::AngleAxisd(0.8, Eigen::Vector3d::UnitY()))});
  constexpr double kShorter = 0.5;
  const std::vector<Eigen::Vector3d> points{{0.5, 0.1, 3.0}, {-0.4, 0.6, 2.0}, {0.2, -0.5, 4.0}};
  LandmarkMap map;
  map.camera = {640, 480, 500.0, 500.0, 319.5, 239.5};
  map.monocular = true;
  std::vector<View> truth;
  for (int session = 0; session < 2; ++session) {
    const View own = session == 0 ? View() : second_from_first;
    const double scale = session == 0 ? 1.0 : kShorter;
    for (int i = 0; i < 3; ++i) {
      const View view = view_of({{0.3 * i, 0.1 * i, 0.2 * i}, Eigen::Quaterniond::Identity()});
      Keyframe keyframe;
      keyframe.session = session;
      keyframe.view = stretched(view * own.inverse(), scale);
      keyframe.depths = {static_cast<float>(2.0 * scale)};
      truth.push_back(view);
      const int number = map.add(std::move(keyframe));
      for (int p = 0; p < 3; ++p) {
        if (i == 0) {
          ClientLandmark landmark;
          landmark.point = scale * (own * points[static_cast<std::size_t>(p)]);
          map.add(std::move(landmark));
        }
        Observation seen;
        seen.keyframe = number;
        seen.sighting.inverse_depth = 1.0 / (scale * (view * points[static_cast<std::size_t>(p)]).z());
        seen.sighting.inverse_depth_sigma = 0.1 / scale;
        map.see(3 * session + p, seen);
      }
    }
  }
  FoundLoop loop;
  loop.newest = 5;
  loop.earlier = 0;
  loop.view = truth[5];
  loop.scale = 1.0 / kShorter;
  join_sessions(map, loop);
  EXPECT_EQ(loop.scale, 1.0);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(map.keyframes[i].session, 0);
    EXPECT_LT((map.keyframes[i].view.centre() - truth[i].centre()).norm(), 1e-9) << i;
    EXPECT_NEAR(static_cast<double>(map.keyframes[i].depths.front()), 2.0, 1e-6);
  }
  for (std::size_t p = 0; p < 6; ++p) {
    EXPECT_LT((map.landmarks[p].point - points[p % 3]).norm(), 1e-9);
    for (const Observation& o : map.landmarks[p].seen)
      EXPECT_NEAR(o.sighting.inverse_depth, 1.0 / (map.keyframe(o.keyframe).view * points[p % 3]).z(), 1e-9);
  }
}

struct Corrected {
  double scale_of_newest, depth_of_newest, worst_m;
};

// A round path whose steps are mapped shorter than they are, by keyframe; the loop shows by how much at the end.
Corrected corrected(const std::vector<double>& mapped_scale, bool with_wheels) {
  LandmarkMap map;
  map.camera = {640, 480, 500.0, 500.0, 319.5, 239.5};
  map.monocular = true;
  std::vector<Eigen::Vector3d> truth;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero(), drifted = centre;
  const auto count = static_cast<int>(mapped_scale.size());
  for (int i = 0; i < count; ++i) {
    const double scale = mapped_scale[static_cast<std::size_t>(i)], turn = 2.0 * M_PI * i / count;
    Keyframe keyframe;
    keyframe.view = view_of({drifted, Eigen::Quaterniond::Identity()});
    keyframe.depths = {static_cast<float>(2.0 * scale)};
    if (with_wheels)
      keyframe.driven.odometry_from_camera = Pose3{centre * (i % 2 == 0 ? 1.0 : 1.004), Eigen::Quaterniond::Identity()};
    map.add(std::move(keyframe));
    truth.push_back(centre);
    const Eigen::Vector3d step(0.3 * std::cos(turn), 0.0, 0.3 * std::sin(turn));
    centre += step;
    drifted += scale * step;
  }
  FoundLoop loop;
  loop.newest = count - 1;
  loop.earlier = 0;
  loop.scale = 1.0 / mapped_scale.back();
  loop.view = view_of({truth.back(), Eigen::Quaterniond::Identity()});
  loop.matches.resize(50);
  loop.serials.resize(50);
  for (Match& match : loop.matches) {
    ClientLandmark landmark;
    landmark.gone = true;
    match.landmark = map.add(std::move(landmark));
  }
  MapCorrection correction(map, loop, 0.5);
  correction.run();
  Corrected result{correction.apply(map).back(), static_cast<double>(map.keyframes.back().depths.front()), 0.0};
  for (std::size_t i = 0; i < truth.size(); ++i)
    result.worst_m = std::max(result.worst_m, (map.keyframes[i].view.centre() - truth[i]).norm());
  return result;
}

TEST(MapCorrection, gives_lost_scale_back) {
  std::vector<double> scale{1.0};
  while (scale.size() < 21) scale.push_back(0.98 * scale.back());
  for (const bool with_wheels : {false, true}) {
    const Corrected found = corrected(scale, with_wheels);
    EXPECT_NEAR(found.scale_of_newest, 1.0 / scale.back(), 0.02);
    EXPECT_NEAR(found.depth_of_newest, 2.0, 0.05);
    EXPECT_LT(found.worst_m, 0.06);
  }
}

TEST(MapCorrection, gives_scale_back_where_wheels_say_that_it_was_lost) {
  std::vector<double> scale(40, 1.0);
  std::fill(scale.begin() + 12, scale.end(), 0.5);
  EXPECT_GT(corrected(scale, false).worst_m, 0.3) << "nobody knows where";
  const Corrected found = corrected(scale, true);
  EXPECT_LT(found.worst_m, 0.05);
  EXPECT_NEAR(found.scale_of_newest, 2.0, 0.02);
}

}  // namespace
}  // namespace mapweave::visual
