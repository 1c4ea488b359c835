// mapweave config: what a configuration comes to, whether it holds, and every option there is.

#include "command_line.h"
#include "configuration.h"
#include "misplaced_input.h"

#include <mapweave/core/error.h>
#include <mapweave/core/option_search.h>
#include <mapweave/simulation/world_options.h>

#include <cstdio>
#include <iostream>
#include <memory>

namespace mapweave::app {
namespace {

// All options, or those that are about `words`, with the values of `file` where one is given.
template <class Options>
ExitCode print_reference(Options options, const std::string& file, const std::vector<std::string>& words,
                         const std::string& title) {
  if (!file.empty()) load(options, {{file}, {}, {}});
  if (words.empty()) {
    std::cout << reference_page(options, title);
    return ExitCode::done;
  }
  const std::string found = found_options(options, words);
  if (found.empty())
    throw Error(ErrorCode::kUsage, "no option speaks of that", "--find " + words.front(),
                "try a part of the word, or one word alone; mapweave config reference lists all options");
  std::cout << found;
  return ExitCode::done;
}

}  // namespace

Action set_up_config(CLI::App& verb) {
  struct Arguments {
    std::string file, of = "run";
    std::vector<std::string> words;
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
      ->check(one_of({"run", "world"}))
      ->capture_default_str();
  reference->add_option("FILE", arguments->file,
                        "a configuration whose values stand in the page; without it: the defaults");

  reference
      ->add_option(
          "--find", arguments->words,
          "only the options that have this word in their key or meaning; repeatable: those that have all words")
      ->type_name("WORD")
      ->allow_extra_args(false);
  show_examples(*show, {"mapweave config show office.yaml --set laser.engine=icp"});
  show_examples(*check, {"mapweave config check office.yaml"});
  show_examples(*reference, {"mapweave config reference", "mapweave config reference --find resolution"});

  return [=] {
    if (reference->parsed() && arguments->of == "world")
      return print_reference(simulation::WorldOptions(), arguments->file, arguments->words,
                             "A simulated world: all options and their defaults (mapweave simulate)");
    if (reference->parsed())
      return print_reference(runtime::RunConfiguration(), arguments->file, arguments->words,
                             "A run: all options and their defaults (mapweave run, slam, merge)");
    expect_configuration(arguments->file);
    const LoadedConfiguration loaded = load_configuration(arguments->file, {}, arguments->flags);
    if (show->parsed()) {
      std::cout << to_yaml(loaded.configuration);
      return ExitCode::done;
    }
    const runtime::RunPlan plan = runtime::make_plan(loaded.configuration, loaded.origins);
    std::printf("%s is fine\n", arguments->file.c_str());
    for (const runtime::PlannedRobot& robot : plan.robots)
      std::printf(
          "robot %s%s: %s\n", robot.id.str().c_str(),
          robot.edge.empty() ? ", its edge as the coordinator chooses" : (" on edge " + robot.edge.str()).c_str(),
          robot.log.c_str());
    return ExitCode::done;
  };
}

}  // namespace mapweave::app
