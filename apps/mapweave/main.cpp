// mapweave: one map from what a team of robots recorded. This file knows the verbs and the exit codes, nothing else.

#include "command.h"
#include "command_line.h"
#include "program_end.h"

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/core/nearest_name.h>
#include <mapweave/runtime/manifest.h>

#include <algorithm>
#include <cstdio>

namespace mapweave::app {
namespace {

const std::vector<Command> commands = {
    {"run", "several robots' logs -> robot, edge and team maps", "mapweave run office.yaml --out maps/office",
     set_up_run},
    {"serve", "robots, edges and a cloud as programs of their own", "mapweave serve demo --out maps/demo",
     set_up_serve},
    {"worker", "does tasks of runs on other machines (run --cluster)", "mapweave worker --cluster nats://10.0.0.1:4222",
     set_up_worker},
    {"doctor", "is everything there, and who of a deployment waits for what", "mapweave doctor office.yaml",
     set_up_doctor},
    {"slam", "one robot's log -> that robot's map", "mapweave slam alpha.rawlog --out maps/alpha", set_up_slam},
    {"merge", "several robots' maps -> one team map",
     "mapweave merge maps/alpha/map.mwdb maps/beta/map.mwdb hall.yaml --out maps/team", set_up_merge},
    {"split", "one long log -> logs of several robots",
     "mapweave split intel.rawlog --robots 3 --overlap 20 --out logs", set_up_split},
    {"convert", "ROS bag, CARMEN log, g2o, folder of pictures or rawlog -> rawlog",
     "mapweave convert intel.clf.gz intel.rawlog", set_up_convert},
    {"simulate", "a world file -> logs with known truth", "mapweave simulate world.yaml --out logs", set_up_simulate},
    {"inspect", "what is in a log, a map, a folder of results, or any file of it", "mapweave inspect maps/office",
     set_up_inspect},
    {"export", "a map -> pictures, grids, clouds, trajectories",
     "mapweave export maps/alpha/map.mwdb --out pictures --png --pcd", set_up_export},
    {"evaluate", "how good a trajectory or a grid is",
     "mapweave evaluate trajectory maps/alpha/trajectory.tum groundtruth.txt", set_up_evaluate},
    {"explain", "a folder of results, two robots -> why their maps were merged or stayed apart",
     "mapweave explain maps/office alpha beta", set_up_explain},
    {"report", "a folder of results -> one page that shows it, for a browser",
     "mapweave report maps/office --out office.html", set_up_report},
    {"plan", "robots, what their maps share, edges -> which robot to which edge",
     "mapweave plan problem.json --method default --json", set_up_plan},
    {"profile", "folders of results -> how long things take, for plan", "mapweave profile maps/office --out model.json",
     set_up_profile},
    {"timeline", "a folder of results -> when the map would be complete over other links",
     "mapweave timeline maps/office --set network.robot_edge.profile=4g --set processors.robot=0.12", set_up_timeline},
    {"vocabulary", "the words by which cameras know places: train them, look at them",
     "mapweave vocabulary train alpha.rawlog --out words.txt.gz", set_up_vocabulary},
    {"config", "show, check or explain configurations", "mapweave config reference", set_up_config},
};

// CLI11 would say of a misspelt verb only that a verb is missing.
void expect_known_verb(const std::vector<std::string>& arguments) {
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& word = arguments[i];
    if (word == "--log-level") ++i;  // its value follows
    if (word.empty() || word.front() == '-') continue;
    std::vector<std::string> names;
    for (const Command& command : commands) names.emplace_back(command.name);
    if (std::find(names.begin(), names.end(), word) != names.end()) return;
    const auto nearest = nearest_name(word, names);
    throw Error(ErrorCode::kUsage, "there is no verb '" + word + "'", {},
                nearest ? "did you mean '" + *nearest + "'?" : "mapweave --help lists them");
  }
}

// What a variable of a script leaves that was not set. Options but --out may be empty: --robot "".
void expect_no_empty_names(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i], before = argv[i - 1];
    const bool is_of_option = i > 1 && before.size() > 1 && before.front() == '-' && before != "--out";
    if ((word.empty() && !is_of_option) || word == "--out=")
      throw Error(ErrorCode::kUsage, "argument " + std::to_string(i) + " is an empty name",
                  before == "--out" || word == "--out=" ? "--out" : "", "name a file or a folder");
  }
}

ExitCode run_program(int argc, char** argv) {
  std::vector<std::string> arguments = with_help_as_flag({argv + 1, argv + argc});
  expect_known_verb(arguments);
  expect_no_empty_names(argc, argv);
  CLI::App program("mapweave: one map from what a team of robots recorded.", "mapweave");
  program.formatter(help_formatter());
  program.set_version_flag("-v,--version", "mapweave " + runtime::program_version());
  std::string log_level = "info";
  program
      .add_option("--log-level", log_level,
                  "least important line that is shown on stderr; warning and error show no progress")
      ->check(one_of({"debug", "info", "warning", "error"}))
      ->capture_default_str();
  program.require_subcommand(1);
  program.fallthrough();
  program.footer(
      "mapweave help VERB, or mapweave VERB --help, says more and gives an example.\n"
      "Exit codes: 0 done; 1 internal, or cannot write; 2 wrong command line; 3 bad or missing input; 4 done, but some "
      "maps\n"
      "stayed apart; 5 a requested gate failed; 6 a broker does not answer; 130 interrupted, what was finished is "
      "saved.");
  std::vector<std::pair<CLI::App*, Action>> actions;
  for (const Command& command : commands) {
    CLI::App* verb = program.add_subcommand(command.name, command.summary);
    verb->group("Verbs");
    show_examples(*verb, {command.example});
    actions.emplace_back(verb, command.set_up(*verb));
  }
  try {
    program.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::Success& asked) {  // help, or the version
    program.exit(asked);
    return ExitCode::done;
  } catch (const CLI::ParseError& error) {
    throw usage_error(program, error);
  }
  set_log_level(log_level_from_text(log_level));
  for (const auto& [verb, action] : actions)
    if (verb->parsed()) return action();
  return ExitCode::wrong_usage;
}

}  // namespace
}  // namespace mapweave::app

int main(int argc, char** argv) {
  mapweave::install_interrupt_handlers();
  return mapweave::app::exit_code_of("mapweave", [&] { return mapweave::app::run_program(argc, argv); });
}
