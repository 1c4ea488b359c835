// mapweave timeline: when the map of a run would have been complete with other links and processors.

#include "configuration.h"

#include <mapweave/core/error.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/runtime/timeline.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <memory>

namespace mapweave::app {
namespace {

struct Arguments {
  std::filesystem::path folder;
  std::vector<std::string> settings;
  bool json = false;
};

// Refuses settings that cannot change what was measured. `seed` is that of the links' jitter and losses.
void expect_to_act(const std::string& setting) {
  static const std::vector<std::string> sections{"network.", "processors."}, keys{"cloud.at", "mode", "seed"};
  const std::string key = setting.substr(0, setting.find('='));
  const auto begins = [&](const std::string& section) {
    return key.compare(0, section.size(), section) == 0 || key + "." == section;
  };
  if (std::any_of(sections.begin(), sections.end(), begins) || std::find(keys.begin(), keys.end(), key) != keys.end())
    return;
  throw Error(ErrorCode::kUsage, "'" + key + "' does not act on what was measured", "--set " + setting,
              "set network, processors, cloud.at, mode or seed; for anything else run it again");
}

void expect_measured(runtime::Mode measured, runtime::Mode asked, const std::string& place) {
  using runtime::Mode;
  if (measured == asked) return;
  if (measured == Mode::cloud_only || asked == Mode::cloud_only)
    throw Error(ErrorCode::kUsage, "how long the cloud takes to merge alone is measured by a run in that mode alone",
                place, "run it again with --set mode=cloud-only");
  if (asked == Mode::offload)
    throw Error(ErrorCode::kUsage, "what robots pack and send was not measured, for they mapped on board", place,
                "run it again with --set mode=offload");
}

ExitCode print_timeline(const Arguments& arguments) {
  for (const std::string& setting : arguments.settings) expect_to_act(setting);
  runtime::RunConfiguration configuration;
  const std::filesystem::path file = arguments.folder / "config.yaml";
  load(configuration, {{file}, {}, {}});
  const runtime::Mode mode = configuration.mode;
  const Origins origins = load(configuration, {{}, environment_for(fields_of(configuration)), arguments.settings});
  expect_measured(mode, configuration.mode, origins.place_of("mode"));
  double recorded_s = 0.0;
  const runtime::Work work = runtime::read_work(arguments.folder / "summary.json", &recorded_s);
  const runtime::Timeline line = timeline({configuration.mode, configuration.network, configuration.processors,
                                           configuration.cloud, recorded_s, configuration.seed},
                                          work);
  if (arguments.json) {
    std::cout << runtime::json_text(timeline_json(line, work)) << '\n';
    return ExitCode::done;
  }
  std::printf("seconds since the recordings ended\n");
  for (const auto& robot : line.robots)
    std::printf("robot %-16s packed %8.3f  arrived %8.3f  mapped %8.3f  load %5.1f %%\n", robot.id.str().c_str(),
                robot.packed_s, robot.arrived_s, robot.mapped_s, 100.0 * robot.load);
  for (const auto& edge : line.edges)
    std::printf("edge  %-16s ready  %8.3f  fused   %8.3f  arrived %7.3f\n", edge.id.str().c_str(), edge.ready_s,
                edge.fused_s, edge.arrived_s);
  std::printf("all   %.3f\n", line.total_s);
  if (line.rounds) std::printf("%s", in_words(*line.rounds, work.rounds.size()).c_str());
  for (const auto& push : line.pushes)
    std::printf("robot %-16s has it at %.3f\n", push.robot.str().c_str(), push.arrived_s);
  return ExitCode::done;
}

}  // namespace

Action set_up_timeline(CLI::App& verb) {
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option("RUN_DIR", arguments->folder, "folder of results of `mapweave run`")->required();
  verb.add_option(
          "--set", arguments->settings,
          "links and processors to assume instead of the run's: network.robot_edge.profile=4g, processors.robot=0.12")
      ->type_name("KEY=VALUE");
  verb.add_flag("--json", arguments->json, "print JSON");
  return [arguments] { return print_timeline(*arguments); };
}

}  // namespace mapweave::app
