// mapweave_ros: the programs of a deployment as nodes of ROS 1.

#include "roles.h"
#include "team_node.h"

#include <command_line.h>
#include <mapweave/core/error.h>
#include <mapweave/runtime/manifest.h>
#include <program_end.h>

#include <cstdio>

namespace mapweave::ros_nodes {
namespace {

struct Arguments {
  app::RoleArguments role;
  TeamArguments team;
};

void add_out(CLI::App& role, app::WritingFlags& flags, const std::string& what) {
  role.add_option("-o,--out", flags.out, what)->required()->type_name("DIR");
}

void add_team_arguments(CLI::App& team, TeamArguments& arguments) {
  team.add_option("ROBOT", arguments.robots, "namespaces of the robots, as in tb0 for /tb0/scan; or one CONFIG.yaml")
      ->required()
      ->type_name("ROBOT... | CONFIG.yaml");
  add_out(team, arguments.flags,
          "new folder for the results; what the robots sensed is recorded beside it, in DIR.logs, unless a "
          "configuration says where");
  team.add_option("--set", arguments.flags.set, "sets one option: key=value")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  team.add_flag("--force", arguments.flags.force, "replace an old folder of results");
  team.add_flag("--json", arguments.flags.json, "print the summary as JSON");
  team.add_option("--port", arguments.port, "port of its page, on this machine alone; 0: any that is free; -1: no page")
      ->check(app::whole_number(-1, 65535))
      ->type_name("PORT")
      ->capture_default_str();
}

// One word that ends as a configuration does is one.
void take_configuration(TeamArguments& arguments) {
  const auto is_file = [](const std::string& word) {
    const std::string ending = std::filesystem::path(word).extension().string();
    return ending == ".yaml" || ending == ".yml";
  };
  for (const std::string& word : arguments.robots)
    if (is_file(word)) {
      if (arguments.robots.size() > 1)
        throw Error(ErrorCode::kUsage, "a configuration names its robots; others cannot be given beside it", word,
                    "give the configuration alone");
      arguments.file = word;
    }
}

template <class Role, class Serve>
ExitCode serve(const char* role, app::RoleArguments arguments, const Serve& serve_it) {
  Role node;
  // What the robot senses is read while it is written.
  if (std::string(role) == "robot") arguments.flags.set.emplace_back("reading.follow=true");
  return serve_it(arguments, node);
}

void start_ros(int& argc, char** argv, const std::string& name) {
  std::string node = "mapweave_" + name;
  for (char& letter : node)
    if (std::isalnum(static_cast<unsigned char>(letter)) == 0) letter = '_';
  ros::init(argc, argv, node, ros::init_options::NoSigintHandler);
}

ExitCode run_program(int argc, char** argv) {
  ros::V_string words;
  ros::removeROSArgs(argc, argv, words);
  std::vector<std::string> arguments = app::with_help_as_flag({words.begin() + 1, words.end()});
  CLI::App program("mapweave_ros: one map of a team of robots, while they drive, over ROS 1.", "mapweave_ros");
  program.formatter(app::help_formatter());
  program.set_version_flag("-v,--version", "mapweave_ros " + runtime::program_version());
  program.require_subcommand(1);
  program.footer(
      "Names can be remapped as those of any node: mapweave_ros team tb0 --out maps/office /tb0/odom:=/tb0/odometry\n\n"
      "Exit codes: as mapweave's.");
  Arguments given;
  CLI::App* team = program.add_subcommand("team", "maps a whole team: robots, edges and cloud in one node");
  CLI::App* robot = program.add_subcommand("robot", "records a robot's topics, and sends what it senses to its edge");
  CLI::App* edge = program.add_subcommand("edge", "maps what its robots send, merges their maps, and publishes them");
  CLI::App* cloud =
      program.add_subcommand("cloud", "merges the maps of all edges, publishes the team's, and writes it");
  CLI::App* coordinator = program.add_subcommand("coordinator", "gives robots to edges, again and again");
  add_team_arguments(*team, given.team);
  for (CLI::App* one : {team, robot, edge, cloud, coordinator}) one->group("Verbs");
  for (CLI::App* one : {robot, edge, cloud, coordinator})
    app::add_role_arguments(*one, given.role, "live.preview_period_s=1");
  for (CLI::App* one : {robot, edge})
    one->add_option("--name", given.role.name, "which one of the configuration it is")->type_name("NAME");
  for (CLI::App* one : {edge, cloud})
    one->add_option("--threads", given.role.flags.threads, "threads to merge with; 0: one per processor")
        ->check(app::whole_number(0, 1024))
        ->type_name("N");
  add_out(*cloud, given.role.flags, "new folder for the results");
  cloud->add_flag("--force", given.role.flags.force, "replace an old folder of results");
  cloud->add_flag("--json", given.role.flags.json, "print the summary as JSON");
  add_out(*coordinator, given.role.flags, "folder for plan.json, which holds what it decided and why");
  app::show_examples(*team, {"mapweave_ros team tb0 tb1 --out maps/office"});
  app::show_examples(*robot, {"mapweave_ros robot office.yaml --name tb0"});
  app::show_examples(*edge, {"mapweave_ros edge office.yaml --name north"});
  app::show_examples(*cloud, {"mapweave_ros cloud office.yaml --out maps/office"});
  app::show_examples(*coordinator, {"mapweave_ros coordinator office.yaml --out plans/office"});
  try {
    program.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::Success& asked) {
    program.exit(asked);
    return ExitCode::done;
  } catch (const CLI::ParseError& error) {
    throw app::usage_error(program, error);
  }
  const std::string role = program.get_subcommands().front()->get_name();
  start_ros(argc, argv, given.role.name.empty() ? role : role + "_" + given.role.name);
  if (team->parsed()) {
    take_configuration(given.team);
    given.team.flags.set.emplace_back("reading.follow=true");
    return serve_team(given.team);
  }
  if (robot->parsed()) return serve<RobotNode>("robot", given.role, app::serve_robot);
  if (edge->parsed()) return serve<EdgeNode>("edge", given.role, app::serve_edge);
  if (cloud->parsed()) return serve<CloudNode>("cloud", given.role, app::serve_cloud);
  CoordinatorNode node;
  return app::serve_coordinator(given.role, node);
}

}  // namespace
}  // namespace mapweave::ros_nodes

int main(int argc, char** argv) {
  return mapweave::app::exit_code_of("mapweave_ros", [&] { return mapweave::ros_nodes::run_program(argc, argv); });
}
