// Milliseconds of one retrieval (CVS table II: 1.7) in maps of 60,000 landmarks of three densities, and of an update.
// The cameras stand 1 m high and see 10 m far; landmarks stand on walls every 5 m.
#include <mapweave/matching/landmark_index.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <random>

using namespace mapweave;
using namespace mapweave::matching;

int main() {
  std::mt19937_64 random(1);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
  };
  const auto now_ms = [] { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; };
  constexpr std::uint32_t kLandmarks = 60000, kCameras = 2000;
  std::printf("%8s %8s %10s %10s %10s %10s %10s\n", "side m", "cell m", "answered", "mean ms", "99% ms", "all ms",
              "set us");
  for (const double side_m : {25.0, 50.0, 100.0})
    for (const double cell_m : {0.5, 1.0, 2.0}) {
      LandmarkIndex index({cell_m, false});
      std::vector<DescribedLandmark> landmarks;
      for (std::uint32_t i = 0; i < kLandmarks; ++i) {
        DescribedLandmark one;
        one.id = {{{RobotId(i % 2 ? "alpha" : "beta"), SensorId("front")}, i % 3}, i};
        one.updated_by = one.id.session.client;
        one.point_in_map = {uniform(0, side_m), uniform(0, side_m), uniform(0, 3)};
        const int axis = i % 4 < 2 ? 0 : 1;
        one.point_in_map[axis] = 5.0 * std::round(one.point_in_map[axis] / 5.0);
        const double yaw = uniform(-M_PI, M_PI);
        one.direction = {std::cos(yaw), std::sin(yaw), 0.0};
        one.nearest_m = uniform(1, 4);
        one.farthest_m = one.nearest_m + uniform(0, 3);
        landmarks.push_back(one);
      }
      double before = now_ms();
      for (const DescribedLandmark& one : landmarks) index.set(one);
      const double set_us = 1e3 * (now_ms() - before) / kLandmarks;
      std::vector<double> spent_ms;
      double answered = 0, all_ms = 0;
      for (std::uint32_t i = 0; i < kCameras; ++i) {
        Frustum frustum;
        frustum.pinhole = {640, 480, 525.0, 525.0, 319.5, 239.5};
        frustum.map_from_camera = {
            {uniform(0, side_m), uniform(0, side_m), 1.0},
            Eigen::Quaterniond(Eigen::AngleAxisd(uniform(-M_PI, M_PI), Eigen::Vector3d::UnitZ())) *
                Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5)};
        before = now_ms();
        const auto found = index.retrieve(frustum, {}, ClientId{RobotId("gamma"), SensorId("front")});
        spent_ms.push_back(now_ms() - before);
        all_ms += spent_ms.back();
        answered += static_cast<double>(found.size());
      }
      std::sort(spent_ms.begin(), spent_ms.end());
      std::printf("%8.0f %8.1f %10.0f %10.4f %10.4f %10.1f %10.2f\n", side_m, cell_m, answered / kCameras,
                  all_ms / kCameras, spent_ms[kCameras * 99 / 100], all_ms, set_us);
    }
}
