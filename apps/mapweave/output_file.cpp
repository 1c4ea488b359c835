#include "output_file.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <nlohmann/json.hpp>

#include <algorithm>

namespace mapweave::app {
namespace {

namespace fs = std::filesystem;

bool is_in_manifest(const fs::path& manifest, const std::string& name) {
  if (name == "manifest.json" || name == "summary.json") return true;
  const nlohmann::json listed = nlohmann::json::parse(read_file(manifest), nullptr, false);
  if (!listed.is_object() || !listed.contains("outputs")) return false;
  return listed["outputs"].contains(name);
}

// Of run, slam, merge and the like: their manifest lists it.
bool is_of_results(const fs::path& file) {
  constexpr int kDepth = 4;
  std::error_code ignored;
  const fs::path whole = fs::weakly_canonical(file, ignored);
  fs::path folder = whole.parent_path();
  for (int i = 0; i < kDepth && folder.has_relative_path(); ++i, folder = folder.parent_path())
    if (fs::is_regular_file(folder / "manifest.json", ignored))
      return is_in_manifest(folder / "manifest.json", whole.lexically_relative(folder).generic_string());
  return false;
}

[[noreturn]] void refuse(const fs::path& file, const std::string& what) {
  throw Error(ErrorCode::kUsage, what, file.string(), "nothing was written: name another file");
}

}  // namespace

void expect_free(const OutputFile& output) {
  const fs::path& file = output.path;
  std::error_code ignored;
  if (!fs::exists(file, ignored)) return;
  for (const fs::path& input : output.inputs)
    if (fs::equivalent(file, input, ignored)) refuse(file, "this file is an input of the same command");
  if (fs::is_regular_file(file, ignored) && !output.ending.empty() && file.extension() != output.ending)
    refuse(file, "another file is there, and a " + std::string(output.ending) + " file would replace it");
  if (is_of_results(file)) refuse(file, "this file belongs to a folder of results");
}

void write_output(const OutputFile& output, std::string_view content) {
  expect_free(output);
  write_file(output.path, content);
}

}  // namespace mapweave::app
