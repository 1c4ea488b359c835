#include "misplaced_input.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/rawlog/contents.h>

#include <sstream>

namespace mapweave::app {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void refuse(const fs::path& path, const std::string& what, const std::string& remedy) {
  throw Error(ErrorCode::kUsage, what, path.string(), remedy);
}

// "MRPT rawlog"; empty for what is none.
std::string log_format(const fs::path& path) {
  if (!is_file(path) && !is_folder(path)) return "";
  try {
    return rawlog::format_of_log(path);
  } catch (const Error&) {
    return "";
  }
}

void refuse_map(const fs::path& path) {
  if (path.extension() != ".mwdb" && path.extension() != ".mwj") return;
  const std::string map = path.string();
  refuse(path, "this is a map", "look at it: mapweave inspect " + map + "; or use it with merge or export");
}

bool is_grid(const fs::path& yaml) {
  std::istringstream text(read_file(yaml));
  for (std::string line; std::getline(text, line);)
    if (line.compare(0, 6, "image:") == 0) return true;
  return false;
}

}  // namespace

void expect_configuration(const fs::path& path) {
  const std::string name = path.string();
  refuse_map(path);
  if (is_folder(path) && is_file(path / "run.yaml"))
    refuse(path, "this is a folder, not a configuration",
           "mapweave run " + (path / "run.yaml").string() + " --out DIR");
  if (is_folder(path) && is_file(path / "manifest.json"))
    refuse(path, "this is a folder of results",
           "again as before: mapweave run " + (path / "config.yaml").string() +
               " --out DIR; look at it: mapweave inspect " + name);
  if (path.extension() == ".yaml" || path.extension() == ".yml") return;
  if (const std::string format = log_format(path); !format.empty())
    refuse(path, "this is a log (" + format + "), not a configuration",
           "one robot: mapweave slam " + name +
               " --out DIR; several: list their logs in a file, robots: [{id: alpha, "
               "log: alpha.rawlog}, ...], and run that");
}

void expect_log(const fs::path& path, const std::string& verb) {
  const std::string name = path.string();
  refuse_map(path);
  if (is_folder(path) && is_file(path / "manifest.json") && log_format(path).empty())
    refuse(path, "this is a folder of results, not a log",
           is_file(path / "run.yaml")
               ? "map the logs in it: mapweave run " + (path / "run.yaml").string() + " --out DIR"
               : "look at it: mapweave inspect " + name);
  if ((path.extension() != ".yaml" && path.extension() != ".yml") || !is_file(path)) return;
  if (is_grid(path))
    refuse(path, "this is a map_server grid, not a log", "use it with merge, or look at it: mapweave inspect " + name);
  refuse(path, "this is a configuration, not a log",
         verb == "slam" ? "mapweave run " + name + " --out DIR" : "name one of the logs that it lists");
}

}  // namespace mapweave::app
