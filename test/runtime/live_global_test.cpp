// Cameras that do not wait and keep what the whole team maps (server.share: global), on wires to a live map server.
#include <mapweave/runtime/live_map_server.h>
#include <mapweave/tiers/subjects.h>
#include <support/live_camera.h>
#include <support/received_updates.h>
#include <support/slowness.h>

#include <gmock/gmock.h>
#include <deque>
#include <set>
#include <thread>

namespace mapweave::runtime {
namespace {

using namespace std::chrono_literals;
using Robot = test::FeatureTeam::Robot;

tiers::ServerOptions sharing(tiers::Sharing share) {
  tiers::ServerOptions options;
  options.share = share;
  options.fuse_after = 5;
  return options;
}

// Loses shares that hold keyframes, so many of them.
class LossyWire : public transport::Channel {
 public:
  LossyWire(std::shared_ptr<Channel> wire, int loses) : wire_(std::move(wire)), loses_(loses) {}
  Sent send(transport::Envelope message) override { return wire_->send(std::move(message)); }
  std::size_t in_flight_bytes() const override { return wire_->in_flight_bytes(); }
  std::vector<Delivery> receive(std::chrono::milliseconds patience) override {
    std::vector<Delivery> arrived;
    for (Delivery& one : wire_->receive(patience)) {
      if (!is_lost(one.envelope)) {
        arrived.push_back(std::move(one));
        continue;
      }
      wire_->acknowledge(one.number);
    }
    return arrived;
  }
  void acknowledge(std::uint64_t delivery) override { wire_->acknowledge(delivery); }
  void set_listener(std::function<void()> listener) override { wire_->set_listener(std::move(listener)); }
  void close() override { wire_->close(); }
  bool is_closed() const override { return wire_->is_closed(); }
  const std::set<NodeId>& lost() const { return lost_; }  // keyframes, once nobody receives any more

 private:
  bool is_lost(const transport::Envelope& message) {
    if (loses_ == 0 || message.subject != tiers::subject::kShare) return false;
    const Share share = decode_share(message.bytes, "test");
    if (share.keyframes.empty()) return false;
    for (const SharedKeyframe& keyframe : share.keyframes)
      if (keyframe.features) lost_.insert(keyframe.id);
    --loses_;
    return true;
  }
  std::shared_ptr<Channel> wire_;
  int loses_;
  std::set<NodeId> lost_;
};

// A team of cameras at a live camera map server.
struct LiveTeam {
  LiveTeam(const simulation::WorldOptions& world, tiers::Sharing share)
      : team(world, tiers::ServerOptions{}), server(TierId("edge"), sharing(share), {}, {}, std::nullopt) {}

  // All drive, until `end` of their frames; who begins later stands until then.
  void drive(double end = 1.0) {
    for (auto i = cameras.size(); i < team.robots.size(); ++i) {
      wires.push_back(std::make_shared<LossyWire>(server.connect(), loses));
      test::LiveCameraOptions options;
      options.client = team.robots[i].options;
      cameras.emplace_back(team.robots[i].place, team.robots[i].camera, 0.0, options, wires.back());
    }
    for (bool any = true; std::exchange(any, false); ++driven) {
      for (std::size_t i = 0; i < cameras.size(); ++i) {
        Robot& robot = team.robots[i];
        if (robot.next >= static_cast<std::size_t>(end * static_cast<double>(robot.count))) continue;
        any = true;
        if (driven < robot.begin) continue;
        test::FeatureTeam::Shot shot = robot.shoot(robot.next++);
        if (!robot.has_depth) std::fill(shot.frame.inverse_depths.begin(), shot.frame.inverse_depths.end(), 0.0F);
        robot.truth[shot.frame.stamp.ns] = shot.world_from_camera.t;
        cameras[i].add(std::move(shot.frame));
      }
      int dropped = 0;
      for (const test::LiveCamera& camera : cameras) dropped += camera.dropped();
      if (std::exchange(dropped_, dropped) < dropped)
        pause_ = std::min(pause_ + 5ms * test::kSlowness, 200ms * test::kSlowness);  // a busy machine
      std::this_thread::sleep_for(pause_);
    }
  }
  // Nobody drives any more; the server has ended, too.
  void finish() {
    for (test::LiveCamera& camera : cameras) clients.push_back(&camera.finish(20s * test::kSlowness));
    for (test::LiveCamera& camera : cameras) EXPECT_EQ(camera.refusal(), "");
    server.finish();
  }
  tiers::VisualServer& ended() { return server.finish(); }

  // One session's trajectory laid on the truth; at the scale that it has where the camera knows none.
  std::optional<Sim3> world_from_map(std::size_t camera, int session) const {
    const Robot& robot = team.robots[camera];
    std::vector<matching::PointPair> pairs;
    for (const visual::PlacedFrame& frame : clients[camera]->trajectory())
      if (frame.session == session) pairs.push_back({robot.truth.at(frame.stamp.ns), frame.map_from_camera.t});
    return matching::align_points(pairs, robot.has_depth ? matching::Freedom::rigid : matching::Freedom::similarity);
  }
  // Root mean square distance of a camera's frames from the truth, each session laid on it.
  double error_m(std::size_t camera) const {
    double square = 0.0;
    std::size_t count = 0;
    for (const int session : clients[camera]->sessions()) {
      const auto laid = world_from_map(camera, session);
      for (const visual::PlacedFrame& frame : clients[camera]->trajectory()) {
        if (frame.session != session || !laid) continue;
        const Eigen::Vector3d& truth = team.robots[camera].truth.at(frame.stamp.ns);
        square += (transformed(frame.map_from_camera.t, *laid) - truth).squaredNorm();
        ++count;
      }
    }
    return std::sqrt(square / static_cast<double>(count));
  }
  // The same of others' keyframes, as they lie in its sessions' maps.
  double error_of_shared_m(std::size_t camera) {
    std::map<NodeId, Stamp> stamps;
    for (const Map& map : ended().maps())
      for (const auto& [id, node] : map.nodes) stamps[id] = node.stamp;
    double square = 0.0;
    std::size_t count = 0;
    for (const visual::PlacedShared& one : clients[camera]->shared_keyframes())
      for (const Robot& other : team.robots) {
        const auto laid = world_from_map(camera, one.session);
        if (!laid || !(other.place.client == one.id.session.client) || stamps.count(one.id) == 0) continue;
        square += (transformed(one.map_from_camera.t, *laid) - other.truth.at(stamps.at(one.id).ns)).squaredNorm();
        ++count;
      }
    return std::sqrt(square / static_cast<double>(count));
  }
  // Of others, by whose they are.
  std::map<ClientId, std::size_t> kept(std::size_t camera) const {
    std::map<ClientId, std::size_t> counts;
    for (const visual::PlacedShared& one : clients[camera]->shared_keyframes()) ++counts[one.id.session.client];
    return counts;
  }
  void print(std::size_t camera) {
    const Robot& robot = team.robots[camera];
    std::printf("%s.%s: error %.4f m, keeps %zu keyframes of others (%.3f m off), %d frames dropped, %zu sessions;",
                robot.place.client.robot.str().c_str(), robot.place.client.sensor.str().c_str(), error_m(camera),
                clients[camera]->shared_keyframes().size(), error_of_shared_m(camera), cameras[camera].dropped(),
                clients[camera]->sessions().size());
    for (const auto& [client, count] : kept(camera))
      std::printf(" %zu of %s.%s", count, client.robot.str().c_str(), client.sensor.str().c_str());
    std::printf("\n");
  }

  test::FeatureTeam team;
  LiveMapServer server;
  std::size_t driven = 0;  // frames
  int loses = 0;           // shares, of each wire
  std::vector<std::shared_ptr<LossyWire>> wires;
  std::deque<test::LiveCamera> cameras;
  std::vector<visual::VisualClient*> clients;

 private:
  int dropped_ = 0;
  std::chrono::milliseconds pause_ = 15ms * test::kSlowness;  // the server keeps up with cameras
};

simulation::WorldOptions two_robots(double length_m) {
  auto options = test::two_in_an_apartment();
  for (auto& robot : options.robots) robot.length_m = length_m;
  return options;
}

TEST(LiveGlobalMap, is_kept_by_cameras_that_do_not_wait_and_by_no_others) {
  for (const auto share : {tiers::Sharing::full, tiers::Sharing::global}) {
    LiveTeam live(two_robots(10.0), share);
    live.drive(share == tiers::Sharing::global ? 1.0 : 0.5);
    live.finish();
    for (std::size_t i = 0; i < 2; ++i) {
      const Robot& robot = live.team.robots[i];
      const auto kept = live.kept(i);
      ASSERT_EQ(kept.size(), share == tiers::Sharing::global ? 1U : 0U);
      if (kept.empty()) continue;
      live.print(i);
      EXPECT_EQ(kept.begin()->first, live.team.robots[1 - i].place.client);
      EXPECT_GT(kept.begin()->second, 10U);
      EXPECT_LT(live.error_of_shared_m(i), 0.1);
      EXPECT_LT(live.error_m(i), 0.05);
      for (const Map& map : live.clients[i]->maps(robot.place))
        for (const auto& [id, node] : map.nodes)
          ASSERT_EQ(id.session.client, robot.place.client) << "nobody publishes what others made";
    }
  }
}

TEST(LiveGlobalMap, stays_with_cameras_whose_server_is_gone) {
  LiveTeam live(two_robots(8.0), tiers::Sharing::global);
  live.drive(0.8);
  live.server.finish();
  live.drive();
  live.finish();
  for (std::size_t i = 0; i < 2; ++i) {
    live.print(i);
    EXPECT_GT(live.clients[i]->shared_keyframes().size(), 5U);
    EXPECT_LT(live.error_of_shared_m(i), 0.1);
    EXPECT_LT(live.error_m(i), 0.05);
  }
}

TEST(LiveGlobalMap, what_a_wire_lost_comes_again) {
  LiveTeam live(two_robots(12.0), tiers::Sharing::global);
  live.loses = 4;
  live.drive();
  live.finish();
  std::set<NodeId> known;  // not culled since
  for (const Map& map : live.ended().maps())
    for (const auto& [id, node] : map.nodes) known.insert(id);
  for (std::size_t i = 0; i < 2; ++i) {
    live.print(i);
    std::set<NodeId> kept;
    for (const visual::PlacedShared& one : live.clients[i]->shared_keyframes()) kept.insert(one.id);
    std::size_t lost = 0, came = 0;
    for (const NodeId& id : live.wires[i]->lost()) {
      lost += known.count(id);
      came += known.count(id) * kept.count(id);
    }
    std::printf("%zu keyframes lost, %zu of them came again\n", lost, came);
    ASSERT_GT(lost, 2U);
    EXPECT_EQ(came, lost);
  }
}

// It begins where its server places it, once alpha was there.
TEST(LiveGlobalMap, is_kept_by_a_single_camera) {
  auto world = two_robots(10.0);
  world.robots[1] = world.robots[0];
  world.robots[1].id = "beta";
  LiveTeam live(world, tiers::Sharing::global);
  Robot& beta = live.team.robots[1];
  beta.has_depth = false;
  beta.options.session.await_place = true;
  beta.begin = 12 * 15;
  live.drive();
  live.finish();
  for (std::size_t i = 0; i < 2; ++i) live.print(i);
  EXPECT_GT(live.kept(1).size(), 0U);
  EXPECT_GT(live.clients[1]->shared_keyframes().size(), 4U);
  EXPECT_LT(live.error_of_shared_m(1), 0.1);
  EXPECT_LT(live.error_m(1), 0.05);
  EXPECT_LT(live.error_m(0), 0.05) << "alpha takes no harm";
}

TEST(LiveGlobalMap, holds_what_the_other_camera_of_a_robot_maps) {
  auto world = two_robots(8.0);
  world.cameras.resize(2, world.cameras.front());
  world.cameras[0].id = "ahead";
  world.cameras[1].id = "back";
  world.cameras[1].yaw_deg = 180.0;
  world.cameras[1].x_m = -0.15;
  LiveTeam live(world, tiers::Sharing::global);
  live.drive();
  live.finish();
  for (std::size_t i = 0; i < 4; ++i) {
    live.print(i);
    const ClientId own = live.team.robots[i].place.client;
    const auto kept = live.kept(i);
    EXPECT_EQ(kept.count(own), 0U);
    const ClientId beside{own.robot, SensorId(own.sensor == SensorId("back") ? "ahead" : "back")};
    EXPECT_EQ(kept.count(beside), 1U) << "of the robot's other camera";
    EXPECT_GE(kept.size(), 2U) << "of the other robot, too";
    EXPECT_LT(live.error_of_shared_m(i), 0.1);
    EXPECT_LT(live.error_m(i), 0.05);
  }
  EXPECT_TRUE(live.server.counts().notes.empty());
}

}  // namespace
}  // namespace mapweave::runtime
