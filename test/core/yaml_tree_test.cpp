#include "yaml_tree.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace mapweave {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

YamlNode parse(const std::string& text) {
  return parse_yaml(text, [](int line, std::string problem, std::string remedy) {
    return Error(ErrorCode::kBadInput, std::move(problem), "line " + std::to_string(line), std::move(remedy));
  });
}

std::string refusal(const std::string& text) {
  try {
    parse(text);
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

std::string repeated(const std::string& text, int count) {
  std::string all;
  for (int i = 0; i < count; ++i) all += text;
  return all;
}

TEST(YamlTree, knows_the_line_of_everything) {
  const YamlNode tree = parse("a: 1\nb:\n  - x: 'q'\n  - y\nc:\n");
  ASSERT_EQ(tree.keys, (std::vector<std::string>{"a", "b", "c"}));
  EXPECT_EQ(tree.key_lines, (std::vector<int>{1, 2, 5}));
  EXPECT_EQ(tree.items[0].text, "1");
  EXPECT_EQ(tree.items[0].line, 1);
  ASSERT_EQ(tree.items[1].items.size(), 2u);
  EXPECT_EQ(tree.items[1].items[0].items[0].line, 3);
  EXPECT_TRUE(tree.items[1].items[0].items[0].is_quoted);
  EXPECT_EQ(tree.items[1].items[1].line, 4);
  EXPECT_FALSE(tree.items[1].items[1].is_quoted);
  EXPECT_EQ(tree.items[2].kind, YamlNode::Kind::null);
}

TEST(YamlTree, refuses_what_is_not_yaml_with_its_line) {
  EXPECT_THAT(refusal("a: 1\nb: [1, 2\nc: 3\n"), StartsWith("line "));
  EXPECT_THAT(refusal("a: 1\n\tb: 2\n"), StartsWith("line 2: is not YAML: "));
  EXPECT_THAT(refusal("a: 'never closed\nb: 2\n"), StartsWith("line 2: is not YAML: "));
  EXPECT_THAT(refusal("a: \"never closed\n\n"), HasSubstr("is not YAML: "));
  EXPECT_THAT(refusal("a: [1"), HasSubstr("is not YAML: "));
  EXPECT_THAT(refusal("a: 1\n b: 2\n"), StartsWith("line 2: is not YAML: "));
  EXPECT_THAT(refusal("a: }"), HasSubstr("is not YAML: "));
  EXPECT_THAT(refusal("%YAML 9.9.9.9\n---\na: 1\n"), HasSubstr("is not YAML: "));
}

TEST(YamlTree, refuses_what_a_configuration_does_not_need) {
  EXPECT_THAT(refusal("a: &x 1\nb: *x\n"), StartsWith("line 1: anchors and aliases"));
  EXPECT_THAT(refusal("a: !!python/object 1\n"), StartsWith("line 1: tags"));
  EXPECT_THAT(refusal("a: 1\n---\nb: 2\n"), StartsWith("line 2: a second document begins here"));
  EXPECT_THAT(refusal("[a]: 1\n"), StartsWith("line 1: a key must be text"));
  EXPECT_THAT(refusal("? {a: b}\n: 1\n"), StartsWith("line 1: a key must be text"));
  EXPECT_THAT(refusal("~: 1\n"), StartsWith("line 1: a key must be text"));
  EXPECT_EQ(refusal("a: 1\nb:\n  a: 2\n  a: 3\n"), "line 4: key 'a' comes twice; it is on line 3 already");
}

TEST(YamlTree, refuses_bytes_that_are_not_text) {
  EXPECT_EQ(refusal(std::string("a: 1\nb: \0\n", 10)), "line 2: byte 0 is not text; a configuration is YAML in UTF-8");
  EXPECT_THAT(refusal("a: 1\n\x04 hidden"), HasSubstr("byte 4 is not text"));
  EXPECT_THAT(refusal(std::string("\xFF\xFE"
                                  "a\0:\0",
                                  6)),
              HasSubstr("is not text"));
}

TEST(YamlTree, survives_bombs) {
  std::string laughs = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 12; ++i)
    laughs += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [" +
              repeated("*a" + std::to_string(i - 1) + ", ", 9) + "]\n";
  EXPECT_THAT(refusal(laughs), HasSubstr("anchors and aliases"));
  EXPECT_THAT(refusal(repeated("[", 200) + repeated("]", 200)), HasSubstr("nested more than 32 deep"));
  EXPECT_THAT(refusal(repeated("{a: ", 200) + repeated("}", 200)), HasSubstr("nested more than 32 deep"));
  EXPECT_THAT(refusal(repeated("[", 200'000)), StartsWith("line 1: "));
  EXPECT_THAT(refusal(repeated("[", 200'000) + repeated("]", 200'000)), StartsWith("line 1: "));
  EXPECT_THAT(refusal(repeated("{a: ", 100'000)), StartsWith("line 1: "));
  EXPECT_THAT(refusal(repeated("- ", 100'000)), HasSubstr("nested more than 32 deep"));
  EXPECT_THAT(refusal(repeated("? ", 100'000)), StartsWith("line "));
  EXPECT_THAT(refusal(repeated("a", 2'000'000)), HasSubstr("is larger than"));
  std::string staircase;
  for (int i = 0; i < 500; ++i) staircase += std::string(static_cast<std::size_t>(i), ' ') + "a:\n";
  EXPECT_THAT(refusal(staircase), HasSubstr("nested more than 32 deep"));
}

TEST(YamlTree, reads_many_keys_in_a_moment) {
  std::string text;
  for (int i = 0; i < 60'000; ++i) text += "key" + std::to_string(i) + ": 1\n";
  EXPECT_EQ(parse(text).keys.size(), 60'000u);
}

TEST(YamlTree, survives_a_file_cut_at_any_byte_or_damaged) {
  const std::string text =
      "robots:\n  - {id: alpha, log: \"a b.rawlog\"}\n  - id: 'beta'\n    log: |\n      x\nlaser: {graph: {min_score: "
      "0.5, list: [1, 2, "
      ">-\n x]}}\n# end\n";
  for (std::size_t length = 0; length <= text.size(); ++length)
    EXPECT_NO_FATAL_FAILURE(refusal(text.substr(0, length)));
  std::mt19937_64 random(7);
  const std::string spice = "[]{}:,-?&*!|>'\"%@`#\n\t ~\\=<.0a\xC3\xFF";
  for (int i = 0; i < 3000; ++i) {
    std::string damaged = text;
    for (int j = 0; j < 4; ++j) damaged[random() % damaged.size()] = spice[random() % spice.size()];
    refusal(damaged);
  }
  for (int i = 0; i < 2000; ++i) {
    std::string soup;
    for (int j = 0; j < 40; ++j) soup += spice[random() % spice.size()];
    refusal(soup);
  }
}

TEST(ShownText, is_short_and_harmless) {
  EXPECT_EQ(shown_text("plain"), "plain");
  EXPECT_EQ(shown_text("a\x1b[2Jb\n"), "a?[2Jb?");
  EXPECT_EQ(shown_text(std::string(1000, 'x')), std::string(60, 'x') + "...");
  EXPECT_EQ(shown_text(std::string(59, 'x') + "\xC3\xA4" + "y"), std::string(59, 'x') + "...");
}

}  // namespace
}  // namespace mapweave
