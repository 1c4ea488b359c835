#include <gtest/gtest.h>
#include <mapweave/core/options.h>
#include <mapweave/evaluation/absolute_error.h>
#include <mapweave/evaluation/grid_agreement.h>
#include <mapweave/evaluation/relations.h>

namespace mapweave::evaluation {
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
  }
}

template <class Options>
void expect_described(std::size_t count) {
  Options options;
  const auto fields = fields_of(options);
  EXPECT_EQ(fields.size(), count);
  expect_defaults_in_range(fields);
}

TEST(EvaluationOptions, have_defaults_that_may_be_written_in_a_configuration) {
  expect_described<RelationErrorOptions>(5);
  expect_described<TrajectoryErrorOptions>(2);
  expect_described<RelativeErrorOptions>(4);
  expect_described<GridAgreementOptions>(1);
}

}  // namespace
}  // namespace mapweave::evaluation
