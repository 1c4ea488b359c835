// Frames of features a second, on one thread.

#include <mapweave/core/stopwatch.h>
#include <mapweave/simulation/feature_sensor.h>

#include <cstdio>
#include <ctime>

using namespace mapweave;
using namespace mapweave::simulation;

int main() {
  WorldOptions options;
  options.robots.resize(1);
  options.robots[0].id = "alpha";
  options.robots[0].length_m = 200.0;
  options.cameras.resize(1);
  WorkerPool here(1);
  const World world(options, here);
  Stopwatch watch;
  const LandmarkField field(world.scene(0), world.buildings()[0], {});
  std::printf("%zu landmarks in %.2f s\n", field.landmarks().size(), watch.seconds());
  const FeatureRecording recording(world, field, {}, 0, 0);
  std::size_t features = 0;
  const std::clock_t before = std::clock();
  for (std::size_t i = 0; i < recording.frame_count(); ++i) features += recording.frame(i).features.size();
  std::printf(
      "%zu frames, %.0f features each: %.0f frames/s of processor time\n", recording.frame_count(),
      static_cast<double>(features) / static_cast<double>(recording.frame_count()),
      static_cast<double>(recording.frame_count()) * CLOCKS_PER_SEC / static_cast<double>(std::clock() - before));
}
