#pragma once
// What comes over a wire is hostile: every byte changed, every byte the last.

#include <mapweave/core/error.h>

#include <gtest/gtest.h>
#include <string>

namespace mapweave::test {

// `decode(bytes)` gives a value that has a byte form again, or throws Error; how often it did.
template <class Decode>
int refused_of_damaged(const std::string& bytes, const Decode& decode) {
  int refused = 0;
  const auto look = [&](const std::string& damaged) {
    try {
      const auto got = decode(damaged);
      EXPECT_NO_THROW(encode(got)) << "what was read is sound";
    } catch (const Error& error) {
      EXPECT_TRUE(error.code() == ErrorCode::kCorrupt || error.code() == ErrorCode::kUnsupported) << error.what();
      EXPECT_EQ(error.where().substr(0, 4), "test");
      ++refused;
    }
  };
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    for (const unsigned char flip : {0x01, 0x10, 0x80, 0xff}) {
      std::string damaged = bytes;
      damaged[i] = static_cast<char>(static_cast<unsigned char>(damaged[i]) ^ flip);
      look(damaged);
    }
    look(bytes.substr(0, i));
  }
  return refused;
}

}  // namespace mapweave::test
