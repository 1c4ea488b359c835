#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <support/random_map.h>

#include <functional>
#include <limits>
#include <set>

namespace mapweave {
namespace {

using test::RandomMaps;

TEST(KeyframePoint, keeps_pixels_to_a_thirtysecond) {
  for (const double pixels : {0.0, 0.4, 17.03, 319.999, 4000.5})
    EXPECT_NEAR(pixels_of(pixel_units(pixels)), pixels, 1.0 / 32.0);
  EXPECT_EQ(pixel_units(-0.5), 0);
  EXPECT_EQ(pixel_units(5000.0), 65535);
}

TEST(KeyframePoint, keeps_depths_as_finely_as_cameras_see_them) {
  EXPECT_NEAR(depth_m_of(inverse_depth_units(0.3)), 0.3, 0.0001);
  EXPECT_NEAR(depth_m_of(inverse_depth_units(1.0)), 1.0, 0.001);
  EXPECT_NEAR(depth_m_of(inverse_depth_units(10.0)), 10.0, 0.015);
  EXPECT_NEAR(depth_m_of(inverse_depth_units(200.0)), 200.0, 5.0);
  for (std::uint32_t units = 1; units < 65536; ++units)
    ASSERT_EQ(inverse_depth_units(depth_m_of(static_cast<std::uint16_t>(units))), units);
}

TEST(KeyframePoint, knows_no_depth_that_is_none) {
  for (const double depth_m : {0.0, -1.0, 0.06, 9000.0, 1e300, std::numeric_limits<double>::infinity(),
                               std::numeric_limits<double>::quiet_NaN()})
    EXPECT_EQ(inverse_depth_units(depth_m), 0) << depth_m;
  EXPECT_EQ(depth_m_of(0), 0.0);
}

TEST(KeyframePoint, keeps_angles_round_the_circle) {
  EXPECT_EQ(angle_units(0.0), 0);
  EXPECT_EQ(angle_units(90.0), 64);
  EXPECT_EQ(angle_units(359.9), 0);
  EXPECT_NEAR(angle_deg_of(angle_units(211.0)), 211.0, 0.71);
}

TEST(Keyframe, takes_forty_bytes_a_feature_in_memory) {
  EXPECT_EQ(sizeof(KeyframePoint) + sizeof(BinaryDescriptor), 40U);
}

TEST(Landmark, keeps_its_point_to_a_twentieth_of_a_millimetre) {
  Landmark landmark;
  landmark.point_units = landmark_units({1.00004, -200.0, 0.12346});
  EXPECT_LT((landmark.point_in_anchor() - Eigen::Vector3d(1.00004, -200.0, 0.12346)).cwiseAbs().maxCoeff(), 0.000051);
  landmark.point_units = landmark_units({1e9, -1e9, 0.0});
  EXPECT_GT(landmark.point_in_anchor().x(), 2e5) << "far beyond reach is at the border";
  EXPECT_LT(landmark.point_in_anchor().y(), -2e5);
}

TEST(Landmark, is_named_by_its_session) {
  EXPECT_EQ(to_string(LandmarkId{{{RobotId("alpha"), SensorId("camera")}, 1'500'000'000}, 12}),
            "alpha/camera@1.500/landmark 12");
}

TEST(ContentHash, sees_any_change_of_a_keyframe_and_none_of_landmarks) {
  const Map map = RandomMaps(1).keyframe_map("alpha", 30);
  const Submap& submap = map.submaps.front().second;
  std::set<Hash> hashes = {content_hash(map)}, submap_hashes = {submap.content};
  const auto changed = [&](const std::function<void(KeyframeFeatures&, CameraGeometry&)>& change) {
    Map copy = map;
    Node& node = *copy.nodes.find(submap.anchor());
    KeyframeFeatures keyframe = std::get<KeyframeFeatures>(*node.payload);
    CameraGeometry camera = *keyframe.geometry;
    change(keyframe, camera);
    keyframe.geometry = std::make_shared<const CameraGeometry>(camera);
    node.payload = std::make_shared<const Payload>(std::move(keyframe));
    hashes.insert(content_hash(copy));
    submap_hashes.insert(content_hash(submap, copy.nodes));
  };
  changed([](KeyframeFeatures&, CameraGeometry&) {});
  EXPECT_EQ(hashes.size(), 1U) << "a camera of one's own that is alike";
  changed([](KeyframeFeatures& k, CameraGeometry&) { k.points[2].u ^= 1; });
  changed([](KeyframeFeatures& k, CameraGeometry&) { k.points[2].inverse_depth ^= 256; });
  changed([](KeyframeFeatures& k, CameraGeometry&) { k.points[2].level ^= 1; });
  changed([](KeyframeFeatures& k, CameraGeometry&) { k.points[2].angle ^= 1; });
  changed([](KeyframeFeatures& k, CameraGeometry&) { k.descriptors[8][3] ^= std::uint64_t{1} << 63; });
  changed([](KeyframeFeatures& k, CameraGeometry&) { std::swap(k.descriptors[0], k.descriptors[1]); });
  changed([](KeyframeFeatures& k, CameraGeometry&) {
    k.points.pop_back();
    k.descriptors.pop_back();
  });
  changed([](KeyframeFeatures&, CameraGeometry& c) { c.fx = std::nextafter(c.fx, 0.0); });
  changed([](KeyframeFeatures&, CameraGeometry& c) { c.baseline_m = 0.0; });
  changed([](KeyframeFeatures&, CameraGeometry& c) { c.level_scale = 2.0; });
  changed([](KeyframeFeatures&, CameraGeometry& c) { c.robot_from_camera.t.z() += 1e-9; });
  EXPECT_EQ(hashes.size(), 12U);
  EXPECT_EQ(submap_hashes.size(), 12U);

  Map believed = map;
  believed.landmarks = {};
  EXPECT_EQ(content_hash(believed), content_hash(map)) << "landmarks are belief";
}

}  // namespace
}  // namespace mapweave
