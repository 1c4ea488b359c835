// An hour of driving by a client that takes features: memory, processor time for each frame, and error, over time.
// endurance_benchmark [METRES [SEED]]: of path, at about 0.6 m/s; 2200 m are an hour.
// endurance_benchmark team [METRES [SEED [none|view|full]]]: two clients, round the same rooms each on its own path,
// and their camera map server.

#include "endurance_team.h"

#include <mapweave/matching/rigid_from_points.h>
#include <mapweave/simulation/feature_sensor.h>
#include <mapweave/visual/visual_client.h>
#include <support/seen_frame.h>

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>

using namespace mapweave;

namespace {

double resident_mb() {
  std::ifstream file("/proc/self/statm");
  double total = 0, resident = 0;
  file >> total >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

void drive_alone(const simulation::WorldOptions& options) {
  WorkerPool here(1);
  const simulation::World world(options, here);
  const simulation::FeatureOptions features;
  const simulation::LandmarkField field(world.scene(0), world.buildings()[0], features);
  const simulation::FeatureRecording recording(world, field, features, 0, 0);
  const auto& model = options.cameras[0].intrinsics();
  visual::VisualClient client({model.width, model.height, model.fx, model.fy, model.cx, model.cy}, 0.0, {},
                              matching::shipped_vocabulary());

  std::printf("%zu frames; before: %.0f MB\n", recording.frame_count(), resident_mb());
  std::printf("%8s %8s %8s %8s %8s %10s %10s %6s %6s\n", "minute", "ms", "p99 ms", "max ms", "MB", "keyframes",
              "landmarks", "loops", "lost");
  std::vector<double> spent_ms;
  std::vector<Eigen::Vector3d> truth;
  double total_ms = 0.0;
  int lost = 0;
  const double rate = options.cameras[0].frames_per_second;
  const auto often = static_cast<std::size_t>(300.0 * rate);
  for (std::size_t i = 0; i < recording.frame_count(); ++i) {
    const simulation::SimulatedFeatureFrame seen = recording.frame(i);
    const visual::FeatureFrame frame = test::frame_of(seen);
    truth.push_back(seen.world_from_camera.t);
    const std::clock_t before = std::clock();
    lost += client.add(frame).state == visual::TrackState::lost;
    spent_ms.push_back(1e3 * static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC);
    if ((i + 1) % often != 0 && i + 1 != recording.frame_count()) continue;
    double sum = 0;
    for (double ms : spent_ms) sum += ms;
    total_ms += sum;
    std::sort(spent_ms.begin(), spent_ms.end());
    std::printf("%8.0f %8.2f %8.2f %8.1f %8.0f %10zu %10zu %6zu %6d\n", static_cast<double>(i + 1) / rate / 60.0,
                sum / static_cast<double>(spent_ms.size()), spent_ms[spent_ms.size() * 99 / 100], spent_ms.back(),
                resident_mb(), client.keyframes().size(), client.landmarks().size(), client.loops().size(), lost);
    std::fflush(stdout);
    spent_ms.clear();
  }
  client.finish();
  std::vector<matching::PointPair> pairs;
  for (const visual::PlacedFrame& placed : client.trajectory()) {
    const double number = (placed.stamp.seconds() - recording.frame(0).stamp.seconds()) * rate;
    pairs.push_back({truth[static_cast<std::size_t>(std::lround(number))], placed.map_from_camera.t});
  }
  const auto laid = matching::align_points(pairs, matching::Freedom::rigid);
  double square = 0;
  if (laid)
    for (const matching::PointPair& pair : pairs)
      square += (transformed(pair.in_b, laid->pose) - pair.in_a).squaredNorm();
  std::printf("%.0f frames/s; error %.3f m (root mean square, laid on the truth) of %zu frames\n",
              1e3 * static_cast<double>(recording.frame_count()) / total_ms,
              std::sqrt(square / static_cast<double>(std::max<std::size_t>(1, pairs.size()))), pairs.size());
}

}  // namespace

int main(int argc, char** argv) try {
  std::vector<std::string> words(argv + 1, argv + argc);
  const bool is_team = !words.empty() && words.front() == "team";
  if (is_team) words.erase(words.begin());
  simulation::WorldOptions options;
  if (words.size() > 1) options.seed = std::atoll(words[1].c_str());
  options.robots.resize(is_team ? 2 : 1);
  options.robots[0].id = "alpha";
  if (is_team) {
    options.robots[1].id = "beta";
    options.robots[1].order = simulation::TourOrder::back;
  }
  for (auto& robot : options.robots) robot.length_m = words.empty() ? 2200.0 : std::atof(words[0].c_str());
  options.cameras.resize(1);
  options.cameras[0].kind = simulation::SimulatedCameraKind::rgbd;
  if (!is_team) {
    drive_alone(options);
    return 0;
  }
  tiers::ServerOptions sharing;
  const std::string share = words.size() > 2 ? words[2] : "view";
  sharing.share = share == "full"   ? tiers::Sharing::full
                  : share == "view" ? tiers::Sharing::view
                                    : tiers::Sharing::none;
  endurance::drive_team(options, sharing);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
