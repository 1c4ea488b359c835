#pragma once
// What was given to the wrong verb: the message says what it is, and which verb takes it.

#include <filesystem>
#include <string>

namespace mapweave::app {

// Throw Error(kUsage). What is neither one nor the other passes: reading it says what is wrong.
void expect_configuration(const std::filesystem::path&);                 // of `run`: no log, no map, no folder
void expect_log(const std::filesystem::path&, const std::string& verb);  // no configuration, no map, no results

}  // namespace mapweave::app
