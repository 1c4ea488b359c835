// Bundle adjustment, ours and that of Ceres: bundle_benchmark [KEYFRAMES [LANDMARKS [OBSERVATIONS [FREE [TIMES]]]]]; by
// default those of CORB-SLAM's table 2, seen along rounds through a hall, with 2 pixels of noise. FREE: of the
// keyframes, the others are fixed (a window). Prints the median time of TIMES runs.
#include "ceres_bundle.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <random>

using namespace mapweave;

namespace {

struct World {
  graph::Bundle bundle;
  std::vector<Pose3> truth;
};

World hall(int keyframes, int landmarks, int observations, int free) {
  World world;
  graph::Bundle& bundle = world.bundle;
  std::vector<Pose3>& truth = world.truth;
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> even(0.0, 1.0);
  bundle.cameras.push_back({640, 480, 520.0, 520.0, 320.0, 240.0});
  const double kRounds = 2.0, kRadius_m = 12.0;
  for (int i = 0; i < keyframes; ++i) {
    const double angle = 2.0 * M_PI * kRounds * i / keyframes;
    const Eigen::Quaterniond heading(Eigen::AngleAxisd(-angle, Eigen::Vector3d::UnitY()));
    truth.push_back(
        {{kRadius_m * std::cos(angle), 0.05 * std::sin(5.0 * angle), kRadius_m * std::sin(angle)}, heading});
    Pose3 start = truth.back();
    const bool fixed = i == 0 || i < keyframes - free;
    if (!fixed) start.t += 0.05 * Eigen::Vector3d(normal(random), normal(random), normal(random));
    bundle.views.push_back({view_of(start), 0, fixed});
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
      sighting.view = static_cast<std::uint32_t>(view);
      sighting.point = static_cast<std::uint32_t>(made);
      sighting.pixel = pixel + 2.0 * Eigen::Vector2d(normal(random), normal(random));
      sighting.sigma_px = 2.0;
      sighting.inverse_depth = 1.0 / p.z() + 0.004 * normal(random);
      sighting.inverse_depth_sigma = 0.004;
      sightings.push_back(sighting);
    }
    if (sightings.size() < 2) continue;
    bundle.points.push_back(point + 0.05 * Eigen::Vector3d(normal(random), normal(random), normal(random)));
    seen += static_cast<int>(sightings.size());
    ++made;
    bundle.sightings.insert(bundle.sightings.end(), sightings.begin(), sightings.end());
  }
  return world;
}

double error_m(const World& world, const graph::Bundle& bundle) {
  double sum = 0.0;
  for (std::size_t i = 0; i < world.truth.size(); ++i)
    sum += (bundle.views[i].view.centre() - world.truth[i].t).squaredNorm();
  return std::sqrt(sum / static_cast<double>(world.truth.size()));
}

}  // namespace

int main(int argc, char** argv) {
  const auto argument = [&](int i, int otherwise) { return argc > i ? std::atoi(argv[i]) : otherwise; };
  const int keyframes = argument(1, 456), free = argument(4, keyframes), times = argument(5, 1);
  const World world = hall(keyframes, argument(2, 60000), argument(3, 300000), free);
  std::printf("%d keyframes (%d free), %zu landmarks, %zu observations\n", keyframes, free, world.bundle.points.size(),
              world.bundle.sightings.size());
  using Adjust = std::function<graph::BundleReport(graph::Bundle&)>;
  struct BackEnd {
    const char* name;
    Adjust adjust;
    std::vector<double> seconds;
    graph::BundleReport report;
    double error_m;
  };
  std::vector<BackEnd> back_ends;
  const auto ceres_by = [](ceres::LinearSolverType solver) {
    return [solver](graph::Bundle& bundle) { return graph::adjust_by_ceres(bundle, {}, solver); };
  };
  back_ends.push_back({"ours", [](graph::Bundle& bundle) { return graph::adjust(bundle); }, {}, {}, 0.0});
  back_ends.push_back({"SPARSE_SCHUR", ceres_by(ceres::SPARSE_SCHUR), {}, {}, 0.0});
  back_ends.push_back({"DENSE_SCHUR", ceres_by(ceres::DENSE_SCHUR), {}, {}, 0.0});
  for (int round = 0; round < times; ++round)
    for (BackEnd& back_end : back_ends) {
      graph::Bundle bundle = world.bundle;
      const std::clock_t begin = std::clock();
      back_end.report = back_end.adjust(bundle);
      back_end.seconds.push_back(static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
      back_end.error_m = error_m(world, bundle);
    }
  for (BackEnd& back_end : back_ends) {
    std::sort(back_end.seconds.begin(), back_end.seconds.end());
    std::printf("  %-12s %.3g s of processor time, %d iterations, error %.4f -> %.4f m, cost %.6g\n", back_end.name,
                back_end.seconds[back_end.seconds.size() / 2], back_end.report.iterations, error_m(world, world.bundle),
                back_end.error_m, back_end.report.cost_after);
  }
}
