// mapweave slam: one robot's log -> that robot's map.

#include "command_line.h"
#include "configuration.h"
#include "misplaced_input.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/runtime/batch_runner.h>

#include <memory>

namespace mapweave::app {

Action set_up_slam(CLI::App& verb) {
  struct Arguments {
    std::filesystem::path log;
    std::vector<std::filesystem::path> maps;
    std::string sensor, engine, robot;
    bool keep_going = false;
    WritingFlags flags;
  };
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option("LOG", arguments->log,
                  "MRPT rawlog, ROS bag, CARMEN log, g2o with scans, or a folder of pictures (TUM RGB-D, KITTI, EuRoC)")
      ->required();
  verb.add_option("--sensor", arguments->sensor, runtime::kSensorChoiceText)
      ->check(one_of({runtime::kSensorChoices.begin(), runtime::kSensorChoices.end()}));
  verb.add_option("--engine", arguments->engine,
                  "graph (loops closed), rbpf (MRPT's particle filter) or icp (MRPT's, no loops)")
      ->check(one_of({"graph", "rbpf", "icp"}));
  verb.add_option("--robot", arguments->robot, "the robot's name; without it: the log's file name")->type_name("NAME");
  add_start_flag(verb, arguments->maps);
  verb.add_flag("--keep-going", arguments->keep_going, "map what comes before bad input instead of nothing");
  add_writing_flags(verb, arguments->flags);
  return [arguments] {
    expect_log(arguments->log, "slam");
    std::vector<std::string> settings;
    if (!arguments->sensor.empty()) settings.push_back("sensor=" + arguments->sensor);
    if (!arguments->engine.empty()) settings.push_back("laser.engine=" + arguments->engine);
    LoadedConfiguration loaded = load_configuration({}, settings, arguments->flags);
    if (!loaded.configuration.robots.empty())
      throw Error(ErrorCode::kUsage, "slam maps the log that it is given", "--set robots",
                  "use mapweave run for several robots");
    loaded.configuration.robots = {{arguments->robot, std::filesystem::absolute(arguments->log).string(), ""}};
    begin_with(arguments->maps, loaded.configuration);
    const runtime::RunPlan plan = runtime::make_plan(loaded.configuration, loaded.origins);
    std::vector<std::filesystem::path> inputs{arguments->log};
    inputs.insert(inputs.end(), plan.maps.begin(), plan.maps.end());
    expect_outside(arguments->flags.out, inputs);
    WorkerPool pool(threads_of(arguments->flags));
    const auto progress = make_terminal_progress();
    const runtime::RunSettings run{arguments->flags.out, arguments->flags.force, arguments->keep_going};
    return report_result(runtime::run_slam(loaded.configuration, plan, run, pool, *progress), arguments->flags.out,
                         arguments->flags.json);
  };
}

}  // namespace mapweave::app
