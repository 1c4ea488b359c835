// Whole configurations: every option of the program, and the plan that is made of it.

#include "fuzz_target.h"

#include <mapweave/runtime/run_configuration.h>

namespace mapweave::fuzz {

using namespace runtime;

std::vector<std::string> seeds() {
  RunConfiguration all;
  all.robots.resize(1);
  all.robots[0].id = "alpha";
  all.robots[0].log = "alpha.rawlog";
  return {
      "robots:\n  - {id: alpha, log: a.rawlog, edge: north}\n  - {id: beta, log: b.rawlog, start: {x_m: 1}}\n"
      "edges: [{id: north}]\nmode: offload\nsensor: laser\nlaser:\n  engine: graph\nteam:\n  refuse: "
      "['alpha,beta']\n",
      to_yaml(all)};
}

void decode(std::string_view bytes) {
  RunConfiguration configuration;
  const Origins origins = load(configuration, {{scratch_file("run.yaml", bytes)}, {}, {}});
  std::string yaml;
  try {
    complete_starts(configuration, origins);
    yaml = to_yaml(effective(configuration, make_plan(configuration, origins, LogsAre::with_robots)));
  } catch (const Error& error) {  // of several places that do not go together, or of what is in none
    expect(error.code() != ErrorCode::kInternal, error.what());
    return;
  }
  RunConfiguration again;
  try {
    load(again, {{scratch_file("again.yaml", yaml)}, {}, {}});
  } catch (const Error& error) {
    expect(false, std::string("what was planned loads again: ") + error.what());
  }
}

}  // namespace mapweave::fuzz
