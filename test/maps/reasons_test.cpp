#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/files.h>
#include <mapweave/maps/reasons.h>

#include <set>

namespace mapweave {
namespace {

TEST(Reasons, have_words_of_their_own) {
  std::set<std::string> words, names;
  for (int i = 0; i <= static_cast<int>(kLastReason); ++i) {
    words.insert(std::string(in_words(static_cast<Reason>(i))));
    names.insert(std::string(to_text(static_cast<Reason>(i))));
  }
  EXPECT_EQ(words.size(), static_cast<std::size_t>(kLastReason) + 1);
  EXPECT_EQ(names.size(), words.size());
  EXPECT_EQ(names.count("unknown"), 0U);
}

TEST(Reasons, stand_in_the_guides_table_with_the_same_words) {
  const std::string guide = read_file(MAPWEAVE_TEST_DATA "/../../apps/mapweave/guide/merges.md");
  for (int i = 0; i <= static_cast<int>(kLastReason); ++i) {
    const Reason reason = static_cast<Reason>(i);
    const std::string help(what_helps(reason));
    EXPECT_THAT(
        guide, testing::HasSubstr("| `" + std::string(to_text(reason)) + "` | " + std::string(in_words(reason)) + " |" +
                                  (help.empty() ? " |" : " " + help + " |")));
  }
}

}  // namespace
}  // namespace mapweave
