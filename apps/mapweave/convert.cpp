// mapweave convert: any recording becomes an MRPT rawlog.

#include "configuration.h"
#include "misplaced_input.h"

#include <mapweave/core/error.h>
#include <mapweave/core/options.h>
#include <mapweave/rawlog/convert.h>
#include <mapweave/runtime/json_text.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <iostream>
#include <memory>

namespace mapweave::app {
namespace {

struct Arguments {
  std::string log;
  std::filesystem::path out;
  std::vector<std::string> set;
  bool force = false, json = false;
};

struct Settings {
  rawlog::ReadOptions reading;
  template <class Visitor>
  void describe(Visitor& v) {
    v.section("reading", reading, "what the log does not say itself");
  }
};

ExitCode convert(const Arguments& arguments) {
  if (!arguments.force && std::filesystem::exists(arguments.out))
    throw Error(ErrorCode::kCannotWrite, "the file exists", arguments.out.string(),
                "choose another name, or replace it with --force");
  Settings settings;
  load(settings, {{}, environment_for(fields_of(settings)), arguments.set});
  const auto progress = make_terminal_progress();
  const std::uint64_t count = rawlog::convert_log(arguments.log, arguments.out, *progress, settings.reading);
  if (arguments.json)
    std::cout << runtime::json_text({{"log", arguments.out.string()}, {"observations", count}}) << '\n';
  else
    std::printf("%s: %llu observations\n", arguments.out.c_str(), static_cast<unsigned long long>(count));
  return ExitCode::done;
}

}  // namespace

Action set_up_convert(CLI::App& verb) {
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option("IN", arguments->log,
                  "MRPT rawlog, ROS bag, CARMEN log (.gz too), g2o with scans, or a folder of pictures (TUM RGB-D, "
                  "KITTI, EuRoC)")
      ->required();
  verb.add_option("OUT", arguments->out, "rawlog to write")->required()->type_name("OUT.rawlog");
  verb.add_option("--set", arguments->set, "what the log does not say, as in reading.laser_x_m=0.2")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  verb.add_flag("--force", arguments->force, "replace an old file");
  verb.add_flag("--json", arguments->json, "print JSON");
  return [arguments] {
    expect_log(arguments->log, "convert");
    return convert(*arguments);
  };
}

}  // namespace mapweave::app
