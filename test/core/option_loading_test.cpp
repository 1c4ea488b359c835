#include "team_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/files.h>

#include <support/temporary_folder.h>
#include <algorithm>
#include <cstdlib>

namespace mapweave {
namespace {

using test::Engine;
using test::TeamOptions;
using testing::HasSubstr;

class OptionLoading : public testing::Test {
 protected:
  // Writes the texts as a.yaml, b.yaml, ... and loads them under the settings.
  Origins load_texts(const std::vector<std::string>& texts, const std::vector<std::string>& settings = {},
                     const std::vector<std::pair<std::string, std::string>>& environment = {}) {
    ConfigurationSources sources;
    for (const auto& text : texts) {
      sources.files.push_back(folder_ / (std::string(1, static_cast<char>('a' + sources.files.size())) + ".yaml"));
      write_file(sources.files.back(), text);
    }
    sources.settings = settings;
    sources.environment = environment;
    options_ = {};
    return load(options_, sources);
  }

  // The message, without the folder.
  std::string refusal(const std::vector<std::string>& texts, ErrorCode code = ErrorCode::kBadInput,
                      const std::vector<std::string>& settings = {},
                      const std::vector<std::pair<std::string, std::string>>& environment = {}) {
    try {
      load_texts(texts, settings, environment);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code) << error.what();
      EXPECT_EQ(to_yaml(options_), to_yaml(TeamOptions())) << "a refused configuration changes nothing";
      return in_folder(error.what());
    }
    return "accepted";
  }
  std::string refusal_of_setting(const std::string& setting) {
    return refusal({"robots: [{id: a}, {id: b}]"}, ErrorCode::kUsage, {setting});
  }
  std::string refusal_of_variable(const std::string& name, const std::string& value) {
    return refusal({"robots: [{id: a}, {id: b}]"}, ErrorCode::kBadInput, {}, {{name, value}});
  }

  std::string in_folder(std::string text) const {
    const std::string prefix = folder_.path().string() + "/";
    for (std::size_t at; (at = text.find(prefix)) != std::string::npos;) text.erase(at, prefix.size());
    return text;
  }

  test::TemporaryFolder folder_;
  TeamOptions options_;
};

TEST_F(OptionLoading, puts_a_file_over_the_defaults) {
  load_texts(
      {"seed: 7\nlaser:\n  engine: icp\n  graph: {min_score: 0.25}\n  close_loops: false\n  height_m: -1e-1\nrobots:\n "
       " - id: alpha\n    "
       "waypoints: [{x_m: 1}, {x_m: +2.5}]\n  - {id: '17', start: {x_m: 3}}\n"});
  EXPECT_EQ(options_.seed, 7u);
  EXPECT_EQ(options_.laser.engine, Engine::icp);
  EXPECT_EQ(options_.laser.graph.min_score, 0.25);
  EXPECT_EQ(options_.laser.graph.search_radius_m, 4.0);
  EXPECT_FALSE(options_.laser.close_loops);
  EXPECT_EQ(options_.laser.height_m, -0.1);
  ASSERT_EQ(options_.robots.size(), 2u);
  EXPECT_EQ(options_.robots[0].id, "alpha");
  EXPECT_EQ(options_.robots[0].waypoints.at(1).x_m, 2.5);
  EXPECT_EQ(options_.robots[1].id, "17");
  EXPECT_EQ(options_.robots[1].start.x_m, 3.0);
}

TEST_F(OptionLoading, takes_empty_files_and_sections_as_nothing_set) {
  for (const char* text :
       {"", "\n# only words\n", "---\n", "laser:\n", "laser: {}\n", "\xEF\xBB\xBFseed: 1\n", "seed: 1\r\nlaser:\r\n"}) {
    load_texts({text});
    EXPECT_EQ(to_yaml(options_), to_yaml(TeamOptions())) << text;
  }
}

TEST_F(OptionLoading, takes_text_for_what_it_says) {
  load_texts({"robots: [{id: 17}, {id: true}, {id: ''}, {id: 'null'}, {id: \"a\\tb\"}]"});
  EXPECT_EQ(options_.robots[0].id, "17");
  EXPECT_EQ(options_.robots[1].id, "true");
  EXPECT_EQ(options_.robots[2].id, "");
  EXPECT_EQ(options_.robots[3].id, "null");
  EXPECT_EQ(options_.robots[4].id, "a\tb");
}

TEST_F(OptionLoading, refuses_unknown_keys_with_the_nearest_name) {
  EXPECT_EQ(refusal({"laser:\n  graph:\n    search_radius: 4\n"}),
            "a.yaml:3: unknown key 'search_radius'; did you mean 'search_radius_m'?");
  EXPECT_EQ(refusal({"sede: 4\n"}), "a.yaml:1: unknown key 'sede'; did you mean 'seed'?");
  EXPECT_EQ(refusal({"robots:\n  - id: a\n    egde: north\n"}), "a.yaml:3: unknown key 'egde'; did you mean 'edge'?");
  EXPECT_EQ(refusal({"# x\nmin_score: 0.5\n"}),
            "a.yaml:2: unknown key 'min_score'; did you mean 'laser.graph.min_score'?");
  EXPECT_EQ(refusal({"telescope: 1\n"}), "a.yaml:1: unknown key 'telescope'; known here: seed, robots, laser, decay_s");
}

TEST_F(OptionLoading, refuses_values_out_of_range_with_the_range) {
  EXPECT_EQ(refusal({"laser:\n  graph:\n    min_score: 6\n"}), "a.yaml:3: 'min_score' is 6; it must lie in 0..1");
  EXPECT_EQ(refusal({"laser: {graph: {search_radius_m: 0}}"}),
            "a.yaml:1: 'search_radius_m' is 0; it must be greater than 0");
  EXPECT_EQ(refusal({"decay_s: -0.5"}), "a.yaml:1: 'decay_s' is -0.5; it must be 0 or more");
  EXPECT_EQ(refusal({"laser: {height_m: 2.01}"}), "a.yaml:1: 'height_m' is 2.01; it must lie in -2..2");
  EXPECT_EQ(refusal({"seed: -1"}), "a.yaml:1: 'seed' is -1; it must lie in 0..4294967295");
  EXPECT_EQ(refusal({"seed: 99999999999999999999"}),
            "a.yaml:1: 'seed' is 99999999999999999999; it must lie in 0..4294967295");
  EXPECT_EQ(refusal({"laser: {engine: grpah}"}),
            "a.yaml:1: 'engine' is 'grpah'; it must be graph, rbpf or icp; did you mean 'graph'?");
  EXPECT_EQ(refusal({"robots: [{id: a, waypoints: [{x_m: 1},\n {x_m: 11}]}]"}),
            "a.yaml:2: 'x_m' is 11; it must lie in -10..10");
}

TEST_F(OptionLoading, refuses_numbers_that_are_not_finite) {
  for (const char* value : {".nan", ".inf", "-.inf", "nan", "inf", "-Infinity", ".NaN"}) {
    EXPECT_EQ(refusal({std::string("decay_s: ") + value}),
              std::string("a.yaml:1: 'decay_s' is '") + value + "'; it must be 0 or more");
  }
  EXPECT_EQ(refusal({"decay_s: 1e999"}), "a.yaml:1: 'decay_s' is 1e999; it must be 0 or more");
}

TEST_F(OptionLoading, refuses_values_of_another_type) {
  EXPECT_EQ(refusal({"decay_s: soon"}), "a.yaml:1: 'decay_s' is 'soon'; it must be a number");
  EXPECT_EQ(refusal({"decay_s: 1.5s"}), "a.yaml:1: 'decay_s' is '1.5s'; it must be a number");
  EXPECT_EQ(refusal({"decay_s: '1.5'"}), "a.yaml:1: 'decay_s' is '1.5'; it must be a number");
  EXPECT_EQ(refusal({"decay_s: [1]"}), "a.yaml:1: 'decay_s' is a list; it must be a number");
  EXPECT_EQ(refusal({"decay_s:\n  x: 1"}), "a.yaml:2: 'decay_s' is a section; it must be a number");
  EXPECT_EQ(refusal({"decay_s:\n"}), "a.yaml:1: 'decay_s' has no value; it must be 0 or more");
  EXPECT_EQ(refusal({"seed: 1.5"}), "a.yaml:1: 'seed' is 1.5; it must be a whole number");
  EXPECT_EQ(refusal({"seed: 0x10"}), "a.yaml:1: 'seed' is '0x10'; it must be a whole number");
  EXPECT_EQ(refusal({"laser: {close_loops: yes}"}), "a.yaml:1: 'close_loops' is 'yes'; it must be true or false");
  EXPECT_EQ(refusal({"laser: graph"}), "a.yaml:1: 'laser' is 'graph'; it must be a section with keys of its own");
  EXPECT_EQ(refusal({"robots: {id: a}"}), "a.yaml:1: 'robots' is a section; it must be a list");
  EXPECT_EQ(refusal({"robots:\n"}), "a.yaml:1: 'robots' has no value; write [] for an empty list");
  EXPECT_EQ(refusal({"robots:\n  - alpha\n"}),
            "a.yaml:2: 'robots.0' is 'alpha'; each element has keys of its own, like 'id: ...'");
  EXPECT_EQ(refusal({"robots: [{id: ~}]"}),
            "a.yaml:1: 'id' has no value; write \"\" for an empty text, and quotes around a text like null or ~");
  EXPECT_EQ(refusal({"just words"}),
            "a.yaml:1: has no keys at its top; a configuration consists of lines like 'key: value'");
  EXPECT_EQ(refusal({"- seed\n"}),
            "a.yaml:1: has no keys at its top; a configuration consists of lines like 'key: value'");
}

TEST_F(OptionLoading, refuses_a_key_that_comes_twice) {
  EXPECT_EQ(refusal({"seed: 1\ndecay_s: 1\nseed: 2\n"}), "a.yaml:3: key 'seed' comes twice; it is on line 1 already");
}

TEST_F(OptionLoading, names_a_file_that_is_missing) {
  ConfigurationSources sources;
  sources.files = {folder_ / "absent.yaml"};
  try {
    load(options_, sources);
    FAIL() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kMissing);
    EXPECT_EQ(error.where(), sources.files[0].string());
  }
}

TEST_F(OptionLoading, puts_later_layers_over_earlier_ones) {
  const std::vector<std::string> files = {"seed: 1\ndecay_s: 1\nlaser: {height_m: 1, graph: {min_score: 0.1}}",
                                          "seed: 2\nlaser: {height_m: 2, engine: icp}"};
  load_texts(files, {"seed=4"}, {{"MAPWEAVE_SEED", "3"}, {"MAPWEAVE_LASER__HEIGHT_M", "0.5"}});
  EXPECT_EQ(options_.seed, 4u);
  EXPECT_EQ(options_.laser.height_m, 0.5);
  EXPECT_EQ(options_.laser.engine, Engine::icp);
  EXPECT_EQ(options_.laser.graph.min_score, 0.1);
  EXPECT_EQ(options_.decay_s, 1.0);
}

TEST_F(OptionLoading, replaces_a_list_by_that_of_a_later_layer) {
  const auto origins = load_texts({"robots: [{id: a, edge: north}, {id: b}, {id: c}]", "robots: [{id: x}]"});
  ASSERT_EQ(options_.robots.size(), 1u);
  EXPECT_EQ(options_.robots[0].id, "x");
  EXPECT_EQ(options_.robots[0].edge, "");
  EXPECT_FALSE(origins.is_given("robots.0.edge"));
  EXPECT_FALSE(origins.is_given("robots.1.id"));
  EXPECT_EQ(in_folder(origins.place_of("robots.0.id")), "b.yaml:1");
}

TEST_F(OptionLoading, reads_settings_as_yaml) {
  load_texts({"robots: [{id: a}, {id: b}]"},
             {"robots.1.edge=north", "robots[0].edge=south", "laser={engine: rbpf, close_loops: false}", "decay_s=2",
              "laser.graph.min_score=0.5", "robots.0.waypoints=[{x_m: 1}, {x_m: 2}]", "robots.0.waypoints.1.x_m=3",
              "robots.0.id=\"x=y\""});
  EXPECT_EQ(options_.robots[1].edge, "north");
  EXPECT_EQ(options_.robots[0].edge, "south");
  EXPECT_EQ(options_.robots[0].id, "x=y");
  EXPECT_EQ(options_.laser.engine, Engine::rbpf);
  EXPECT_FALSE(options_.laser.close_loops);
  EXPECT_EQ(options_.laser.graph.min_score, 0.5);
  ASSERT_EQ(options_.robots[0].waypoints.size(), 2u);
  EXPECT_EQ(options_.robots[0].waypoints[1].x_m, 3.0);
  load_texts({}, {"robots=[{id: y}]", "robots.0.id=z"});
  EXPECT_EQ(options_.robots.at(0).id, "z");
}

TEST_F(OptionLoading, refuses_settings_that_say_nothing) {
  EXPECT_EQ(
      refusal_of_setting("laser.graph.min_scor=0.5"),
      "--set laser.graph.min_scor=0.5: unknown key 'laser.graph.min_scor'; did you mean 'laser.graph.min_score'?");
  EXPECT_EQ(refusal_of_setting("min_score=0.5"),
            "--set min_score=0.5: unknown key 'min_score'; did you mean 'laser.graph.min_score'?");
  EXPECT_EQ(refusal_of_setting("laser.graph.min_score=6"),
            "--set laser.graph.min_score=6: 'min_score' is 6; it must lie in 0..1");
  EXPECT_EQ(refusal_of_setting("seed"), "--set seed: has no '='; write --set key=value");
  EXPECT_EQ(refusal_of_setting("seed="), "--set seed=: 'seed' has no value; it must lie in 0..4294967295");
  EXPECT_EQ(refusal_of_setting("robots.2.edge=x"),
            "--set robots.2.edge=x: 'robots' has no element '2'; its elements are 0..1");
  EXPECT_EQ(refusal_of_setting("robots.-1.edge=x"),
            "--set robots.-1.edge=x: 'robots' has no element '-1'; its elements are 0..1");
  EXPECT_EQ(
      refusal_of_setting("robots.0.waypoints.0.x_m=1"),
      "--set robots.0.waypoints.0.x_m=1: 'robots.0.waypoints' has no element '0'; it is empty; give the list first");
  EXPECT_EQ(refusal_of_setting("robots.0=a"),
            "--set robots.0=a: 'robots.0' is 'a'; each element has keys of its own, like 'id: ...'");
  EXPECT_THAT(refusal_of_setting("robots.0.egde=x"), HasSubstr("did you mean 'robots.0.edge'?"));
  EXPECT_THAT(refusal_of_setting("seed.x=1"), HasSubstr("unknown key 'seed.x'"));
  EXPECT_THAT(refusal_of_setting("=1"), HasSubstr("unknown key ''"));
  EXPECT_THAT(refusal_of_setting(".seed=1"), HasSubstr("did you mean 'seed'?"));
  EXPECT_THAT(refusal_of_setting("seed.=1"), HasSubstr("did you mean 'seed'?"));
  EXPECT_THAT(refusal_of_setting("robots.=1"), HasSubstr("'robots' has no element ''"));
  EXPECT_THAT(refusal_of_setting("seed=[1"), HasSubstr("--set seed=[1: "));
}

TEST_F(OptionLoading, reads_the_environment) {
  load_texts({"robots: [{id: a}]"}, {},
             {{"HOME", "/root"},
              {"MAPWEAVE_DATA", "/data"},
              {"MAPWEAVE_LASER__GRAPH__MIN_SCORE", "0.75"},
              {"MAPWEAVE_ROBOTS__0__EDGE", "west"}});
  EXPECT_EQ(options_.laser.graph.min_score, 0.75);
  EXPECT_EQ(options_.robots[0].edge, "west");
}

TEST_F(OptionLoading, refuses_variables_that_mean_nothing) {
  EXPECT_EQ(refusal_of_variable("MAPWEAVE_LASER__GRAPH__MIN_SCOER", "0.5"),
            "environment variable MAPWEAVE_LASER__GRAPH__MIN_SCOER: unknown key 'laser.graph.min_scoer'; did you mean "
            "'MAPWEAVE_LASER__GRAPH__MIN_SCORE'?");
  EXPECT_EQ(refusal_of_variable("MAPWEAVE_SEED", "many"),
            "environment variable MAPWEAVE_SEED: 'seed' is 'many'; it must be a whole number");
  EXPECT_THAT(refusal_of_variable("MAPWEAVE_", "1"), HasSubstr("unknown key ''"));
  EXPECT_THAT(refusal_of_variable("MAPWEAVE_LASER_ENGINE", "icp"), HasSubstr("did you mean 'MAPWEAVE_LASER__ENGINE'?"));
}

TEST_F(OptionLoading, knows_the_environment_of_the_process) {
  ::setenv("MAPWEAVE_SEED", "12", 1);
  ConfigurationSources sources;
  sources.environment = process_environment();
  load(options_, sources);
  ::unsetenv("MAPWEAVE_SEED");
  EXPECT_EQ(options_.seed, 12u);
  EXPECT_TRUE(std::is_sorted(sources.environment.begin(), sources.environment.end()));
}

TEST_F(OptionLoading, remembers_where_each_value_came_from) {
  const auto origins = load_texts({"seed: 1\nrobots:\n  - id: a\n  - id: a\nlaser:\n  engine: icp\n", "decay_s: 1"},
                                  {"robots.1.edge=north"}, {{"MAPWEAVE_LASER__HEIGHT_M", "1"}});
  EXPECT_EQ(in_folder(origins.place_of("seed")), "a.yaml:1");
  EXPECT_EQ(in_folder(origins.place_of("robots.1.id")), "a.yaml:4");
  EXPECT_EQ(in_folder(origins.place_of("robots[1].id")), "a.yaml:4");
  EXPECT_EQ(in_folder(origins.place_of("robots.1.start.x_m")), "a.yaml:4")
      << "the element, since the value was not given";
  EXPECT_EQ(origins.place_of("robots.1.edge"), "--set robots.1.edge=north");
  EXPECT_EQ(origins.place_of("laser.height_m"), "environment variable MAPWEAVE_LASER__HEIGHT_M");
  EXPECT_EQ(in_folder(origins.place_of("laser.engine")), "a.yaml:6");
  EXPECT_EQ(in_folder(origins.place_of("laser.graph.min_score")), "a.yaml:5");
  EXPECT_EQ(origins.file_of("decay_s"), folder_ / "b.yaml");
  EXPECT_EQ(origins.file_of("robots.1.edge"), "");
  EXPECT_EQ(Origins().place_of("seed"), "");
  EXPECT_TRUE(origins.is_given("seed"));
  EXPECT_FALSE(origins.is_given("laser.graph.min_score"));
}

TEST_F(OptionLoading, checks_values_set_in_code) {
  EXPECT_NO_THROW(check(TeamOptions()));
  TeamOptions options;
  options.robots.resize(2);
  options.robots[1].start.x_m = 99.0;
  try {
    check(options);
    FAIL() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "'robots.1.start.x_m' is 99; it must lie in -10..10");
  }
  options.robots.clear();
  options.laser.engine = static_cast<Engine>(77);
  EXPECT_THROW(check(options), Error);
}

TEST_F(OptionLoading, a_key_without_its_section_or_unit_is_named) {
  EXPECT_EQ(refusal({"seed: 1\nheight: 1\n"}), "a.yaml:2: unknown key 'height'; did you mean 'laser.height_m'?");
  EXPECT_EQ(refusal_of_setting("serch_radius_m=1"),
            "--set serch_radius_m=1: unknown key 'serch_radius_m'; did you mean 'laser.graph.search_radius_m'?");
  EXPECT_EQ(refusal_of_setting("x=1"),
            "--set x=1: unknown key 'x'; did you mean 'robots.0.start.x_m', 'robots.1.start.x_m' or "
            "'robots.0.waypoints.0.x_m'?");
  EXPECT_THAT(refusal_of_setting("colour=red"), HasSubstr("mapweave config reference --find WORD"));
}

struct TwiceNamed {
  double a = 1.0, b = 1.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("same", a, "");
    v.positive("same", b, "");
  }
};
struct TooWide {
  std::uint8_t value = 0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("value", value, 0, 256, "");
  }
};
struct BadlyNamed {
  bool value = false;
  template <class Visitor>
  void describe(Visitor& v) {
    v.flag("two__underscores", value, "");
  }
};

TEST(OptionVisitor, refuses_descriptions_that_cannot_work) {
  EXPECT_THROW(to_yaml(TwiceNamed()), ContractViolation);
  EXPECT_THROW(to_yaml(TooWide()), ContractViolation);
  EXPECT_THROW(to_yaml(BadlyNamed()), ContractViolation);
}

}  // namespace
}  // namespace mapweave
