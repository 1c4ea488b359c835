// Pictures a second. With a folder: writes some of them there, to look at.

#include <mapweave/core/stopwatch.h>
#include <mapweave/simulation/renderer.h>

#include <cstdio>
#include <fstream>
#include <string>

using namespace mapweave;
using namespace mapweave::simulation;

int main(int argc, char** argv) {
  ApartmentOptions apartment;
  const FloorPlan plan = make_apartment_plan(apartment, 7);
  WorkerPool pool(1);
  Stopwatch watch;
  const Scene scene(plan, {}, 7, pool);
  std::printf("%zu surfaces painted in %.2f s\n", scene.surfaces().size(), watch.seconds());
  const CameraModel camera{CameraIntrinsics{}};
  View view;
  for (const Channels channels : {Channels::none, Channels::grey, Channels::colour}) {
    watch = Stopwatch();
    int frames = 0;
    for (const Room& room : plan.rooms) {
      for (int i = 0; i < 12; ++i) {
        const double yaw = i * M_PI / 6.0;
        const Eigen::Quaterniond q = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitX()) *
                                     Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5);
        render(scene, {}, camera, {{room.inside.centre().x, room.inside.centre().y, 0.6}, q}, channels, view);
        ++frames;
        if (argc < 2 || channels != Channels::colour || i % 4 != 0) continue;
        std::ofstream file(std::string(argv[1]) + "/" + std::to_string(frames) + ".ppm", std::ios::binary);
        file << "P6\n" << view.width << ' ' << view.height << "\n255\n";
        for (int row = 0; row < view.height; ++row) {
          for (int k = 0; k < 3 * view.width; ++k)
            file.put(static_cast<char>(static_cast<int>(view.values[3 * view.at(row, 0) + static_cast<std::size_t>(k)])));
        }
      }
    }
    std::printf("%d channels: %.1f frames/s\n", view.channels, frames / watch.seconds());
  }
}
