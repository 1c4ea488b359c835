// mapweave serve demo: a broker, a cloud, two edges and three robots of a simulated apartment, in one program, which
// talk through the broker as they would on machines of their own.

#include "configuration.h"
#include "local_team.h"
#include "serve.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/options.h>
#include <mapweave/simulation/simulate.h>

#include <stdlib.h>

#include <utility>

namespace mapweave::app {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

constexpr auto kBetweenLines = 3s;

// For the broker's files and the journals; gone with the demo.
class WorkingFolder {
 public:
  WorkingFolder() {
    std::string made = (fs::temp_directory_path() / "mapweave-demo-XXXXXX").string();
    if (::mkdtemp(made.data()) == nullptr)
      throw Error(ErrorCode::kCannotWrite, "no folder for temporary files can be made", made,
                  "name another one in TMPDIR");
    path_ = made;
  }
  ~WorkingFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  WorkingFolder(const WorkingFolder&) = delete;
  WorkingFolder& operator=(const WorkingFolder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

simulation::WorldOptions demo_world() {
  constexpr double kLength_m = 16.0;
  simulation::WorldOptions world;
  world.edges = 2;
  world.laser.rays = 181;
  world.laser.scans_per_second = 4.0;
  int room = 0;
  for (const char* id : {"alpha", "beta", "gamma"}) {
    simulation::RobotOptions robot;
    robot.id = id;
    robot.edge = room % 2 == 0 ? "north" : "south";
    robot.first_room = room++;
    robot.length_m = kLength_m;
    world.robots.push_back(robot);
  }
  return world;
}

// The robots' logs, beside the results, so that they can be mapped again; where they are there, they are the same.
fs::path logs_of_demo(const fs::path& out, WorkerPool& pool, Progress& progress) {
  fs::path logs = out;
  logs += ".logs";
  std::error_code ignored;
  if (fs::is_regular_file(logs / "run.yaml", ignored)) return logs;
  const simulation::WorldOptions world = demo_world();
  OutputFolder folder(logs, false);
  simulation::simulate(world, folder.staging(), pool, progress);
  folder.commit();
  return logs;
}

// Who is where, now and then.
class DemoLines {
 public:
  DemoLines(Progress& progress, const LocalTeam& team) : progress_(progress), team_(team) {}
  void show() {
    const auto now = std::chrono::steady_clock::now();
    const runtime::LiveCloudCounts cloud = team_.cloud().counts();
    if (now < next_ || cloud.is_sealing) return;
    next_ = now + kBetweenLines;
    std::string line;
    for (const StartingRobot& robot : team_.robots()) {
      const runtime::LiveRobotCounts counts = robot.counts();
      line +=
          robot.id().str() + " " + std::to_string(counts.scans) + " scans" + (counts.is_read ? " (all)" : "") + "; ";
    }
    progress_.say(line + "the cloud shows " + std::to_string(cloud.maps) + " maps" +
                  (cloud.joint.empty() ? ", none joined yet" : ", joined: " + joint_in_words(cloud.joint)));
  }

 private:
  Progress& progress_;
  const LocalTeam& team_;
  std::chrono::steady_clock::time_point next_{};
};

}  // namespace

ExitCode serve_demo(const DemoArguments& arguments) {
  StopSignals signals;  // before all threads, the broker's too
  const WorkingFolder work;
  const auto progress = make_terminal_progress();
  WorkerPool pool(1);
  const fs::path logs = logs_of_demo(arguments.out, pool, *progress);
  LoadedConfiguration loaded = load_configuration(logs / "run.yaml", {}, {});
  loaded.configuration.live.speed = arguments.speed;
  loaded.configuration.live.preview_period_s = 2.0;
  runtime::RunPlan plan = runtime::make_plan(loaded.configuration, loaded.origins);
  const RunningSince since(loaded.configuration.live);
  LocalTeam team(std::move(loaded.configuration), std::move(plan), work.path(), {arguments.out, arguments.force, true},
                 *progress);
  runtime::PageSource source = page_of("mapweave serve demo", team.configuration(), team.plan());
  source.preview = [&] { return team.cloud().preview(); };
  source.status = [&] { return team.status("demo", since.terms()); };
  const auto page = show_page(team.configuration().live.page_host, arguments.port, std::move(source), *progress);
  progress->say("a broker, a cloud, " + std::to_string(team.plan().edges.size()) + " edges and " +
                std::to_string(team.robots().size()) +
                " robots run; Ctrl-C ends the drives and writes the map, and again ends at once");
  DemoLines lines(*progress, team);
  const runtime::Report report = wait_for_results(
      team.cloud(), signals, [&] { team.end(); },
      [&] {
        team.look();
        lines.show();
        return false;
      });
  return report_result(report, arguments.out, arguments.json);
}

}  // namespace mapweave::app
