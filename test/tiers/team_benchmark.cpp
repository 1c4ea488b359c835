// Teams of cameras that hand over features, with their map server: is one map made of them, how good is it, and what
// goes over the wire. One JSON object for each scenario.
//   team_benchmark SCENARIO...
//   apartment-N       N robots in an apartment of seven rooms, 60 m each; every one shares rooms with the next
//   single-camera     alpha's depth camera maps three rooms; then a single camera comes and asks where it is
//   forgetting-ROOM   a robot that drives 600 m, or METRES (forgetting-ROOM@METRES): its camera has room for so many
//                     keyframes and culls none; beside it what the server keeps
//   cut-N             one robot's drive around a corridor that closes on itself, or of METRES (cut-N@METRES), cut for
//                     N clients that begin together (CORB-SLAM)
//   another-day       a robot comes back a day later, half of the furniture elsewhere
//   repeated-rooms-N  two robots in other rooms each, which are alike down to the pictures; N seeds, from seed S
//                     (repeated-rooms-N@S)

#include <support/feature_team.h>

#include <malloc.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <nlohmann/json.hpp>

using namespace mapweave;
using test::FeatureTeam;

namespace {

constexpr double kFalse_m = 0.5;  // who is off by more was joined wrongly

double processor_s() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

struct TrueTrajectory {
  Pose3 robot_from_camera;
  std::map<std::int64_t, Eigen::Vector3d> camera;  // in the world, by stamp
};
using Truth = std::map<RobotId, TrueTrajectory>;

// What became of robots' maps, against the truth.
struct Judged {
  std::size_t components = 0, maps = 0, falsely_joined = 0;
  double team_m = 0.0;  // the component with most keyframes, one alignment for all of it
};

Judged judged(const fusion::FusionResult& result, const Truth& truth) {
  Judged judged;
  std::size_t most = 0;
  for (const fusion::Component& component : result.components) {
    std::vector<matching::PointPair> pairs;
    for (const auto& [id, node] : component.map.nodes) {
      const TrueTrajectory& trajectory = truth.at(id.session.client.robot);
      pairs.push_back(
          {trajectory.camera.at(node.stamp.ns), compose(node.map_from_node, trajectory.robot_from_camera).t});
    }
    const double error_m = FeatureTeam::laid(pairs);
    judged.falsely_joined += component.members.size() > 1 && error_m > kFalse_m;
    judged.maps += component.members.size();
    if (pairs.size() > most) {
      most = pairs.size();
      judged.team_m = error_m;
    }
  }
  judged.components = result.components.size();
  return judged;
}

Truth truth_of(const std::deque<FeatureTeam::Robot>& robots) {
  Truth truth;
  for (const auto& robot : robots) truth[robot.place.client.robot] = {robot.place.robot_from_camera, robot.truth};
  return truth;
}

// Of robots by themselves, laid on the truth one by one: root mean square over all.
double alone_m(const std::deque<FeatureTeam::Robot>& robots) {
  double square = 0.0;
  for (const auto& robot : robots) square += robot.error_m() * robot.error_m() / static_cast<double>(robots.size());
  return std::sqrt(square);
}

// What is published of keyframes and landmarks: once in full, then what changes of them alone (CORB-SLAM, table 1).
struct PublishedParts {
  struct Part {
    std::size_t count = 0, bytes = 0;
    double seconds = 0.0;  // of a processor, at both ends: encoding and decoding

    void add(std::size_t things, const MapUpdate& update, std::size_t head) {
      if (things == 0) return;
      const double before_s = processor_s();
      const std::string bytes_of = encode(update);
      decode_map_update(bytes_of, "client");
      seconds += processor_s() - before_s;
      count += things;
      bytes += bytes_of.size() - head;
    }
    nlohmann::json json() const { return {{"count", count}, {"bytes", bytes}, {"seconds", seconds}}; }
  };
  Part keyframes, landmarks, moved_keyframes, changed_landmarks;

  void add(const std::string& bytes) {
    const MapUpdate received = decode_map_update(bytes, "client");
    MapUpdate nothing;
    nothing.origin = received.origin;
    nothing.sequence = received.sequence;
    const std::size_t head = encode(nothing).size();
    MapUpdate part = nothing;
    part.nodes = received.nodes;
    keyframes.add(received.nodes.size(), part, head);
    part = nothing;
    part.landmarks = received.landmarks;
    landmarks.add(received.landmarks.size(), part, head);
    part = nothing;
    part.moved = received.moved;
    moved_keyframes.add(received.moved.size(), part, head);
    part = nothing;
    part.changed_landmarks = received.changed_landmarks;
    changed_landmarks.add(received.changed_landmarks.size(), part, head);
  }
  nlohmann::json json() const {
    return {{"full keyframes", keyframes.json()},
            {"full landmarks", landmarks.json()},
            {"light keyframes", moved_keyframes.json()},
            {"light landmarks", changed_landmarks.json()}};
  }
};

// by_themselves_m: of the same robots where nobody sends them anything.
nlohmann::json report(const char* name, FeatureTeam& team, double began_s, double by_themselves_m) {
  const auto silent = make_silent_progress();
  const double driven_s = processor_s();
  const auto sealed = team.server.seal(team.pool, *silent);
  const double sealing_s = processor_s() - driven_s;
  const Judged found = judged(sealed, truth_of(team.robots));
  double up = 0.0, down = 0.0;
  int lost = 0, placed = 0, frames = 0;
  for (const auto& robot : team.robots) {
    const double seconds = static_cast<double>(robot.next) / 12.0 * static_cast<double>(team.robots.size());
    up += 1e-3 * static_cast<double>(robot.agent->sent_bytes()) / seconds;
    down += 1e-3 * static_cast<double>(robot.agent->received_bytes()) / seconds;
    lost += robot.lost;
    placed += robot.placed;
    frames += static_cast<int>(robot.next);
  }
  return {{"name", name},
          {"robots", team.robots.size()},
          {"maps", found.maps},
          {"frames", frames},
          {"lost", lost},
          {"components", found.components},
          {"placed", placed},
          {"falsely_joined", found.falsely_joined},
          {"alone_m", by_themselves_m},
          {"sharing_m", alone_m(team.robots)},
          {"team_m", found.team_m},
          {"up_kb_per_s", up},
          {"down_kb_per_s", down},
          {"sealing_s", sealing_s},
          {"cpu_s", processor_s() - began_s}};
}

nlohmann::json apartment(int robots) {
  const double began_s = processor_s();
  tiers::ServerOptions sharing;
  sharing.share = tiers::Sharing::view;
  FeatureTeam team(test::apartment(static_cast<std::size_t>(robots), 60.0), sharing, {}, 2);
  PublishedParts parts;
  team.overheard = [&](const FeatureTeam::Robot&, const std::string& bytes) { parts.add(bytes); };
  team.run();
  FeatureTeam unheard(test::apartment(static_cast<std::size_t>(robots), 60.0), tiers::ServerOptions{}, {}, 2);
  unheard.run();
  auto row =
      report(("apartment, " + std::to_string(robots) + " robots").c_str(), team, began_s, alone_m(unheard.robots));
  std::size_t loops = 0;
  for (const auto& robot : unheard.robots) loops += robot.client->loops().size();
  row["published"] = parts.json();
  row["loops_alone"] = loops;
  return row;
}

nlohmann::json single_camera() {
  const double began_s = processor_s();
  auto options = test::camera_world(simulation::PlanKind::apartment, 7, 2);
  options.robots[0].last_room = 2;
  options.robots[0].length_m = 40.0;
  options.robots[1] = options.robots[0];
  options.robots[1].id = "beta";
  options.robots[1].length_m = 30.0;
  tiers::ServerOptions sharing;
  sharing.share = tiers::Sharing::view;
  FeatureTeam team(options, sharing, {}, 2);
  auto& beta = team.robots[1];
  beta.has_depth = false;
  beta.options.session.await_place = true;
  beta.client.emplace(beta.camera, 0.0, beta.options, matching::shipped_vocabulary());
  beta.agent.emplace(beta.place);
  beta.begin = 12 * 75;  // alpha has been around
  team.run();
  double scale = 0.0;
  beta.error_m(0, true, &scale);
  auto row = report("a single camera in a mapped area", team, began_s, alone_m(team.robots));
  row["scale"] = scale;
  return row;
}

double held_mb() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd) / 1e6;
}

// A robot whose camera has room for so many keyframes and culls none.
std::unique_ptr<FeatureTeam> driven_with_room(int room, double metres, tiers::Sharing share) {
  tiers::ServerOptions sharing;
  sharing.share = share;
  auto team = std::make_unique<FeatureTeam>(test::apartment(1, metres), sharing, simulation::FeatureOptions{}, 2);
  auto& robot = team->robots.front();
  robot.options.memory.keyframes = room;
  robot.options.memory.redundant_views = 100;
  robot.client.emplace(robot.camera, 0.0, robot.options, matching::shipped_vocabulary());
  team->run();
  return team;
}

// Memory of the robot's client, which ends.
double given_back_mb(FeatureTeam::Robot& robot) {
  const double with_client_mb = held_mb();
  robot.client.reset();
  return with_client_mb - held_mb();
}

nlohmann::json forgetting(int room, double metres) {
  const double began_s = processor_s();
  const double unheard_mb = given_back_mb(driven_with_room(room, metres, tiers::Sharing::none)->robots.front());
  const auto driven = driven_with_room(room, metres, tiers::Sharing::view);
  FeatureTeam& team = *driven;
  auto& robot = team.robots.front();
  const SessionId session = *robot.client->run(robot.place);
  fusion::Component whole;
  whole.map = robot.client->maps(robot.place).front();
  const std::size_t own = whole.map.nodes.size(), own_landmarks = whole.map.landmarks.size();
  tiers::add_forgotten(whole.map, team.server.kept_for(session), robot.client->forgotten_keyframes(robot.place));
  nlohmann::json row = {{"name", "a camera with room for " + std::to_string(room) + " keyframes"},
                        {"frames", robot.next},
                        {"lost", robot.lost},
                        {"client_keyframes", own},
                        {"client_landmarks", own_landmarks},
                        {"forgotten", robot.client->forgotten()},
                        {"whole_keyframes", whole.map.nodes.size()},
                        {"whole_landmarks", whole.map.landmarks.size()},
                        {"borrowed_seen", robot.borrowed_seen},
                        {"trajectory_m", robot.error_m()},
                        {"whole_m", team.error_m(whole)},
                        {"sent_bytes", robot.agent->sent_bytes()},
                        {"heard_bytes", robot.agent->received_bytes()}};
  whole = {};
  row["client_mb"] = given_back_mb(robot);
  row["unheard_client_mb"] = unheard_mb;  // of one whose server sends it nothing
  row["cpu_s"] = processor_s() - began_s;
  return row;
}

// One drive, cut for so many clients that share 12 s with the next one and all begin when the drive began.
nlohmann::json cut(int clients, double metres) {
  const double began_s = processor_s();
  static const char* const kNames[] = {"alpha", "beta", "gamma"};
  auto options = test::camera_world(simulation::PlanKind::ring, 3, 1);
  options.buildings[0].ring = {0.285 * metres, 0.215 * metres, 2.4, static_cast<int>(metres / 5.0),
                               static_cast<int>(metres / 5.0)};
  options.robots[0].length_m = 1.06 * metres;
  options.robots[0].laps = 2;
  WorkerPool pool(2);
  const simulation::World world(options, pool);
  const simulation::FeatureOptions features;
  const simulation::LandmarkField field(world.scene(0), world.buildings()[0], features);
  const simulation::FeatureRecording recording(world, field, features, 0, 0);
  tiers::ServerOptions sharing;
  sharing.share = tiers::Sharing::view;
  FeatureTeam team(sharing, 2);
  PublishedParts parts;
  team.overheard = [&](const FeatureTeam::Robot&, const std::string& bytes) { parts.add(bytes); };
  const auto& model = options.cameras[0].intrinsics();
  const Pose3 robot_from_camera =
      compose(inverse(world.world_from_robot(0, 0.0)), recording.frame(0).world_from_camera);
  const std::size_t frames = recording.frame_count(), shared = 12 * 6;
  for (std::size_t i = 0; i < static_cast<std::size_t>(clients); ++i) {
    const std::size_t parts_of = static_cast<std::size_t>(clients), middle = i * frames / parts_of;
    const std::size_t first = middle < shared ? 0 : middle - shared;
    const std::size_t last = std::min(frames, (i + 1) * frames / parts_of + shared);
    const std::int64_t later_ns = recording.frame(first).stamp.ns - recording.frame(0).stamp.ns;
    team.add({{RobotId(kNames[i]), SensorId("camera")}, robot_from_camera},
             {model.width, model.height, model.fx, model.fy, model.cx, model.cy}, last - first,
             [&recording, first, later_ns](std::size_t number) {
               simulation::SimulatedFeatureFrame frame = recording.frame(first + number);
               frame.stamp.ns -= later_ns;
               return FeatureTeam::Shot{test::frame_of(frame), frame.world_from_camera};
             });
  }
  team.run();
  const double alone = alone_m(team.robots);
  auto row = report(("one drive cut for " + std::to_string(clients) + " clients").c_str(), team, began_s, alone);
  row["published"] = parts.json();
  return row;
}

nlohmann::json another_day() {
  const double began_s = processor_s();
  tiers::VisualServer server(TierId("edge"), {}, {});
  WorkerPool pool(2);
  Truth truth;
  double alone = 0.0;
  for (const int day : {0, 1}) {
    auto options = test::camera_world(simulation::PlanKind::apartment, 7, 1);
    options.buildings[0].furniture.session = day;
    options.robots[0].last_room = 3;
    options.robots[0].length_m = 40.0;
    options.robots[0].start_s = 86400.0 * day;
    FeatureTeam team(options, tiers::ServerOptions{});
    team.overheard = [&](const FeatureTeam::Robot& robot, const std::string& bytes) {
      server.greet({*robot.client->run(robot.place), matching::shipped_vocabulary().hash()});
      server.receive(*robot.client->run(robot.place), bytes);
    };
    team.run();
    const auto& robot = team.robots.front();
    alone += 0.5 * robot.error_m() * robot.error_m();
    TrueTrajectory& trajectory = truth[robot.place.client.robot];
    trajectory.robot_from_camera = robot.place.robot_from_camera;
    trajectory.camera.insert(robot.truth.begin(), robot.truth.end());
  }
  const auto silent = make_silent_progress();
  const Judged found = judged(server.seal(pool, *silent), truth);
  return {{"name", "a robot that comes back another day"},
          {"robots", 1},
          {"maps", found.maps},
          {"components", found.components},
          {"falsely_joined", found.falsely_joined},
          {"alone_m", std::sqrt(alone)},
          {"team_m", found.team_m},
          {"cpu_s", processor_s() - began_s}};
}

nlohmann::json repeated_rooms(int seeds, int first) {
  const double began_s = processor_s();
  std::size_t falsely_joined = 0, rightly_joined = 0;
  for (int seed = first; seed < first + seeds; ++seed) {
    auto options = test::camera_world(simulation::PlanKind::repeated_rooms, seed, 2);
    options.robots[0].first_room = 0;
    options.robots[0].last_room = 1;
    options.robots[0].length_m = 20.0;
    options.robots[1].first_room = 3;
    options.robots[1].last_room = 4;
    options.robots[1].length_m = 20.0;
    FeatureTeam team(options, tiers::ServerOptions{}, {}, 2);
    team.run();
    const auto silent = make_silent_progress();
    const Judged found = judged(team.server.seal(team.pool, *silent), truth_of(team.robots));
    falsely_joined += found.falsely_joined;
    rightly_joined += found.maps - found.components - found.falsely_joined;
    std::fprintf(stderr, "seed %d: %zu of %zu maps, %zu falsely joined\n", seed, found.components, found.maps,
                 found.falsely_joined);
  }
  return {{"name", "rooms that are all alike, " + std::to_string(seeds) + " seeds"},
          {"robots", 2},
          {"seeds", seeds},
          {"falsely_joined", falsely_joined},
          {"rightly_joined", rightly_joined},
          {"cpu_s", processor_s() - began_s}};
}

nlohmann::json run(const std::string& scenario) {
  const auto number = [&](const std::string& start) {
    return scenario.rfind(start, 0) == 0 ? std::atoi(scenario.c_str() + start.size()) : 0;
  };
  if (const int robots = number("apartment-"); robots >= 1 && robots <= 8) return apartment(robots);
  if (scenario == "single-camera") return single_camera();
  const auto at = scenario.find('@');
  const double metres = at == std::string::npos ? 0.0 : std::atof(scenario.c_str() + at + 1);
  if (const int room = number("forgetting-"); room >= 20) return forgetting(room, metres > 0.0 ? metres : 600.0);
  if (const int clients = number("cut-"); clients >= 2 && clients <= 3)
    return cut(clients, metres > 0.0 ? metres : 150.0);
  if (scenario == "another-day") return another_day();
  if (const int seeds = number("repeated-rooms-"); seeds > 0)
    return repeated_rooms(seeds, at == std::string::npos ? 1 : std::atoi(scenario.c_str() + at + 1));
  throw Error(
      ErrorCode::kUsage, "there is no scenario '" + scenario + "'", {},
      "apartment-1 to apartment-8, single-camera, forgetting-ROOM[@METRES], cut-2 or cut-3[@METRES], another-day, "
      "repeated-rooms-SEEDS[@FIRST]");
}

}  // namespace

int main(int argc, char** argv) {
  try {
    for (int i = 1; i < argc; ++i) {
      std::printf("%s\n", run(argv[i]).dump().c_str());
      std::fflush(stdout);
    }
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
  return 0;
}
