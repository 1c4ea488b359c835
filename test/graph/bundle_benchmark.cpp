// Bundle adjustment of a whole map: bundle_benchmark [KEYFRAMES [LANDMARKS [OBSERVATIONS]]]; by default those of
// CORB-SLAM's table 2, seen along rounds through a hall, with 2 pixels of noise.
#include <mapweave/graph/bundle_adjustment.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <random>

using namespace mapweave;

int main(int argc, char** argv) {
  const int keyframes = argc > 1 ? std::atoi(argv[1]) : 456, landmarks = argc > 2 ? std::atoi(argv[2]) : 60000,
            observations = argc > 3 ? std::atoi(argv[3]) : 300000;
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> even(0.0, 1.0);
  graph::Bundle bundle;
  bundle.cameras.push_back({640, 480, 520.0, 520.0, 320.0, 240.0});
  std::vector<Pose3> truth;
  const double kRounds = 2.0, kRadius_m = 12.0;
  for (int i = 0; i < keyframes; ++i) {
    const double angle = 2.0 * M_PI * kRounds * i / keyframes;
    const Eigen::Quaterniond heading(Eigen::AngleAxisd(-angle, Eigen::Vector3d::UnitY()));
    truth.push_back(
        {{kRadius_m * std::cos(angle), 0.05 * std::sin(5.0 * angle), kRadius_m * std::sin(angle)}, heading});
    Pose3 start = truth.back();
    if (i > 0) start.t += 0.05 * Eigen::Vector3d(normal(random), normal(random), normal(random));
    bundle.views.push_back({view_of(start), 0, i == 0});
  }
  int seen = 0, made = 0;
  while (made < landmarks && seen < observations) {
    const int from = static_cast<int>(even(random) * keyframes);
    const double z = 1.0 + 7.0 * even(random);
    const Eigen::Vector3d in_camera(z * (even(random) - 0.5), z * 0.8 * (even(random) - 0.5), z);
    const Eigen::Vector3d point = transformed(in_camera, truth[static_cast<std::size_t>(from)]);
    std::vector<graph::BundleSighting> sightings;
    const int most = (observations - seen) / (landmarks - made) + 2;
    std::vector<int> order;
    for (int step = 0; step < 30; ++step)
      order.push_back((from + (step % 2 == 0 ? step / 2 : keyframes - (step + 1) / 2)) % keyframes);
    order.push_back((from + keyframes / 2) % keyframes);  // a round later
    for (const int view : order) {
      if (static_cast<int>(sightings.size()) >= most) break;
      const Eigen::Vector3d p = transformed(point, inverse(truth[static_cast<std::size_t>(view)]));
      if (p.z() < 0.3 || p.z() > 10.0) continue;
      const Eigen::Vector2d pixel(520.0 * p.x() / p.z() + 320.0, 520.0 * p.y() / p.z() + 240.0);
      if (!(pixel.x() > 0 && pixel.x() < 640 && pixel.y() > 0 && pixel.y() < 480)) continue;
      graph::BundleSighting sighting;
      sighting.view = static_cast<std::uint32_t>(view), sighting.point = static_cast<std::uint32_t>(made);
      sighting.pixel = pixel + 2.0 * Eigen::Vector2d(normal(random), normal(random)), sighting.sigma_px = 2.0;
      sighting.inverse_depth = 1.0 / p.z() + 0.004 * normal(random), sighting.inverse_depth_sigma = 0.004;
      sightings.push_back(sighting);
    }
    if (sightings.size() < 2) continue;
    bundle.points.push_back(point + 0.05 * Eigen::Vector3d(normal(random), normal(random), normal(random)));
    seen += static_cast<int>(sightings.size()), ++made;
    bundle.sightings.insert(bundle.sightings.end(), sightings.begin(), sightings.end());
  }
  const auto error = [&] {
    double sum = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i) sum += (bundle.views[i].view.centre() - truth[i].t).squaredNorm();
    return std::sqrt(sum / static_cast<double>(truth.size()));
  };
  const double before_m = error();
  const std::clock_t begin = std::clock();
  const graph::BundleReport report = graph::adjust(bundle);
  const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  std::printf(
      "%d keyframes, %d landmarks, %d observations: %.2f s of processor time, %d iterations, error %.3f -> %.4f m\n",
      keyframes, made, seen, seconds, report.iterations, before_m, error());
}
