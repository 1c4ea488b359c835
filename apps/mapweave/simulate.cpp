// mapweave simulate: logs of a team in a world that is known.

#include "configuration.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/options.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/runtime/manifest.h>
#include <mapweave/simulation/simulate.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <iostream>
#include <memory>

namespace mapweave::app {
namespace {

ExitCode simulate(const std::string& world_file, const WritingFlags& flags) {
  using Json = nlohmann::ordered_json;
  simulation::WorldOptions world;
  std::vector<std::string> settings = flags.set;
  if (flags.seed) settings.push_back("seed=" + std::to_string(*flags.seed));
  load(world, {{world_file}, environment_for(fields_of(world)), settings});

  expect_outside(flags.out, {world_file});
  OutputFolder folder(flags.out, flags.force);
  WorkerPool pool(threads_of(flags));
  const auto progress = make_terminal_progress();
  const auto logs = [&] {
    try {
      return simulation::simulate(world, folder.staging(), pool, *progress);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kBadInput) throw;
      throw Error(error.code(), error.problem(), world_file + (error.where().empty() ? "" : ", " + error.where()),
                  error.remedy());
    }
  }();
  write_file(folder.staging() / "config.yaml", to_yaml(world));
  const Json manifest = runtime::manifest_json("simulate", static_cast<std::uint64_t>(world.seed),
                                               {{world_file, hash_of_file(world_file)}}, folder.staging());
  write_file(folder.staging() / "manifest.json", runtime::json_text(manifest) + "\n");
  folder.commit();

  Json summary = Json::array();
  for (const auto& log : logs) {
    summary.push_back({{"robot", log.robot},
                       {"scans", log.scans},
                       {"frames", log.frames},
                       {"length_m", log.length_m},
                       {"duration_s", log.duration_s}});
    if (flags.json) continue;
    std::printf("%s: %zu scans, ", log.robot.c_str(), log.scans);
    if (log.frames > 0) std::printf("%zu frames, ", log.frames);
    std::printf("%.0f m in %.0f s\n", log.length_m, log.duration_s);
  }
  if (flags.json)
    std::cout << runtime::json_text(summary) << '\n';
  else
    std::printf("map them with: mapweave run %s --out DIR\n", (folder.goal() / "run.yaml").c_str());
  return ExitCode::done;
}

}  // namespace

Action set_up_simulate(CLI::App& verb) {
  struct Arguments {
    std::string world;
    WritingFlags flags;
  };
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option("WORLD", arguments->world,
                  "world file (see configs/worlds; every key: mapweave config reference --of world)")
      ->required()
      ->type_name("WORLD.yaml");
  add_writing_flags(verb, arguments->flags);
  return [arguments] { return simulate(arguments->world, arguments->flags); };
}

}  // namespace mapweave::app
