#include <gtest/gtest.h>
#include <mapweave/core/exit_code.h>

namespace mapweave {
namespace {

TEST(Error, says_where_what_and_what_to_do) {
  const Error error(ErrorCode::kCorrupt, "object needs 3102 bytes, 977 remain", "a.rawlog at byte 48213",
                    "record again");
  EXPECT_STREQ(error.what(), "a.rawlog at byte 48213: object needs 3102 bytes, 977 remain; record again");
  EXPECT_EQ(error.problem(), "object needs 3102 bytes, 977 remain");
  EXPECT_EQ(error.where(), "a.rawlog at byte 48213");
  EXPECT_EQ(error.remedy(), "record again");
  EXPECT_STREQ(Error(ErrorCode::kInternal, "odd").what(), "odd");
  EXPECT_STREQ(Error(ErrorCode::kInternal, "odd", {}, "restart").what(), "odd; restart");
}

TEST(Error, names_the_folder_of_results_and_not_the_one_beside_it_that_a_full_disk_cut_short) {
  EXPECT_EQ(Error(ErrorCode::kCannotWrite, "full", "/a/out.partial-123/robots/map.mwdb.partial-123-0").where(),
            "/a/out/robots/map.mwdb");
  EXPECT_EQ(Error(ErrorCode::kCannotWrite, "full", "/a/out.partial-notes").where(), "/a/out.partial-notes");
}

TEST(Error, has_the_exit_code_that_scripts_rely_on) {
  EXPECT_EQ(exit_code(ErrorCode::kUsage), ExitCode::wrong_usage);
  for (const auto code : {ErrorCode::kBadInput, ErrorCode::kMissing, ErrorCode::kCorrupt, ErrorCode::kUnsupported})
    EXPECT_EQ(exit_code(code), ExitCode::bad_input);
  for (const auto code : {ErrorCode::kCannotWrite, ErrorCode::kHelperFailed, ErrorCode::kInternal})
    EXPECT_EQ(exit_code(code), ExitCode::failed);
}

TEST(ContractViolation, names_the_contract_and_the_place) {
  try {
    MAPWEAVE_EXPECT(1 + 1 == 3, "numbers are odd");
    FAIL() << "nothing was thrown";
  } catch (const ContractViolation& violation) {
    const std::string message = violation.what();
    EXPECT_NE(message.find("error_test.cpp:"), std::string::npos) << message;
    EXPECT_NE(message.find("numbers are odd"), std::string::npos) << message;
    EXPECT_NE(message.find("1 + 1 == 3"), std::string::npos) << message;
  }
}

TEST(ContractViolation, does_not_come_where_the_contract_is_kept) {
  EXPECT_NO_THROW(MAPWEAVE_EXPECT(true, "never said"));
}

}  // namespace
}  // namespace mapweave
