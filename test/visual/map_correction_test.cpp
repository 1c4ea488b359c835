#include "map_correction.h"

#include <gtest/gtest.h>

namespace mapweave::visual {
namespace {

// Two sessions of one camera alone saw the same three places; the second one's lengths are half as long, and its frame is turned.
TEST(MapCorrection, joins_sessions_of_different_scale) {
  const View second_from_first = view_of({{0.4, -0.2, 1.0}, Eigen::Quaterniond(Eigen::AngleAxisd(0.8, Eigen::Vector3d::UnitY()))});
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
      keyframe.session = session, keyframe.view = stretched(view * own.inverse(), scale);
      keyframe.depths = {static_cast<float>(2.0 * scale)};
      truth.push_back(view);
      const int number = map.add(std::move(keyframe));
      for (int p = 0; p < 3; ++p) {
        if (i == 0) {
          Landmark landmark;
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
  loop.newest = 5, loop.earlier = 0, loop.view = truth[5], loop.scale = 1.0 / kShorter;
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

// A way whose steps grew shorter; the loop tells by how much.
TEST(MapCorrection, gives_lost_scale_back) {
  constexpr int kKeyframes = 21;
  constexpr double kShrink = 0.98;
  LandmarkMap map;
  map.camera = {640, 480, 500.0, 500.0, 319.5, 239.5};
  map.monocular = true;
  std::vector<Eigen::Vector3d> truth;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero(), drifted = centre;
  double scale = 1.0;
  for (int i = 0; i < kKeyframes; ++i) {
    Keyframe keyframe;
    keyframe.view = view_of({drifted, Eigen::Quaterniond::Identity()});
    keyframe.depths = {static_cast<float>(2.0 * scale)};
    map.add(std::move(keyframe));
    truth.push_back(centre);
    const Eigen::Vector3d step(0.3 * std::cos(0.3 * i), 0.0, 0.3 * std::sin(0.3 * i));
    centre += step, drifted += scale * step;
    if (i + 1 < kKeyframes) scale *= kShrink;
  }
  FoundLoop loop;
  loop.newest = kKeyframes - 1, loop.earlier = 0, loop.scale = 1.0 / scale;
  loop.view = view_of({truth.back(), Eigen::Quaterniond::Identity()});
  loop.matches.resize(50), loop.serials.resize(50);
  for (Match& match : loop.matches) {
    Landmark landmark;
    landmark.gone = true;
    match.landmark = map.add(std::move(landmark));
  }
  MapCorrection correction(map, loop, 0.5);
  correction.run();
  const auto scales = correction.apply(map);
  EXPECT_NEAR(scales.back(), 1.0 / scale, 0.02);
  EXPECT_NEAR(static_cast<double>(map.keyframes.back().depths.front()), 2.0, 0.05);
  double worst = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) worst = std::max(worst, (map.keyframes[i].view.centre() - truth[i]).norm());
  EXPECT_LT(worst, 0.06);
}

}  // namespace
}  // namespace mapweave::visual
