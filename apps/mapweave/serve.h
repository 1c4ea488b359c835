#pragma once
// What the parts of `serve` share.

#include "stop_signals.h"

#include <mapweave/core/exit_code.h>
#include <mapweave/runtime/live_cloud.h>

#include <filesystem>
#include <string>
#include <vector>

namespace mapweave::app {

// "alpha + beta, gamma" of maps that are one.
std::string joint_in_words(const std::vector<std::vector<MapId>>& joint);

// Until the results are written and the edges know it: shows what it does. `asked`: called once, when the user wants an
// end. Throws Interrupted where the user asks again.
runtime::Report wait_for_results(runtime::LiveCloud& cloud, StopSignals& signals, const std::function<void()>& asked,
                                 const std::function<void()>& now_and_then);

// serve demo: all of it on this machine.
struct DemoArguments {
  std::filesystem::path out = "mapweave-demo";
  bool force = false, json = false;
  double speed = 1.0;
};
ExitCode serve_demo(const DemoArguments& arguments);

// serve keys: for a broker on a machine with these names or addresses. What the folder holds already stays.
struct KeysArguments {
  std::vector<std::string> hosts;
  int port = 4222;
  std::filesystem::path out;
};
ExitCode make_keys(const runtime::RunPlan& plan, const KeysArguments& arguments);

}  // namespace mapweave::app
