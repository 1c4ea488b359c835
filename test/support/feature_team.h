#pragma once
// Robots in a simulated building whose cameras hand over features, and the map server that they share, by data time.

#include <mapweave/matching/rigid_from_points.h>
#include <mapweave/simulation/feature_sensor.h>
#include <mapweave/tiers/camera_agent.h>
#include <mapweave/tiers/visual_server.h>
#include <support/seen_frame.h>

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>

namespace mapweave::test {

inline simulation::WorldOptions camera_world(simulation::PlanKind kind, std::int64_t seed, std::size_t robots,
                                             double frames_per_second = 12.0) {
  static const char* const kNames[] = {"alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta"};
  simulation::WorldOptions options;
  options.seed = seed;
  options.buildings.resize(1);
  options.buildings[0].kind = kind;
  options.buildings[0].seed = seed;
  options.cameras.resize(1);
  options.cameras[0].kind = simulation::SimulatedCameraKind::rgbd;
  options.cameras[0].frames_per_second = frames_per_second;
  options.robots.resize(robots);
  for (std::size_t i = 0; i < robots; ++i) options.robots[i].id = kNames[i];
  return options;
}

// An apartment of seven rooms, so many metres of path for each; every robot shares rooms with the next.
inline simulation::WorldOptions apartment(std::size_t robots, double length_m, std::int64_t seed = 7) {
  simulation::WorldOptions options = camera_world(simulation::PlanKind::apartment, seed, robots);
  for (std::size_t i = 0; i < robots; ++i) {
    auto& robot = options.robots[i];
    robot.first_room = static_cast<int>(i % 5);
    robot.last_room = robot.first_room + 2;
    robot.length_m = length_m;
    if (i >= 5) robot.order = simulation::TourOrder::back;
  }
  return options;
}

class FeatureTeam {
 public:
  // What a robot's camera gives, and where it was.
  struct Shot {
    visual::FeatureFrame frame;
    Pose3 world_from_camera;
  };

  explicit FeatureTeam(const tiers::ServerOptions& sharing, int threads = 1, const rig::RigOptions& rig = {})
      : pool(threads), server(TierId("edge"), sharing, {}, rig), sharing_(sharing) {}
  // Each camera of a robot is a client.
  FeatureTeam(const simulation::WorldOptions& options, const tiers::ServerOptions& sharing,
              const simulation::FeatureOptions& features = {}, int threads = 1, const rig::RigOptions& rig = {})
      : FeatureTeam(sharing, threads, rig) {
    world_.emplace(options, pool);
    field_.emplace(world_->scene(0), world_->buildings()[0], features);
    for (std::size_t i = 0; i < options.robots.size(); ++i)
      for (std::size_t c = 0; c < options.cameras.size(); ++c) {
        const auto recording = std::make_shared<const simulation::FeatureRecording>(*world_, *field_, features, i, c);
        const auto& model = options.cameras[c].intrinsics();
        const Pose3 robot_from_camera =
            compose(inverse(world_->world_from_robot(i, 0.0)), recording->frame(0).world_from_camera);
        add({{RobotId(options.robots[i].id), SensorId(options.cameras[c].id)}, robot_from_camera},
            {model.width, model.height, model.fx, model.fy, model.cx, model.cy}, recording->frame_count(),
            [recording](std::size_t number) { return shot_of(recording->frame(number)); });
      }
  }

  struct Robot {
    visual::ClientPlace place;
    Pinhole camera;
    visual::ClientOptions options;
    std::size_t count = 0;  // of frames, 12 a second
    std::function<Shot(std::size_t)> shoot;
    std::optional<tiers::CameraAgent> agent;
    std::optional<visual::VisualClient> client;
    std::size_t next = 0, begin = 0;  // frames; begin: it stands in a cupboard before
    bool has_depth = true, cut_off = false, greeted = false;
    std::map<std::int64_t, Eigen::Vector3d> truth;  // of the camera, by stamp
    Stamp last;
    int lost = 0, corrections = 0, answered = 0, placed = 0;
    std::size_t borrowed_seen = 0;  // at most

    // Root mean square distance from the truth, laid on it; of the session.
    double error_m(int session = 0, bool with_scale = false, double* scale = nullptr) const {
      std::vector<matching::PointPair> pairs;
      for (const visual::PlacedFrame& frame : client->trajectory())
        if (frame.session == session) pairs.push_back({truth.at(frame.stamp.ns), frame.map_from_camera.t});
      return laid(pairs, with_scale, scale);
    }
  };

  Robot& add(visual::ClientPlace place, const Pinhole& camera, std::size_t count,
             std::function<Shot(std::size_t)> shoot, const visual::ClientOptions& options = {}) {
    Robot& robot = robots.emplace_back();
    robot.place = std::move(place);
    robot.camera = camera;
    robot.options = options;
    robot.count = count;
    robot.shoot = std::move(shoot);
    robot.agent.emplace(robot.place);
    robot.client.emplace(robot.camera, 0.0, robot.options, matching::shipped_vocabulary());
    return robot;
  }

  static double laid(const std::vector<matching::PointPair>& pairs, bool with_scale = false, double* scale = nullptr) {
    const auto found =
        matching::align_points(pairs, with_scale ? matching::Freedom::similarity : matching::Freedom::rigid);
    if (!found) return std::numeric_limits<double>::infinity();
    if (scale != nullptr) *scale = found->scale;
    double square = 0.0;
    for (const auto& pair : pairs)
      square += (found->scale * (found->pose.q * pair.in_b) + found->pose.t - pair.in_a).squaredNorm();
    return std::sqrt(square / static_cast<double>(pairs.size()));
  }

  // Root mean square distance of a component's keyframes from the truth, one alignment for all.
  double error_m(const fusion::Component& component) const {
    std::vector<matching::PointPair> pairs;
    for (const Robot& robot : robots)
      for (const auto& [id, node] : component.map.nodes)
        if (id.session.client == robot.place.client)
          pairs.push_back(
              {robot.truth.at(node.stamp.ns), compose(node.map_from_node, robot.place.robot_from_camera).t});
    return laid(pairs);
  }

  // Frames of every robot up to the next exchange, then the exchange. False when all have ended.
  bool round() {
    const auto frames = static_cast<std::size_t>(std::lround(kRate_hz / sharing_.share_rate_hz));
    bool any = false;
    pool.for_each(robots.size(), [&](std::size_t i) { drive(robots[i], frames); });
    for (Robot& robot : robots) any = any || robot.next < robot.count;
    ++rounds_;
    exchange();
    server.advance(now(), pool);
    return any;
  }
  void run() {
    while (round()) {}
    finish();
  }
  // Nobody drives on; the last updates.
  void finish() {
    for (Robot& robot : robots) robot.client->finish();
    exchange();
  }
  Stamp now() const { return now_; }

  WorkerPool pool;
  tiers::VisualServer server;
  std::deque<Robot> robots;
  std::function<void(const Robot&, const std::string&)> overheard = {};  // updates that came to be stored
  std::function<void(PlaceRequest&)> garbled = {};                       // on the way
  std::function<void(const Robot&, const Share&)> on_share = {};         // what it is about to receive
  std::function<bool(const Share&)> is_lost = {};                        // on the way

 private:
  static constexpr double kRate_hz = 12.0;

  static Shot shot_of(const simulation::SimulatedFeatureFrame& seen) {
    return {frame_of(seen), seen.world_from_camera};
  }

  void drive(Robot& robot, std::size_t frames) {
    if (robot.begin > rounds_ * frames) return;
    for (std::size_t i = 0; i < frames && robot.next < robot.count; ++i) {
      Shot shot = robot.shoot(robot.next++);
      if (!robot.has_depth) std::fill(shot.frame.inverse_depths.begin(), shot.frame.inverse_depths.end(), 0.0F);
      robot.lost += robot.client->add(shot.frame).state == visual::TrackState::lost;
      robot.truth[shot.frame.stamp.ns] = shot.world_from_camera.t;
      robot.last = shot.frame.stamp;
    }
  }

  void exchange() {
    for (Robot& robot : robots) publish(robot);
    for (Robot& robot : robots) ask(robot);
  }

  void publish(Robot& robot) {
    if (robot.client->trajectory().empty() && !robot.client->run(robot.place)) return;
    if (now_ < robot.last) now_ = robot.last;
    for (const transport::Envelope& update : robot.agent->updates(*robot.client, now_)) {
      if (robot.cut_off) continue;
      greet(robot);
      const auto received = server.receive(*robot.agent->session(), update.bytes);
      for (const std::string& stored : received.stored)
        if (overheard) overheard(robot, stored);
      robot.agent->stored(received.receipt);
    }
    if (robot.cut_off || !robot.client->run(robot.place)) return;
    if (const auto view = robot.agent->view(*robot.client)) {
      greet(robot);
      const auto share = server.share(*robot.client->run(robot.place), decode_client_view(*view, "test"));
      if (share && !(is_lost && is_lost(*share))) {
        robot.corrections += !share->corrected.empty();
        if (on_share) on_share(robot, *share);
        robot.agent->receive_share(*robot.client, encode(*share));
      }
      robot.borrowed_seen = std::max(robot.borrowed_seen, robot.client->borrowed_seen());
    }
  }

  void ask(Robot& robot) {
    if (robot.cut_off || !robot.client->run(robot.place) || robot.client->view(robot.place)) return;
    if (const auto request = robot.agent->place_request(*robot.client)) {
      greet(robot);
      PlaceRequest asked = decode_place_request(*request, "test");
      if (garbled) garbled(asked);
      if (const auto answer = server.place(*robot.client->run(robot.place), asked, pool)) {
        ++robot.answered;
        robot.placed += robot.agent->receive_place(*robot.client, encode(*answer)) == visual::PlaceVerdict::taken;
      }
    }
  }

  void greet(Robot& robot) {
    if (robot.greeted) return;
    robot.agent->reconnected(*robot.client,
                             server.greet({*robot.client->run(robot.place), matching::shipped_vocabulary().hash()}));
    robot.greeted = true;
  }

  tiers::ServerOptions sharing_;
  std::optional<simulation::World> world_;
  std::optional<simulation::LandmarkField> field_;
  std::size_t rounds_ = 0;
  Stamp now_;
};

}  // namespace mapweave::test
