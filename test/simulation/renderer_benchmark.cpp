// Pictures a second of 640 x 480, on one thread and on all. With a folder: writes some of them there, to look at.

#include <mapweave/core/stopwatch.h>
#include <mapweave/simulation/camera_recording.h>

#include <cstdio>
#include <ctime>
#include <fstream>
#include <string>

using namespace mapweave;
using namespace mapweave::simulation;

namespace {

WorldOptions world_of(SimulatedCameraKind kind, bool colour) {
  WorldOptions options;
  options.seed = 7;
  options.robots.resize(1);
  options.robots[0].id = "alpha";
  options.robots[0].length_m = 40.0;
  options.cameras.resize(1);
  options.cameras[0].kind = kind;
  options.cameras[0].colour = colour;
  options.cameras[0].depth.offset_ms = 5.0;
  options.people.count = 1;
  options.motion.floor_tilt_deg = 0.15;
  return options;
}

void write(const CameraFrame& frame, const std::string& path) {
  std::ofstream file(path, std::ios::binary);
  file << (frame.left.channels == 3 ? "P6\n" : "P5\n") << frame.left.width << ' ' << frame.left.height << "\n255\n";
  file.write(reinterpret_cast<const char*>(frame.left.values.data()),
             static_cast<std::streamsize>(frame.left.values.size()));
}

}  // namespace

int main(int argc, char** argv) {
  WorkerPool all(available_processors()), here(1);
  for (const bool colour : {false, true}) {
    for (const SimulatedCameraKind kind : {SimulatedCameraKind::rgbd, SimulatedCameraKind::stereo}) {
      const World world(world_of(kind, colour), here);
      Stopwatch watch;
      const std::size_t surfaces = world.scene(0).surfaces().size();
      const double painted_s = watch.seconds();
      const CameraRecording recording(world, 0, 0);
      std::printf("%s %s: %zu surfaces painted in %.2f s;", colour ? "colour" : "grey",
                  kind == SimulatedCameraKind::rgbd ? "RGB-D" : "stereo", surfaces, painted_s);
      const std::size_t frames = std::min<std::size_t>(recording.frame_count(), 96);
      for (WorkerPool* pool : {&here, &all}) {
        std::vector<CameraRecording::Workspace> workspaces(frames / 8);
        watch = Stopwatch();
        const std::clock_t before = std::clock();
        pool->for_each(frames / 8, [&](std::size_t part) {
          for (std::size_t i = 0; i < 8; ++i) {
            const CameraFrame frame = recording.frame(part * 8 + i, workspaces[part]);
            if (argc > 1 && i == 0 && pool == &here)
              write(frame, std::string(argv[1]) + "/" + std::to_string(part) + (colour ? ".ppm" : ".pgm"));
          }
        });
        std::printf(" %.1f frames/s on %d thread(s) (%.1f ms of processor time each)",
                    static_cast<double>(frames) / watch.seconds(), pool->threads(),
                    1e3 * static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC / static_cast<double>(frames));
      }
      std::printf("\n");
    }
  }
}
