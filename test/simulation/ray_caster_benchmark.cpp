// Scans per second of one thread, in apartments of two sizes: the exact ranges, and whole recordings with noise and
// another robot in sight.
#include <mapweave/simulation/world.h>

#include <cstdio>
#include <ctime>
#include <optional>

using namespace mapweave;
using namespace mapweave::simulation;

int main() {
  for (const double width_m : {18.0, 60.0}) {
    WorldOptions options;
    options.buildings.resize(1);
    options.buildings[0].apartment.width_m = width_m;
    options.buildings[0].apartment.height_m = 0.7 * width_m;
    options.laser.rays = 180;
    for (const char* id : {"alpha", "beta"}) {
      options.robots.emplace_back();
      options.robots.back().id = id;
      options.robots.back().length_m = 600.0;
    }
    WorkerPool here(1);
    const auto seconds_of = [](auto&& work) {
      const std::clock_t start = std::clock();  // of the processor: the machine may be busy
      work();
      return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    };
    std::optional<World> world;
    const double build_s = seconds_of([&] { world.emplace(options, here); });
    const FloorPlan& plan = world->buildings()[0];
    const double scans = static_cast<double>(world->scan_count(0));

    const RayCaster caster(plan.walls);
    SimulatedLaserOptions exact = options.laser;
    exact.noise_m = exact.noise_per_m = exact.outliers = exact.dropouts = 0.0;
    const LaserSensor laser(caster, exact);
    double sum = 0.0;
    const double cast_s = seconds_of([&] {
      for (std::size_t i = 0; i < world->scan_count(0); ++i) {
        sum += static_cast<double>(
            laser.scan(world->trajectory(0).at(0.2 * static_cast<double>(i)), {}, RandomNumbers(i))[90]);
      }
    });
    const double record_s = seconds_of([&] {
      Recording recording(*world, 0);
      while (const auto step = recording.next()) sum += step->odometry_from_robot.x;
    });
    std::printf(
        "apartment %3.0f m wide, %5zu walls: %7.0f scans/s of 180 rays cast, %7.0f recorded; 2 x 600 m planned in %.2f "
        "s (sum %.0f)\n",
        width_m, plan.walls.size(), scans / cast_s, scans / record_s, build_s, sum);
  }
}
