// mapweave export: a map -> pictures, grids, clouds, trajectories.

#include "configuration.h"

#include <mapweave/core/files.h>
#include <mapweave/exporters/map_folder.h>
#include <mapweave/fusion/compose_grid.h>
#include <mapweave/runtime/manifest.h>
#include <mapweave/runtime/map_input.h>
#include <mapweave/runtime/map_names.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

namespace mapweave::app {
namespace {

struct Arguments {
  std::filesystem::path map;
  exporters::MapFolderFiles files{false, false, false, false, false, false};
  WritingFlags flags;
};

ExitCode export_map(Arguments arguments) {
  auto& files = arguments.files;
  if (!(files.png || files.pgm || files.pcd || files.tum || files.g2o))
    files.png = files.pgm = files.pcd = files.tum = true;
  runtime::RunConfiguration configuration = load_configuration({}, {}, arguments.flags).configuration;
  const runtime::MapInput input = runtime::read_map_input(arguments.map, MapId(runtime::name_of_file(arguments.map)));

  expect_outside(arguments.flags.out, {arguments.map});
  OutputFolder folder(arguments.flags.out, arguments.flags.force);
  WorkerPool pool(threads_of(arguments.flags));
  std::vector<std::string> written;
  for (const Map& map : input.maps) {
    exporters::MapFolderOptions options = runtime::folder_options(configuration.output, "map " + map.id.str());
    options.files = files;
    options.files.robot_trajectories = files.tum && map.robots().size() > 1;
    const std::filesystem::path below = input.maps.size() == 1 ? "" : map.id.str();
    for (const auto& file : exporters::write_map_folder(
             folder.staging() / below, map, fusion::compose_grid(map, configuration.compose, pool), options))
      written.push_back((below / file).string());
  }
  auto& output = configuration.output;
  output.png = files.png;
  output.pgm = files.pgm;
  output.pcd = files.pcd;
  output.tum = files.tum;
  output.g2o = files.g2o;
  write_file(folder.staging() / "config.yaml", to_yaml(configuration));
  std::vector<runtime::InputFile> read;
  for (const std::filesystem::path& file : input.files) read.push_back({file.string(), hash_of_file(file)});
  const auto manifest = runtime::manifest_json("export", configuration.seed, read, folder.staging());
  write_file(folder.staging() / "manifest.json", manifest.dump(2) + "\n");
  folder.commit();

  if (arguments.flags.json) std::printf("%s\n", nlohmann::ordered_json(written).dump(2).c_str());
  for (const std::string& file : written)
    if (!arguments.flags.json) std::printf("%s\n", (folder.goal() / file).c_str());
  return ExitCode::done;
}

}  // namespace

Action set_up_export(CLI::App& verb) {
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option("MAP", arguments->map,
                  "a map of mapweave (.mwdb), a live map server's journal (.mwj), or a map_server grid (.yaml); "
                  "without one of the five flags "
                  "below all but --g2o is written")
      ->required();
  verb.add_flag("--png", arguments->files.png, "map.png, and map.color.png with the robots' trajectories");
  verb.add_flag("--pgm", arguments->files.pgm, "map.pgm and map.yaml, as map_server and nav2 load them");
  verb.add_flag("--pcd", arguments->files.pcd, "map.pcd, the points of the walls");
  verb.add_flag("--tum", arguments->files.tum, "trajectory.tum, and one per robot where there are several");
  verb.add_flag("--g2o", arguments->files.g2o, "map.g2o, the pose graph");
  add_writing_flags(verb, arguments->flags);
  return [arguments] { return export_map(*arguments); };
}

}  // namespace mapweave::app
