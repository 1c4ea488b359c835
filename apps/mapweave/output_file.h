#pragma once
// A single file that a command line names as output: it must not destroy what was there for another purpose.

#include <filesystem>
#include <string_view>
#include <vector>

namespace mapweave::app {

struct OutputFile {
  std::filesystem::path path;
  std::vector<std::filesystem::path> inputs;  // of the same command
  std::string_view ending;                    // of such files, ".png"; empty: of any name
};

// Writes the file, also over an earlier one of its kind. Throws Error(kUsage) where the path is an input, a file of
// another kind, or part of a folder of results, and what write_file() throws.
void write_output(const OutputFile&, std::string_view content);
// Throws as write_output() does; writes nothing. For long work, before it begins.
void expect_free(const OutputFile&);

}  // namespace mapweave::app
