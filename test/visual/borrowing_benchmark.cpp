// What it is worth to a camera client that a server shares landmarks of a map with it made before (CVS III-C), and
// sends it its pose. borrowing_benchmark FOLDER [FIRST]: a TUM folder with groundtruth.txt. The frames before number
// FIRST (416) make the map, the others borrow from it: with their depth, and as a camera alone. borrowing_benchmark
// [METRES [SEED]]: in a simulated building, by features.

#include <mapweave/matching/landmark_description.h>
#include <mapweave/matching/rigid_from_points.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/simulation/feature_sensor.h>
#include <mapweave/visual/frame_input.h>
#include <mapweave/visual/visual_client.h>
#include <support/seen_frame.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>

using namespace mapweave;
using namespace mapweave::visual;

namespace {

const ClientPlace kAlpha{{RobotId("alpha"), SensorId("front")}, {}}, kBeta{{RobotId("beta"), SensorId("front")}, {}};

struct Drive {
  Pinhole camera;
  std::vector<Stamp> stamps;
  std::vector<Pose3> truth;  // world_from_camera
  std::function<Tracked(VisualClient&, std::size_t, bool alone)> add;
};

double now_ms() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

std::vector<matching::PointPair> pairs_of(const VisualClient& client, const Drive& drive) {
  std::vector<matching::PointPair> pairs;
  std::size_t number = 0;
  for (const PlacedFrame& placed : client.trajectory()) {
    if (placed.session != 0) continue;
    while (drive.stamps[number] < placed.stamp) ++number;
    pairs.push_back({drive.truth[number].t, placed.map_from_camera.t});
  }
  return pairs;
}

struct Server {
  matching::LandmarkIndex index;
  double spent_ms = 0.0;
  int asked = 0;

  std::vector<DescribedLandmark> under(const Pinhole& camera, const Pose3& map_from_camera) {
    matching::Frustum frustum;
    frustum.pinhole = camera;
    frustum.map_from_camera = map_from_camera;
    matching::RetrievalOptions options;
    options.margin_px = 40.0;
    const double before = now_ms();
    auto found = index.retrieve(frustum, options);
    spent_ms += now_ms() - before;
    ++asked;
    return found;
  }
};

// The map's frame by all of its frames' axes and places: places alone hardly determine it for a camera that turns on
// the spot.
Pose3 world_from_map(const VisualClient& client, const Drive& drive) {
  Eigen::Matrix3d turns = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  const auto placed = client.trajectory();
  std::vector<std::size_t> numbers;
  std::size_t number = 0;
  for (const PlacedFrame& frame : placed) {
    while (drive.stamps[number] < frame.stamp) ++number;
    numbers.push_back(number);
    turns += (drive.truth[number].q * frame.map_from_camera.q.conjugate()).toRotationMatrix();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> parts(turns, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Pose3 result;
  result.q = Eigen::Quaterniond(Eigen::Matrix3d(parts.matrixU() * parts.matrixV().transpose())).normalized();
  for (std::size_t i = 0; i < placed.size(); ++i)
    sum += drive.truth[numbers[i]].t - result.q * placed[i].map_from_camera.t;
  result.t = sum / static_cast<double>(placed.size());
  return result;
}

// Where the server's map sees the first frame: by its features, from about where the truth has it.
std::optional<Pose3> first_place(Server& server, const Drive& drive, const Pose3& about) {
  ClientOptions options;
  options.session.await_place = true;
  VisualClient probe(drive.camera, 0.0, options);
  drive.add(probe, 0, true);
  const auto request = probe.place_request(kBeta);
  if (!request || probe.place(kBeta, {request->stamp, MapId("alpha"), about, server.under(drive.camera, about)}) !=
                      PlaceVerdict::taken)
    return std::nullopt;
  return probe.trajectory().front().map_from_camera;
}

void borrow(Server& server, const Drive& drive, const Pose3& first, const char* what, bool alone, bool shares) {
  ClientOptions options;
  options.session.await_place = alone && shares;
  VisualClient client(drive.camera, 0.0, options);
  int lost = 0, published = 0;
  double spent_ms = 0.0;
  for (std::size_t i = 0; i < drive.stamps.size(); ++i) {
    const double before = now_ms();
    const Tracked tracked = drive.add(client, i, alone);
    lost += tracked.state == TrackState::lost;
    if (shares && alone && tracked.state == TrackState::waiting && i == 0) {
      const auto request = client.place_request(kBeta);
      if (request) client.place(kBeta, {request->stamp, MapId("alpha"), first, server.under(drive.camera, first)});
    }
    if (shares && tracked.keyframe && tracked.session == 0) {
      // A session that began with the answer is in the server's frame, others in that of their first camera.
      const Pose3 server_from_map = alone ? Pose3{} : first;
      auto found = server.under(drive.camera, compose(server_from_map, tracked.map_from_camera));
      for (auto& one : found) one = matching::transformed(one, {inverse(server_from_map), 1.0});
      client.borrow(kBeta, 0, found);
    }
    if (tracked.keyframe)
      for (const MapUpdate& update : client.take_updates(kBeta, PublishedDetail::light))
        for (const LandmarkChange& change : update.borrowed) published += static_cast<int>(change.seen.size());
    spent_ms += now_ms() - before;
  }
  const auto pairs = pairs_of(client, drive);
  const auto laid = matching::align_points(pairs, matching::Freedom::rigid),
             similar = matching::align_points(pairs, matching::Freedom::similarity);
  if (!laid || !similar) return;
  const Sim3 kept = alone && !shares ? *similar : *laid;
  double square = 0;
  for (const auto& pair : pairs)
    square += (kept.scale * (kept.pose.q * pair.in_b) + kept.pose.t - pair.in_a).squaredNorm();
  std::printf(
      "%-28s error %.4f m, scale %.4f; %zu frames placed, %d lost; %.2f ms a frame; %d sightings of borrowed ones\n",
      what, std::sqrt(square / static_cast<double>(pairs.size())), similar->scale, pairs.size(), lost,
      spent_ms / static_cast<double>(drive.stamps.size()), published);
}

void compare(const Drive& mapping, const Drive& borrowing, bool has_pictures) {
  VisualClient client(mapping.camera, 0.0, {}, matching::shipped_vocabulary());
  for (std::size_t i = 0; i < mapping.stamps.size(); ++i) mapping.add(client, i, false);
  client.finish();
  const auto pairs = pairs_of(client, mapping);
  const auto laid = matching::align_points(pairs, matching::Freedom::rigid);
  if (!laid) return;
  double square = 0;
  for (const auto& pair : pairs) square += (transformed(pair.in_b, laid->pose) - pair.in_a).squaredNorm();
  Map map;
  for (const MapUpdate& update : client.take_updates(kAlpha, PublishedDetail::exact))
    if (update.origin.map == MapId("alpha.front")) map = updated(std::move(map), update);
  Server server;
  double before = now_ms();
  const matching::LandmarkDescriber describer(map);
  for (const auto& [id, landmark] : map.landmarks)
    if (const auto known = describer.described(landmark)) server.index.set(*known);
  std::printf("map: error %.4f m; %zu landmarks, %zu described in %.1f ms\n",
              std::sqrt(square / static_cast<double>(pairs.size())), map.landmarks.size(), server.index.size(),
              now_ms() - before);
  const auto first =
      first_place(server, borrowing, compose(inverse(world_from_map(client, mapping)), borrowing.truth.front()));
  if (!first) {
    std::printf("the first frame is not known there\n");
    return;
  }
  borrow(server, borrowing, *first, "depth, nothing shared", false, false);
  borrow(server, borrowing, *first, "depth, borrowing", false, true);
  if (has_pictures) {
    borrow(server, borrowing, *first, "alone (scale given to it)", true, false);
    borrow(server, borrowing, *first, "alone, borrowing", true, true);
  }
  std::printf("%d retrievals, %.4f ms each\n", server.asked, server.spent_ms / std::max(1, server.asked));
}

void compare_in_folder(const std::filesystem::path& folder, std::size_t first) {
  std::vector<std::pair<double, Pose3>> truth;
  std::ifstream file(folder / "groundtruth.txt");
  for (std::string line; std::getline(file, line);) {
    double t, x, y, z, qx, qy, qz, qw;
    if (std::sscanf(line.c_str(), "%lf %lf %lf %lf %lf %lf %lf %lf", &t, &x, &y, &z, &qx, &qy, &qz, &qw) == 8)
      truth.push_back({t, {{x, y, z}, Eigen::Quaterniond(qw, qx, qy, qz).normalized()}});
  }
  const auto frames = std::make_shared<std::vector<Frame>>();
  const auto log = rawlog::open_log(folder);
  FramePacker packer;
  while (auto record = log->next())
    if (auto frame = packer(*record)) {
      frame->colour = {};
      frames->push_back(std::move(*frame));
    }
  Drive drives[2];
  for (std::size_t i = 0; i < frames->size(); ++i) {
    Drive& drive = drives[i < first ? 0 : 1];
    const double t = (*frames)[i].stamp.seconds();
    const auto near = std::min_element(truth.begin(), truth.end(), [&](const auto& a, const auto& b) {
      return std::abs(a.first - t) < std::abs(b.first - t);
    });
    drive.stamps.push_back((*frames)[i].stamp);
    drive.truth.push_back(near->second);
    drive.camera = packer.rig()->camera;
  }
  for (int side = 0; side < 2; ++side)
    drives[side].add = [frames, begin = side == 0 ? 0 : first](VisualClient& client, std::size_t i, bool alone) {
      Frame frame = (*frames)[begin + i];
      if (alone) frame.depth = {};
      return client.add(frame);
    };
  compare(drives[0], drives[1], true);
}

void compare_in_building(double length_m, std::uint64_t seed) {
  simulation::WorldOptions options;
  options.seed = seed;
  options.robots.resize(2);
  options.robots[0].id = "alpha";
  options.robots[1].id = "beta";
  for (auto& robot : options.robots) robot.length_m = length_m;
  options.cameras.resize(1);
  options.cameras[0].kind = simulation::SimulatedCameraKind::rgbd;
  WorkerPool here(1);
  const simulation::World world(options, here);
  const simulation::FeatureOptions features;
  const simulation::LandmarkField field(world.scene(0), world.buildings()[0], features);
  const auto& model = options.cameras[0].intrinsics();
  Drive drives[2];
  for (std::size_t robot = 0; robot < 2; ++robot) {
    const auto recording = std::make_shared<simulation::FeatureRecording>(world, field, features, robot, 0);
    Drive& drive = drives[robot];
    drive.camera = {model.width, model.height, model.fx, model.fy, model.cx, model.cy};
    for (std::size_t i = 0; i < recording->frame_count(); ++i) {
      const auto seen = recording->frame(i);
      drive.stamps.push_back(seen.stamp);
      drive.truth.push_back(seen.world_from_camera);
    }
    drive.add = [recording](VisualClient& client, std::size_t i, bool alone) {
      return client.add(test::frame_of(recording->frame(i), !alone));
    };
  }
  compare(drives[0], drives[1], false);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1 && std::filesystem::is_directory(argv[1]))
    compare_in_folder(argv[1], argc > 2 ? static_cast<std::size_t>(std::atoll(argv[2])) : 416);
  else
    compare_in_building(argc > 1 ? std::atof(argv[1]) : 60.0,
                        argc > 2 ? static_cast<std::uint64_t>(std::atoll(argv[2])) : 1);
}
