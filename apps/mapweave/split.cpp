// mapweave split: the logs of several robots out of one, cut by time, or of a bag by namespaces.

#include "command_line.h"
#include "configuration.h"
#include "misplaced_input.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/options.h>
#include <mapweave/rawlog/split.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/runtime/manifest.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <memory>

namespace mapweave::app {
namespace {

struct Arguments {
  WritingFlags flags;
  std::string log;
  rawlog::SplitOptions options;
  bool by_namespace = false;
};

// What --set can reach.
struct Settings {
  rawlog::ReadOptions reading;
  template <class Visitor>
  void describe(Visitor& v) {
    v.section("reading", reading, "what the log does not say itself");
  }
};

// As it was carried out.
std::string effective(const Arguments& arguments, const Settings& settings) {
  const auto number = [](double value) {
    char text[40];
    std::snprintf(text, sizeof text, "%.9g", value);
    return std::string(text);
  };
  std::string cuts;
  for (const double at : arguments.options.at_s) {
    char text[40];
    std::snprintf(text, sizeof text, "%s%.9f", cuts.empty() ? "" : ", ", at);
    cuts += text;
  }
  if (arguments.by_namespace) return to_yaml(settings);
  return "robots: " + std::to_string(arguments.options.robots) + "\noverlap_s: " + number(arguments.options.overlap_s) +
         "\nat_s: [" + cuts + "]\n" + to_yaml(settings);
}

ExitCode split(Arguments arguments) {
  using Json = nlohmann::ordered_json;
  Settings settings;
  load(settings, {{}, environment_for(fields_of(settings)), arguments.flags.set});
  arguments.options.reading = settings.reading;
  if (!arguments.options.at_s.empty()) std::sort(arguments.options.at_s.begin(), arguments.options.at_s.end());

  expect_outside(arguments.flags.out, {arguments.log});
  OutputFolder folder(arguments.flags.out, arguments.flags.force);
  const auto progress = make_terminal_progress();
  const auto parts =
      arguments.by_namespace
          ? rawlog::split_by_namespace(arguments.log, folder.staging(), arguments.options.reading, *progress)
          : rawlog::split_log(arguments.log, folder.staging(), arguments.options, *progress);
  // A configuration that maps the parts as they are.
  std::string run = "robots:\n";
  Json summary = Json::array();
  for (const rawlog::SplitPart& part : parts) {
    const std::string file = part.path.filename().string(), robot = part.path.stem().string();
    run += "  - {id: " + robot + ", log: " + file + "}\n";
    summary.push_back({{"robot", robot},
                       {"log", file},
                       {"first", part.first.seconds()},
                       {"last", part.last.seconds()},
                       {"scans", part.scans},
                       {"odometry", part.odometry},
                       {"frames", part.frames}});
  }
  write_file(folder.staging() / "run.yaml", run);
  write_file(folder.staging() / "config.yaml", effective(arguments, settings));
  const Json manifest =
      runtime::manifest_json("split", arguments.flags.seed.value_or(1),
                             {{arguments.log, runtime::hash_of_input(arguments.log)}}, folder.staging());
  write_file(folder.staging() / "manifest.json", runtime::json_text(manifest) + "\n");
  folder.commit();

  if (arguments.flags.json) {
    std::cout << runtime::json_text(summary) << '\n';
    return ExitCode::done;
  }
  for (const rawlog::SplitPart& part : parts)
    std::printf("%s: %llu scans, %llu frames, %.3f to %.3f s\n", (folder.goal() / part.path.filename()).c_str(),
                static_cast<unsigned long long>(part.scans), static_cast<unsigned long long>(part.frames),
                part.first.seconds(), part.last.seconds());
  std::printf("map them with: mapweave run %s --out DIR\n", (folder.goal() / "run.yaml").c_str());
  return ExitCode::done;
}

}  // namespace

Action set_up_split(CLI::App& verb) {
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option("LOG", arguments->log,
                  "MRPT rawlog, ROS bag, CARMEN log, g2o with scans, or a folder of pictures (TUM RGB-D, KITTI, EuRoC)")
      ->required();
  CLI::Option* robots =
      verb.add_option("--robots", arguments->options.robots, "how many logs to make, cut by time; or --by-namespace")
          ->check(whole_number(1, 1000))
          ->type_name("N");
  CLI::Option* by_namespace =
      verb.add_flag("--by-namespace", arguments->by_namespace,
                    "a log for each robot of a ROS bag, by the namespaces of their topics; nothing is cut")
          ->excludes(robots);
  verb.add_option("--overlap", arguments->options.overlap_s, "each part grows by this much on either side")
      ->check(number(0.0))
      ->excludes(by_namespace)
      ->type_name("SECONDS");
  verb.add_option("--at", arguments->options.at_s,
                  "where to cut, N - 1 times, in the log's own seconds; without it: equal durations")
      ->excludes(by_namespace)
      ->type_name("T")
      ->allow_extra_args(false);
  add_writing_flags(verb, arguments->flags);
  return [arguments, robots] {
    if (robots->count() == 0 && !arguments->by_namespace)
      throw Error(
          ErrorCode::kUsage, "neither --robots nor --by-namespace says what to make", "split",
          "cut by time with --robots N; of a ROS bag of several robots, make a log of each with --by-namespace");
    expect_log(arguments->log, "split");
    return split(*arguments);
  };
}

}  // namespace mapweave::app
