// mapweave run: several robots' logs -> robot, edge and team maps.

#include "configuration.h"
#include "misplaced_input.h"
#include "workers.h"

#include <mapweave/core/files.h>
#include <mapweave/runtime/batch_runner.h>
#include <mapweave/runtime/merge_requests.h>

#include <memory>
#include <optional>

namespace mapweave::app {

Action set_up_run(CLI::App& verb) {
  struct Arguments {
    std::filesystem::path file;
    std::vector<std::filesystem::path> maps;
    std::vector<std::string> refused;
    bool keep_going = false;
    std::string cluster;
    WritingFlags flags;
  };
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option("CONFIG", arguments->file, "robots and their logs; all keys: mapweave config reference")
      ->required()
      ->type_name("CONFIG.yaml");
  add_start_flag(verb, arguments->maps);
  verb.add_flag("--keep-going", arguments->keep_going, "bad input ends its robot's stream only; the others finish");
  verb.add_option("--refuse", arguments->refused,
                  "never match the maps of these two robots to each other; a third one may still join them; repeatable")
      ->type_name("A,B")
      ->allow_extra_args(false);
  verb.add_option("--cluster", arguments->cluster,
                  "workers map the robots, judge pairs of maps and make dense maps: the NATS server where they listen "
                  "(mapweave worker); the results are the same")
      ->type_name("URL");
  add_writing_flags(verb, arguments->flags);
  return [arguments] {
    expect_configuration(arguments->file);
    LoadedConfiguration loaded = load_configuration(arguments->file, {}, arguments->flags);
    begin_with(arguments->maps, loaded.configuration);
    std::vector<std::string>& refused = loaded.configuration.team.refuse;
    for (const std::string& pair : arguments->refused) {
      loaded.origins.set("team.refuse." + std::to_string(refused.size()), {runtime::kRefuseFlag, {}});
      refused.push_back(pair);
    }
    const runtime::RunPlan plan = runtime::make_plan(loaded.configuration, loaded.origins);
    std::vector<std::filesystem::path> inputs{arguments->file};
    for (const runtime::PlannedRobot& robot : plan.robots) inputs.push_back(robot.log);
    inputs.insert(inputs.end(), plan.maps.begin(), plan.maps.end());
    expect_outside(arguments->flags.out, inputs);
    WorkerPool pool(threads_of(arguments->flags));
    const auto progress = make_terminal_progress();
    runtime::RunSettings settings{arguments->flags.out, arguments->flags.force, arguments->keep_going};
    std::optional<WorkersOfCluster> workers;
    if (!arguments->cluster.empty()) {
      workers.emplace(loaded.configuration, arguments->cluster);
      settings.cluster = &workers->cluster();
    }
    return report_result(runtime::run_batch(loaded.configuration, plan, settings, pool, *progress),
                         arguments->flags.out, arguments->flags.json);
  };
}

}  // namespace mapweave::app
