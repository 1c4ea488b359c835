#include <gtest/gtest.h>
#include <mapweave/core/options.h>
#include <mapweave/exporters/map_folder.h>

namespace mapweave::exporters {
namespace {

void expect_defaults_in_range(const OptionFields& fields) {
  for (const auto& option : fields) {
    SCOPED_TRACE(option.name);
    EXPECT_FALSE(option.doc.empty());
    if (const auto* number = std::get_if<OptionNumber>(&option.as)) {
      EXPECT_GE(*number->value, number->low);
      EXPECT_LE(*number->value, number->high);
    }
    if (const auto* integer = std::get_if<OptionInteger>(&option.as)) {
      EXPECT_GE(integer->get(), integer->low);
      EXPECT_LE(integer->get(), integer->high);
    }
    if (const auto* section = std::get_if<OptionSection>(&option.as)) expect_defaults_in_range(section->fields);
  }
}

TEST(MapFolderOptions, have_defaults_that_may_be_written_in_a_configuration) {
  MapFolderOptions options;
  const auto fields = fields_of(options);
  EXPECT_EQ(fields.size(), 3u);
  expect_defaults_in_range(fields);
}

}  // namespace
}  // namespace mapweave::exporters
