// mapweave serve: robots, edges and a cloud as programs of their own.

#include "serve.h"

#include "command_line.h"

#include <memory>

namespace mapweave::app {
namespace {

struct Arguments {
  RoleArguments role;
  bool reads_input = false;
  DemoArguments demo;
  KeysArguments keys;
};

void add_threads_flag(CLI::App& role, RoleArguments& arguments) {
  role.add_option("--threads", arguments.flags.threads,
                  "threads to merge with; 0: one per processor. Results do not depend on it")
      ->check(whole_number(0, 1024))
      ->type_name("N");
}

}  // namespace

Action set_up_serve(CLI::App& verb) {
  const auto arguments = std::make_shared<Arguments>();
  verb.require_subcommand(1);
  CLI::App* robot = verb.add_subcommand("robot", "plays a robot's recording and sends it to its edge");
  CLI::App* edge = verb.add_subcommand("edge", "maps what its robots send, and merges their maps");
  CLI::App* cloud = verb.add_subcommand("cloud", "merges the maps of all edges, and writes the results");
  CLI::App* coordinator = verb.add_subcommand("coordinator", "gives robots to edges, again and again while they drive");
  CLI::App* keys = verb.add_subcommand("keys", "makes certificates, users and passwords for a deployment's broker");
  CLI::App* demo = verb.add_subcommand("demo", "all of them on this machine, with three simulated robots");
  for (CLI::App* role : {robot, edge, cloud, coordinator, keys})
    add_role_arguments(*role, arguments->role, "live.speed=2");
  robot->add_option("--name", arguments->role.name, "which robot of the configuration it is")->type_name("NAME");
  robot->add_flag("--stdin", arguments->reads_input,
                  "map what standard input brings, a rawlog or an MCAP recording, as it comes; it is kept in the "
                  "robot's log, which must not be there yet, or holds the beginning of the same drive that was not "
                  "all sent");
  edge->add_option("--name", arguments->role.name, "which edge of the configuration it is")->type_name("NAME");
  for (CLI::App* role : {edge, cloud}) add_threads_flag(*role, arguments->role);
  cloud->add_option("-o,--out", arguments->role.flags.out, "new folder for the results")->required()->type_name("DIR");
  cloud->add_flag("--force", arguments->role.flags.force, "replace an old folder of results");
  cloud->add_flag("--json", arguments->role.flags.json, "print the summary as JSON");
  coordinator
      ->add_option("-o,--out", arguments->role.flags.out, "folder for plan.json, which holds what it decided and why")
      ->required()
      ->type_name("DIR");
  keys->add_option("-o,--out", arguments->role.flags.out,
                   "folder for them; keys that it holds already stay as they are")
      ->required()
      ->type_name("DIR");
  keys->add_option("--host", arguments->keys.hosts,
                   "name or address of the broker's machine, as programs reach it; several may be given")
      ->required()
      ->type_name("HOST")
      ->allow_extra_args(false);
  keys->add_option("--port", arguments->keys.port, "where the broker listens")
      ->check(whole_number(1, 65535))
      ->type_name("N")
      ->capture_default_str();
  keys->add_option("--leaf-port", arguments->keys.leaf_port, "where it listens for edges' own brokers")
      ->check(whole_number(1, 65535))
      ->type_name("N")
      ->capture_default_str();
  demo->add_option("-o,--out", arguments->demo.out, "new folder for the results; the robots' logs are put beside it")
      ->type_name("DIR")
      ->capture_default_str();
  demo->add_option("--speed", arguments->demo.speed, "how many times faster than real the robots drive")
      ->check(number(0.0))
      ->type_name("X")
      ->capture_default_str();
  demo->add_option("--port", arguments->demo.port,
                   "port of the page that shows what happens, on this machine alone; 0: any that is free")
      ->check(whole_number(0, 65535))
      ->type_name("PORT")
      ->capture_default_str();
  demo->add_flag("--force", arguments->demo.force, "replace an old folder of results");
  demo->add_flag("--json", arguments->demo.json, "print the summary as JSON");
  show_examples(*robot, {"mapweave serve robot office.yaml --name alpha"});
  show_examples(*edge, {"mapweave serve edge office.yaml --name north"});
  show_examples(*cloud, {"mapweave serve cloud office.yaml --out maps/office"});
  show_examples(*coordinator, {"mapweave serve coordinator office.yaml --out plans/office"});
  show_examples(*keys, {"mapweave serve keys office.yaml --host 10.0.0.1 --out keys"});
  show_examples(*demo, {"mapweave serve demo --out maps/demo"});
  return [=] {
    RoleExtension none;
    if (robot->parsed())
      return arguments->reads_input ? serve_robot_by_input(arguments->role) : serve_robot(arguments->role, none);
    if (edge->parsed()) return serve_edge(arguments->role, none);
    if (cloud->parsed()) return serve_cloud(arguments->role, none);
    if (coordinator->parsed()) return serve_coordinator(arguments->role, none);
    if (keys->parsed()) {
      arguments->keys.out = arguments->role.flags.out;
      return make_keys(load_deployment(arguments->role.file, arguments->role.flags), arguments->keys);
    }
    return serve_demo(arguments->demo);
  };
}

}  // namespace mapweave::app
