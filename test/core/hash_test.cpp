#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/hash.h>

#include <support/temporary_folder.h>
#include <cstdint>

namespace mapweave {
namespace {

TEST(Hash, is_sha_256) {
  EXPECT_EQ(to_hex(hash_of_bytes("")), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(to_hex(hash_of_bytes("abc")), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(Hash, of_a_file_is_that_of_its_bytes) {
  const test::TemporaryFolder folder;
  const std::string bytes(1'000'003, 'x');  // several blocks
  write_file(folder / "a", bytes);
  EXPECT_EQ(hash_of_file(folder / "a"), hash_of_bytes(bytes));
  write_file(folder / "empty", "");
  EXPECT_EQ(hash_of_file(folder / "empty"), hash_of_bytes(""));
}

TEST(Hash, of_no_file_is_an_error_that_names_it) {
  const test::TemporaryFolder folder;
  for (const auto& path : {folder / "absent", folder.path()}) {
    try {
      hash_of_file(path);
      FAIL() << "nothing was thrown for " << path;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kMissing);
      EXPECT_EQ(error.where(), path.string());
    }
  }
}

TEST(Hasher, distinguishes_texts_that_read_alike_in_a_row) {
  EXPECT_NE(Hasher().add("ab").add("c").finish(), Hasher().add("a").add("bc").finish());
  EXPECT_EQ(Hasher().add("ab").add("c").finish(), Hasher().add("ab").add("c").finish());
  EXPECT_NE(Hasher().add(1.0).finish(), Hasher().add(std::int64_t{1}).finish());
}

TEST(Hasher, writes_numbers_with_their_low_bytes_first) {
  EXPECT_EQ(Hasher().add(std::int64_t{0x0102}).finish(), hash_of_bytes(std::string_view("\2\1\0\0\0\0\0\0", 8)));
  EXPECT_EQ(Hasher().add(std::int64_t{-2}).finish(), hash_of_bytes("\xFE\xFF\xFF\xFF\xFF\xFF\xFF\xFF"));
  EXPECT_EQ(Hasher().add(1.0).finish(), hash_of_bytes(std::string_view("\0\0\0\0\0\0\xF0\x3F", 8)));
  EXPECT_EQ(Hasher().add("x").finish(), hash_of_bytes(std::string_view("\1\0\0\0\0\0\0\0x", 9)));
}

TEST(Hasher, finishes_once) {
  Hasher hasher;
  hasher.finish();
  EXPECT_THROW(hasher.finish(), ContractViolation);
  EXPECT_THROW(hasher.add("more"), ContractViolation);
}

}  // namespace
}  // namespace mapweave
