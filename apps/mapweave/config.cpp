// mapweave config: what a configuration comes to, whether it holds, and every option there is.

#include "configuration.h"

#include <mapweave/simulation/world_options.h>

#include <cstdio>
#include <iostream>
#include <memory>

namespace mapweave::app {

Action set_up_config(CLI::App& verb) {
  struct Arguments {
    std::string file, of = "run";
    WritingFlags flags;  // only --set is offered
  };
  const auto arguments = std::make_shared<Arguments>();
  verb.require_subcommand(1);
  CLI::App* show =
      verb.add_subcommand("show", "the effective configuration: defaults, file, environment and --set together");
  show->add_option("FILE", arguments->file, "configuration of a run; without it: defaults and environment");
  CLI::App* check = verb.add_subcommand("check", "whether a run could start: keys, values, robots, edges, logs");
  check->add_option("FILE", arguments->file, "configuration of a run")->required();
  for (CLI::App* reader : {show, check})
    reader->add_option("--set", arguments->flags.set, "sets one option: key=value")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
  CLI::App* reference = verb.add_subcommand("reference", "every option with its default, meaning and range");
  reference->add_option("--of", arguments->of, "a run's options, or a simulated world's")
      ->check(CLI::IsMember({"run", "world"}))
      ->capture_default_str();
  reference->add_option("FILE", arguments->file,
                        "a configuration whose values stand in the page; without it: the defaults");

  return [=] {
    if (reference->parsed() && arguments->of == "world") {
      simulation::WorldOptions world;
      if (!arguments->file.empty()) load(world, {{arguments->file}, {}, {}});
      std::cout << reference_page(world, "A simulated world: all options and their defaults (mapweave simulate)");
      return ExitCode::done;
    }
    if (reference->parsed()) {
      runtime::RunConfiguration configuration;
      if (!arguments->file.empty()) load(configuration, {{arguments->file}, {}, {}});
      std::cout << reference_page(configuration, "A run: all options and their defaults (mapweave run, slam, merge)");
      return ExitCode::done;
    }
    const LoadedConfiguration loaded = load_configuration(arguments->file, {}, arguments->flags);
    if (show->parsed()) {
      std::cout << to_yaml(loaded.configuration);
      return ExitCode::done;
    }
    const runtime::RunPlan plan = runtime::make_plan(loaded.configuration, loaded.origins);
    std::printf("%s is fine\n", arguments->file.c_str());
    for (const runtime::PlannedRobot& robot : plan.robots)
      std::printf("robot %s on edge %s: %s\n", robot.id.str().c_str(), robot.edge.str().c_str(), robot.log.c_str());
    return ExitCode::done;
  };
}

}  // namespace mapweave::app
