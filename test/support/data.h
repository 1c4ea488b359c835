#pragma once
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

namespace mapweave::test {

// A small file of ours in test/data.
inline std::filesystem::path own_data(const std::string& name) {
  return std::filesystem::path(MAPWEAVE_TEST_DATA) / name;
}

// A public log below MAPWEAVE_DATA (the environment's, else the build's); empty where it is absent.
inline std::filesystem::path public_data(const std::string& name) {
  const char* root = std::getenv("MAPWEAVE_DATA");
  const auto path = std::filesystem::path(root != nullptr ? root : MAPWEAVE_PUBLIC_DATA) / name;
  return std::filesystem::exists(path) ? path : std::filesystem::path{};
}

// First line of a test that needs a public log.
#define MAPWEAVE_NEED_DATA(variable, name)                   \
  const auto variable = ::mapweave::test::public_data(name); \
  if (variable.empty())                                      \
  GTEST_SKIP() << "needs the public log " << name << "; set MAPWEAVE_DATA to the folder that holds it"

}  // namespace mapweave::test
