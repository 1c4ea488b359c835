#pragma once
// Robots' logs of one small apartment, and a configuration that maps them; made once per program, since mapping takes
// its time.

#include <mapweave/core/options.h>
#include <mapweave/core/progress.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/simulation/simulate.h>
#include <support/temporary_folder.h>

namespace mapweave::runtime::test_support {

class SimulatedTeam {
 public:
  // Two robots, or three of which the last shares an edge with the first.
  explicit SimulatedTeam(bool has_third = false) {
    simulation::WorldOptions world;
    world.laser.rays = 91;
    world.laser.scans_per_second = 2.0;
    for (const char* id : {"alpha", "beta"}) {
      simulation::RobotOptions robot;
      robot.id = id;
      robot.edge = std::string(id) == "alpha" ? "north" : "south";
      robot.length_m = 12.0;
      robot.first_room = id[0] == 'a' ? 0 : 1;
      world.robots.push_back(robot);
    }
    if (has_third) {
      world.robots.push_back(world.robots.front());
      world.robots.back().id = "gamma";
      world.robots.back().first_room = 2;
    }
    WorkerPool pool(1);
    simulation::simulate(world, folder_.path(), pool, *make_silent_progress());
  }
  std::filesystem::path log(const std::string& robot) const { return folder_ / (robot + ".rawlog"); }
  // The configuration that simulate() wrote.
  RunConfiguration configuration() const {
    RunConfiguration result;
    load(result, {{folder_ / "run.yaml"}, {}, {}});
    for (RobotEntry& robot : result.robots) robot.log = folder_ / robot.log;
    return result;
  }

 private:
  test::TemporaryFolder folder_;
};

inline const SimulatedTeam& simulated_team() {
  static const SimulatedTeam team;
  return team;
}

}  // namespace mapweave::runtime::test_support
