#include "camera_world.h"

#include <mapweave/simulation/feature_sensor.h>
#include <mapweave/simulation/renderer.h>

#include <gtest/gtest.h>

#include <bitset>
#include <cmath>
#include <map>
#include <set>

namespace mapweave::simulation {
namespace {

using test::built;
using test::camera_world;
using test::tiny_camera;

int distance(const Descriptor& a, const Descriptor& b) {
  int bits = 0;
  for (std::size_t i = 0; i < a.size(); ++i) bits += static_cast<int>(std::bitset<64>(a[i] ^ b[i]).count());
  return bits;
}

struct Sensor {
  World world;
  FeatureOptions options;
  LandmarkField field;
  FeatureRecording recording;
  explicit Sensor(const WorldOptions& of_world, const FeatureOptions& of_features = {})
      : world(built(of_world)),
        options(of_features),
        field(world.scene(0), world.buildings()[0], options),
        recording(world, field, options, 0, 0) {}
};

CameraOptions camera(SimulatedCameraKind kind) {
  CameraOptions result = tiny_camera(kind);
  result.width = 640;
  result.height = 480;
  result.fx = result.fy = 525.0;
  return result;
}

TEST(FeatureSensor, finds_landmarks_where_the_truth_projects_them) {
  CameraOptions distorted = camera(SimulatedCameraKind::rgbd);
  distorted.k1 = -0.1;
  const Sensor sensor(camera_world(distorted));
  double squares = 0.0, depth_squares = 0.0;
  int count = 0, depths = 0, outliers = 0;
  for (std::size_t i = 0; i < sensor.recording.frame_count(); i += 7) {
    const SimulatedFeatureFrame frame = sensor.recording.frame(i);
    EXPECT_GT(frame.features.size(), 50u);
    for (const Feature& feature : frame.features) {
      if (feature.landmark == kNoLandmark) {
        ++outliers;
        continue;
      }
      const SimulatedLandmark& landmark = sensor.field.landmarks()[feature.landmark];
      const Eigen::Vector3d p = transformed(landmark.point_in_world, inverse(frame.world_from_camera));
      const auto pixel = sensor.recording.model().project(p);
      ASSERT_TRUE(pixel);
      const double sigma = 0.4 * std::pow(1.2, feature.octave);
      squares += std::pow((feature.u - pixel->x()) / sigma, 2) + std::pow((feature.v - pixel->y()) / sigma, 2);
      count += 2;
      if (feature.depth_m > 0.0f) {
        const double z_sigma = 0.0002 + std::hypot(0.0011, 0.0028 / std::sqrt(12.0)) * p.z() * p.z();
        depth_squares += std::pow((feature.depth_m - p.z()) / z_sigma, 2);
        ++depths;
      }
      EXPECT_LT(distance(feature.descriptor, descriptor_of(landmark)), 40);
    }
  }
  EXPECT_NEAR(std::sqrt(squares / count), 1.0, 0.05);
  EXPECT_NEAR(std::sqrt(depth_squares / depths), 1.0, 0.05);
  EXPECT_GT(outliers, 0);
}

TEST(FeatureSensor, flips_the_wanted_share_of_bits) {
  FeatureOptions options;
  options.flipped_bits = 0.1;
  const Sensor sensor(camera_world(camera(SimulatedCameraKind::mono)), options);
  double bits = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < sensor.recording.frame_count(); i += 5) {
    for (const Feature& feature : sensor.recording.frame(i).features) {
      if (feature.landmark == kNoLandmark) continue;
      bits += distance(feature.descriptor, descriptor_of(sensor.field.landmarks()[feature.landmark]));
      ++count;
    }
  }
  EXPECT_NEAR(bits / count / 256.0, 0.1, 0.005);
}

TEST(FeatureSensor, measures_disparities_of_stereo_cameras) {
  FeatureOptions options;
  options.pixel_noise = options.outliers = 0.0;
  const Sensor sensor(camera_world(camera(SimulatedCameraKind::stereo)), options);
  const SimulatedFeatureFrame frame = sensor.recording.frame(3);
  int seen = 0;
  for (const Feature& feature : frame.features) {
    EXPECT_EQ(feature.depth_m, 0.0f);
    if (feature.right_u < 0.0f) continue;
    const Eigen::Vector3d p =
        transformed(sensor.field.landmarks()[feature.landmark].point_in_world, inverse(frame.world_from_camera));
    EXPECT_NEAR(feature.u - feature.right_u, 525.0 * 0.12 / p.z(), 1e-2);
    ++seen;
  }
  EXPECT_GT(seen, 30);
}

TEST(FeatureSensor, finds_the_same_landmarks_again_from_the_next_place) {
  const Sensor sensor(camera_world(camera(SimulatedCameraKind::rgbd)));
  std::set<std::uint32_t> before;
  for (const Feature& feature : sensor.recording.frame(20).features) before.insert(feature.landmark);
  int again = 0, count = 0;
  for (const Feature& feature : sensor.recording.frame(22).features) {
    again += before.count(feature.landmark) > 0;
    ++count;
  }
  EXPECT_GT(again, 0.6 * count);
}

TEST(FeatureSensor, does_not_see_through_walls_or_furniture) {
  WorldOptions options = camera_world(camera(SimulatedCameraKind::rgbd));
  options.buildings[0].kind = PlanKind::repeated_rooms;
  options.buildings[0].repeated_rooms.rooms = 2;
  options.robots[0].waypoints = {{2.0, 0.9}, {6.0, 0.9}};
  FeatureOptions features;
  features.outliers = features.pixel_noise = 0.0;
  const Sensor sensor(options, features);
  RenderedView view;
  int agreeing = 0, count = 0;
  for (std::size_t i = 0; i < sensor.recording.frame_count(); i += 20) {
    const SimulatedFeatureFrame frame = sensor.recording.frame(i);
    render(sensor.world.scene(0), {}, sensor.recording.model(), frame.world_from_camera, Channels::none, view);
    for (const Feature& feature : frame.features) {
      const double z =
          transformed(sensor.field.landmarks()[feature.landmark].point_in_world, inverse(frame.world_from_camera)).z();
      const double seen =
          view.depth(static_cast<int>(std::lround(feature.v)), static_cast<int>(std::lround(feature.u)));
      agreeing += std::abs(seen - z) < 0.03 * z + 0.02;
      ++count;
    }
  }
  EXPECT_GT(count, 300);
  EXPECT_GT(agreeing, 0.97 * count) << "but for rims, and what shows between a table's legs";
}

TEST(FeatureSensor, gives_rooms_that_look_alike_the_same_descriptors) {
  WorldOptions options = camera_world(camera(SimulatedCameraKind::rgbd));
  options.buildings[0].kind = PlanKind::repeated_rooms;
  options.buildings[0].repeated_rooms.rooms = 3;
  options.robots[0].waypoints = {{2.0, 0.9}, {6.0, 0.9}};
  const Sensor sensor(options);
  std::map<std::uint64_t, int> looks;
  for (const SimulatedLandmark& landmark : sensor.field.landmarks()) ++looks[landmark.look];
  int shared = 0;
  for (const auto& [look, times] : looks) shared += times >= 3;
  EXPECT_GT(shared, 300);
  const Sensor unlike(camera_world(camera(SimulatedCameraKind::rgbd)));
  looks.clear();
  for (const SimulatedLandmark& landmark : unlike.field.landmarks()) ++looks[landmark.look];
  for (const auto& [look, times] : looks) EXPECT_LE(times, 2) << "a picture shows on both sides of a wall";
}

TEST(FeatureSensor, says_the_same_whenever_it_is_asked) {
  const Sensor one(camera_world(camera(SimulatedCameraKind::rgbd))),
      other(camera_world(camera(SimulatedCameraKind::rgbd)));
  other.recording.frame(9);
  const SimulatedFeatureFrame a = one.recording.frame(4), b = other.recording.frame(4);
  ASSERT_EQ(a.features.size(), b.features.size());
  for (std::size_t i = 0; i < a.features.size(); ++i) {
    EXPECT_EQ(a.features[i].u, b.features[i].u);
    EXPECT_EQ(a.features[i].descriptor, b.features[i].descriptor);
    EXPECT_EQ(a.features[i].landmark, b.features[i].landmark);
  }
}

}  // namespace
}  // namespace mapweave::simulation
