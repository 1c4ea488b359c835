// Configurations: YAML, and settings as of a command line.

#include "fuzz_target.h"

#include <core/team_options.h>

namespace mapweave::fuzz {
namespace {

constexpr char kTeam[] =
    "seed: 7\nrobots:\n  - id: alpha\n    edge: north\n    waypoints: [{x_m: 1}, {x_m: -2.5}]\n    start: {x_m: 3}\n"
    "  - {id: \"b\\u00e9ta\", edge: 'so''uth'}\nlaser:\n  engine: rbpf  # a comment\n  graph:\n    search_radius_m: "
    "1e-3\n"
    "    min_score: .5\n  close_loops: false\n  height_m: -1.25\ndecay_s: 0\n";

// What was loaded is written as YAML that loads as the same.
void load_and_write(const ConfigurationSources& sources) {
  test::TeamOptions team;
  load(team, sources);
  const std::string yaml = to_yaml(team);
  test::TeamOptions again;
  try {
    load(again, {{scratch_file("again.yaml", yaml)}, {}, {}});
  } catch (const Error& error) {
    expect(false, std::string("what was written loads: ") + error.what());
  }
  expect(to_yaml(again) == yaml, "what was written loads as it was");
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = {
      {[](std::string_view bytes) {
         load_and_write({{scratch_file("input.yaml", bytes)}, {}, {}});
       },
       {kTeam, ""}},
      {[](std::string_view bytes) {
         load_and_write({{scratch_file("team.yaml", kTeam)}, {}, {std::string(bytes)}});
       },
       {"laser.graph.min_score=0.5", "robots.0.edge=north", "robots[1].waypoints=[{x_m: 2}]", "seed=12"}},
      {[](std::string_view bytes) {
         load_and_write({{}, {{"MAPWEAVE_LASER__GRAPH__MIN_SCORE", std::string(bytes)}}, {}});
       },
       {"0.5"}}};
  return all;
}

}  // namespace

std::vector<std::string> seeds() { return seeds_of(kinds()); }
void decode(std::string_view bytes) { decode_one_of(kinds(), bytes); }

}  // namespace mapweave::fuzz
