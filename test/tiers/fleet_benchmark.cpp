// What a fleet of robots with lasers costs its edges, its cloud and its coordinator while it drives: growing maps of
// simulated robots, five in each flat, go up in rounds of virtual time. Prints one JSON object. Robots of a flat are on
// one edge, or, so that the cloud has to find them, on as many as there are.
#include <mapweave/core/stopwatch.h>
#include <mapweave/scheduling/overlap_estimate.h>
#include <mapweave/tiers/coordinator.h>
#include <mapweave/tiers/round_merger.h>

#include <support/simulated_maps.h>
#include <nlohmann/json.hpp>

#include <sys/resource.h>

#include <cstdio>
#include <cstdlib>
#include <set>
#include <string>

namespace mapweave::tiers {
namespace {

constexpr int kOfFlat = 5, kOfEdge = 20;
constexpr std::size_t kRounds = 4;
constexpr double kDrive_m = 12.0;

// What a robot's map shows after each round; ids are the fleet's.
struct DrivingRobot {
  RobotId id;
  TierId edge;
  int flat = 0;
  std::vector<Map> parts;
  std::vector<std::uint64_t> scans;  // so far
  double drive_s = 0.0, mapping_s = 0.0;
  std::uint64_t sensed_bytes = 0;
};

std::vector<DrivingRobot> drive(int count, int first_seed, bool are_spread) {
  const int edges = (count + kOfEdge - 1) / kOfEdge;
  std::vector<DrivingRobot> fleet;
  for (int flat = 0; static_cast<int>(fleet.size()) < count; ++flat) {
    simulation::TeamOptions options;
    options.robots = kOfFlat;
    options.shared = 0.5;
    options.length_m = kDrive_m;
    options.seed = first_seed + flat;
    options.laser.rays = 181;
    const auto team = simulation::make_apartment({}, options);
    const auto geometry = test::scan_geometry(team.laser);
    for (const auto& robot : team.robots) {
      DrivingRobot& driving = fleet.emplace_back();
      driving.id = RobotId("r" + std::to_string(fleet.size()));
      const int number = static_cast<int>(fleet.size()) - 1;
      driving.edge = TierId("edge" + std::to_string(are_spread ? number % edges : number / kOfEdge));
      driving.flat = flat;
      driving.drive_s = 1e-9 * static_cast<double>(robot.steps.back().stamp.ns - robot.steps.front().stamp.ns);
      laser::GraphMapper mapper({driving.id, SensorId("laser")}, {});
      const double begin_s = thread_cpu_seconds();
      std::size_t done = 0;
      for (std::size_t round = 1; round <= kRounds; ++round) {
        for (const std::size_t end = robot.steps.size() * round / kRounds; done < end; ++done) {
          const auto& step = robot.steps[done];
          mapper.add(laser::OdometryInput{step.stamp, spatial(step.odometry_from_robot)});
          mapper.add(laser::ScanInput{step.stamp, test::packed(step.ranges, geometry)});
          driving.sensed_bytes += 2 * step.ranges.size();
        }
        driving.parts.push_back(growing_part(mapper.snapshot()));
        driving.scans.push_back(done);
      }
      driving.mapping_s = thread_cpu_seconds() - begin_s;
    }
  }
  fleet.resize(static_cast<std::size_t>(count));
  return fleet;
}

// Of one round; seconds are of one processor.
struct RoundCost {
  double edges_s = 0.0, longest_edge_s = 0.0, cloud_s = 0.0, coordinator_s = 0.0;
  std::uint64_t robot_bytes = 0, cloud_bytes = 0, report_bytes = 0;
  std::size_t joint_maps = 0, merged_robots = 0, mixed_maps = 0;  // mixed: of robots of several flats
};

nlohmann::json json_of(const RoundCost& cost) {
  return {{"edges_s", cost.edges_s},
          {"longest_edge_s", cost.longest_edge_s},
          {"cloud_s", cost.cloud_s},
          {"coordinator_s", cost.coordinator_s},
          {"robot_bytes", cost.robot_bytes},
          {"cloud_bytes", cost.cloud_bytes},
          {"report_bytes", cost.report_bytes},
          {"joint_maps", cost.joint_maps},
          {"merged_robots", cost.merged_robots},
          {"mixed_maps", cost.mixed_maps}};
}

double peak_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024e-6 * static_cast<double>(usage.ru_maxrss);
}

class Fleet {
 public:
  explicit Fleet(std::vector<DrivingRobot> robots) : robots_(std::move(robots)), cloud_(TierId("cloud"), {}) {
    CoordinatorOptions options;
    coordinator_.emplace(options);
    for (const DrivingRobot& robot : robots_)
      if (edges_.try_emplace(robot.edge, robot.edge, fusion::FusionOptions()).second)
        coordinator_->receive(EdgeIs{robot.edge, 1e6, 1.0, {}});
    for (const DrivingRobot& robot : robots_) flat_of_[robot.parts.front().id] = robot.flat;
    for (const DrivingRobot& robot : robots_) coordinator_->receive(RobotComes{robot.id, {}, robot.edge});
  }

  RoundCost round(std::size_t number) {
    RoundCost cost;
    for (DrivingRobot& robot : robots_) {
      senders_.try_emplace(robot.id, robot.edge);
      if (const auto update = senders_.at(robot.id).next(robot.parts[number])) cost.robot_bytes += update->size();
    }
    std::map<TierId, double> took_s;
    const auto timed = [](double& sum_s, auto&& call) {
      const double begin_s = thread_cpu_seconds();
      call();
      sum_s += thread_cpu_seconds() - begin_s;
    };
    for (const DrivingRobot& robot : robots_)
      timed(took_s[robot.edge], [&] { edges_.at(robot.edge).put(robot.parts[number]); });
    for (auto& [id, edge] : edges_) {
      RoundNews news;
      timed(took_s[id], [&, &server = edge] {
        server.fuse(pool_, *progress_);
        news = server.news();
      });
      cost.cloud_bytes += news.bytes();
      cost.edges_s += took_s[id];
      cost.longest_edge_s = std::max(cost.longest_edge_s, took_s[id]);
      timed(cost.cloud_s, [&, &from = id] { cloud_.receive(news, from); });
    }
    timed(cost.cloud_s, [&] { cloud_.fuse(pool_, *progress_); });
    for (const fusion::Component& component : cloud_.result().components) {
      std::set<int> flats;
      for (const MapId& member : component.members) flats.insert(flat_of_.at(member));
      cost.mixed_maps += flats.size() > 1 ? 1 : 0;
      cost.joint_maps += component.members.size() > 1 ? 1 : 0;
      cost.merged_robots += component.members.size() > 1 ? component.members.size() : 0;
    }
    for (const DrivingRobot& robot : robots_) {
      const MapReport report{robot.id, robot.scans[number], scheduling::summary_of(robot.parts[number])};
      cost.report_bytes += encode(CoordinatorEvent(report)).size();
      timed(cost.coordinator_s, [&] { coordinator_->receive(report); });
    }
    timed(cost.coordinator_s, [&] { coordinator_->decide(static_cast<double>(number)); });
    return cost;
  }

 private:
  std::vector<DrivingRobot> robots_;
  std::map<MapId, int> flat_of_;
  std::map<RobotId, GrowingMapSender> senders_;
  std::map<TierId, RoundMerger> edges_;
  RoundMerger cloud_;
  std::optional<Coordinator> coordinator_;
  WorkerPool pool_{1};
  std::unique_ptr<Progress> progress_ = make_silent_progress();
};

int run(int argc, char** argv) {
  const int count = argc > 1 ? std::atoi(argv[1]) : 20, first_seed = argc > 2 ? std::atoi(argv[2]) : 100;
  const bool are_spread = argc > 3 && std::string(argv[3]) == "spread";
  if (count < kOfFlat || count > 10000 || (argc > 3 && !are_spread) || argc > 4) {
    std::fprintf(stderr, "usage: fleet_benchmark ROBOTS [FIRST_SEED [spread]], robots from %d to 10000\n", kOfFlat);
    return 2;
  }
  std::vector<DrivingRobot> robots = drive(count, first_seed, are_spread);
  nlohmann::json result{
      {"robots", count}, {"edges", (count + kOfEdge - 1) / kOfEdge}, {"rounds", nlohmann::json::array()}};
  double drive_s = 0.0, mapping_s = 0.0, sensed = 0.0;
  for (const DrivingRobot& robot : robots) {
    drive_s += robot.drive_s / count;
    mapping_s += robot.mapping_s / count;
    sensed += static_cast<double>(robot.sensed_bytes) / count;
  }
  result["drive_s"] = drive_s;
  result["mapping_s"] = mapping_s;
  result["sensed_bytes"] = sensed;
  result["before_mb"] = peak_mb();
  Fleet fleet(std::move(robots));
  for (std::size_t number = 0; number < kRounds; ++number) result["rounds"].push_back(json_of(fleet.round(number)));
  result["peak_mb"] = peak_mb();
  std::printf("%s\n", result.dump().c_str());
  return 0;
}

}  // namespace
}  // namespace mapweave::tiers

int main(int argc, char** argv) { return mapweave::tiers::run(argc, argv); }
