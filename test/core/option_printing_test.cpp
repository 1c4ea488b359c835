#include "team_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/files.h>
#include <mapweave/core/option_search.h>

#include <support/temporary_folder.h>
#include <cmath>
#include <limits>

namespace mapweave {
namespace {

using test::Engine;
using test::TeamOptions;
using testing::HasSubstr;

TeamOptions loaded(const std::string& text) {
  const test::TemporaryFolder folder;
  write_file(folder / "a.yaml", text);
  TeamOptions options;
  options.robots.resize(5);  // to be replaced
  ConfigurationSources sources;
  sources.files = {folder / "a.yaml"};
  load(options, sources);
  return options;
}

TeamOptions busy_team() {
  TeamOptions options;
  options.seed = 4294967295;
  options.robots.resize(2);
  options.robots[0].id = "alpha";
  options.robots[0].edge = "north side: \"A\"";
  options.robots[0].waypoints.resize(2);
  options.robots[0].waypoints[1].x_m = -0.1;
  options.laser.engine = Engine::rbpf;
  options.laser.close_loops = false;
  return options;
}

TEST(ToYaml, is_the_text_that_a_person_would_write) {
  EXPECT_EQ(to_yaml(busy_team()),
            "seed: 4294967295\n"
            "robots:\n"
            "  - id: alpha\n"
            "    edge: \"north side: \\\"A\\\"\"\n"
            "    waypoints:\n"
            "      - x_m: 0\n"
            "      - x_m: -0.1\n"
            "    start:\n"
            "      x_m: 0\n"
            "  - id: \"\"\n"
            "    edge: \"\"\n"
            "    waypoints: []\n"
            "    start:\n"
            "      x_m: 0\n"
            "laser:\n"
            "  engine: rbpf\n"
            "  graph:\n"
            "    search_radius_m: 4\n"
            "    min_score: 0.55\n"
            "  close_loops: false\n"
            "  height_m: 0\n"
            "decay_s: 0\n");
}

TEST(ToYaml, loads_to_the_same_options) {
  EXPECT_EQ(to_yaml(loaded(to_yaml(busy_team()))), to_yaml(busy_team()));
  EXPECT_EQ(loaded(to_yaml(TeamOptions())).robots.size(), 0u);
}

TEST(ToYaml, keeps_numbers_to_the_last_bit) {
  for (const double value :
       {0.1, 1.0 / 3.0, 1e-300, 1.7976931348623157e308, 5e-324, 123456789.0, 1e22, 0.1 + 0.2, 976052857.217426, 1e-7}) {
    TeamOptions options;
    options.decay_s = value;
    EXPECT_EQ(loaded(to_yaml(options)).decay_s, value);
  }
}

TEST(ToYaml, writes_numbers_of_daily_use_without_exponents) {
  for (const auto& [value, text] : std::vector<std::pair<double, std::string>>{
           {100000.0, "100000"}, {0.0001, "0.0001"}, {1e-7, "1e-07"}, {1e20, "1e+20"}, {0.1, "0.1"}}) {
    TeamOptions options;
    options.decay_s = value;
    EXPECT_THAT(to_yaml(options), HasSubstr("\ndecay_s: " + text + "\n"));
  }
}

TEST(ToYaml, keeps_texts_to_the_last_letter) {
  for (const std::string text : {"",
                                 " ",
                                 "true",
                                 "No",
                                 "null",
                                 "~",
                                 "17",
                                 "1e5",
                                 "-",
                                 "- a",
                                 "a: b",
                                 "a #b",
                                 "#b",
                                 "'",
                                 "\"",
                                 "\\",
                                 "a\nb",
                                 "a\tb",
                                 "\x01\x7F",
                                 "/data/log 1.rawlog",
                                 "{a}",
                                 "[a]",
                                 "*a",
                                 "&a",
                                 "!a",
                                 "%a",
                                 "@a",
                                 "`a",
                                 "|",
                                 ">",
                                 "?",
                                 "\xC3\xA4\xE2\x82\xAC",
                                 ".inf",
                                 "a,b",
                                 "alpha.rawlog",
                                 "0x1F",
                                 "2001-01-01",
                                 "=",
                                 "<<"}) {
    TeamOptions options;
    options.robots.resize(1);
    options.robots[0].id = text;
    EXPECT_EQ(loaded(to_yaml(options)).robots.at(0).id, text) << to_yaml(options);
  }
}

TEST(ReferencePage, explains_every_option) {
  EXPECT_EQ(reference_page(TeamOptions(), "All options.\nGenerated."),
            "# All options.\n"
            "# Generated.\n"
            "\n"
            "# of everything random (0..4294967295)\n"
            "seed: 1\n"
            "# who recorded what\n"
            "robots: []\n"
            "# - id: \"\"  # the robot's name\n"
            "#   edge: \"\"  # the edge that maps it\n"
            "#   waypoints: []  # where it goes\n"
            "#   # - x_m: 0  # forward (-10..10)\n"
            "#   start:  # where it begins\n"
            "#     x_m: 0  # forward (-10..10)\n"
            "# one robot's mapping\n"
            "laser:\n"
            "  # which mapper (graph, rbpf or icp)\n"
            "  engine: graph\n"
            "  # the mapper of submaps\n"
            "  graph:\n"
            "    # half the side of the searched square (greater than 0)\n"
            "    search_radius_m: 4\n"
            "    # mean occupancy under the scan (0..1)\n"
            "    min_score: 0.55\n"
            "  # look for places seen before (true or false)\n"
            "  close_loops: true\n"
            "  # above the robot's base (-2..2)\n"
            "  height_m: 0\n"
            "# how long old scans count (0 or more)\n"
            "decay_s: 0\n");
}

TEST(ReferencePage, is_itself_a_configuration_of_the_same_options) {
  for (const TeamOptions& options : {TeamOptions(), busy_team()})
    EXPECT_EQ(to_yaml(loaded(reference_page(options, "x"))), to_yaml(options));
}

TEST(ReferencePage, shows_an_element_that_works_when_its_marks_are_removed) {
  std::string page = reference_page(TeamOptions(), "x");
  const auto begin = page.find("robots: []"), end = page.find("# one robot's mapping");
  std::string uncommented = "robots:\n";
  for (std::size_t at = page.find('\n', begin) + 1; at < end; at = page.find('\n', at) + 1)
    uncommented += page.substr(at + 2, page.find('\n', at) - at - 1);
  const TeamOptions options = loaded(uncommented);
  EXPECT_EQ(options.robots.size(), 1u) << uncommented;
}

TEST(ToYaml, does_not_print_a_choice_that_has_no_name) {
  TeamOptions options;
  options.laser.engine = static_cast<Engine>(9);
  EXPECT_THROW(to_yaml(options), ContractViolation);
}

struct Nothing {
  template <class Visitor>
  void describe(Visitor&) {}
};
TEST(ChangedKeys, names_what_is_not_alike_and_a_list_as_a_whole) {
  const TeamOptions before = busy_team();
  EXPECT_TRUE(changed_keys(before, before).empty());
  TeamOptions after = before;
  after.seed += 1;
  after.laser.graph.min_score += 0.01;
  after.robots.back().edge += "x";
  EXPECT_EQ(changed_keys(before, after), (std::vector<std::string>{"seed", "robots", "laser.graph.min_score"}));
}

TEST(ToYaml, has_a_text_for_no_options_at_all) { EXPECT_EQ(to_yaml(Nothing()), "{}\n"); }

struct Named {
  std::vector<std::string> push_to;
  template <class Visitor>
  void describe(Visitor& v) {
    v.texts("push_to", push_to, "who is sent it");
  }
};

Named named(const std::string& text) {
  const test::TemporaryFolder folder;
  write_file(folder / "a.yaml", text);
  Named options{{"somebody", "else"}};
  ConfigurationSources sources;
  sources.files = {folder / "a.yaml"};
  load(options, sources);
  return options;
}

TEST(ToYaml, has_texts_in_one_line) {
  const Named options{{"alpha", "no", "two words"}};
  EXPECT_EQ(to_yaml(options), "push_to: [alpha, \"no\", \"two words\"]\n");
  EXPECT_EQ(named(to_yaml(options)).push_to, options.push_to);
  EXPECT_EQ(named("push_to: []").push_to, std::vector<std::string>());
  EXPECT_EQ(named("push_to:\n  - 1\n  - alpha\n").push_to, (std::vector<std::string>{"1", "alpha"}));
  EXPECT_THAT(reference_page(options, "title"), HasSubstr("# who is sent it\npush_to: [alpha,"));
}

TEST(ToYaml, refuses_what_is_no_list_of_texts) {
  for (const char* text : {"push_to: alpha", "push_to: [[alpha]]", "push_to: [{id: alpha}]", "push_to: {a: b}"}) try {
      named(text);
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("it must be a list of texts"));
      EXPECT_THAT(error.what(), HasSubstr("a.yaml:1"));
    }
  EXPECT_THROW(named("push_to:"), Error);
}

TEST(FoundOptions, are_those_whose_key_or_meaning_has_the_words) {
  EXPECT_EQ(found_options(TeamOptions(), {"SCORE"}),
            "laser.graph.min_score: 0.55\n    mean occupancy under the scan (0..1)\n");
  EXPECT_EQ(found_options(TeamOptions(), {"edge", "maps"}), "robots.0.edge: \"\"\n    the edge that maps it\n");
  EXPECT_THAT(found_options(TeamOptions(), {"forward"}),
              testing::AllOf(HasSubstr("robots.0.waypoints.0.x_m: 0\n"), HasSubstr("robots.0.start.x_m: 0\n")));
  EXPECT_EQ(found_options(TeamOptions(), {"colour"}), "");
}

}  // namespace
}  // namespace mapweave
