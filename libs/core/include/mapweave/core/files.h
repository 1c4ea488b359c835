#pragma once
// Writing so that nothing half-written is ever left: beside the goal first, then renamed into place.

#include <filesystem>
#include <string>
#include <string_view>

namespace mapweave {

std::string read_file(const std::filesystem::path&);  // throws Error kMissing

// Writes beside `path`, syncs, renames. Throws Error kCannotWrite (with free space when the disk is full) and leaves
// neither a partial file nor a changed old one.
void write_file(const std::filesystem::path& path, std::string_view bytes);

// A folder of results. It is built as "<path>.partial-<pid>" beside its goal; commit() renames it into place; a folder
// never committed is removed by the destructor.
class OutputFolder {
 public:
  // Throws Error kCannotWrite when `path` exists and is not an empty folder and not `force`, or when its parent cannot
  // be written. With `force`, an old folder is replaced at commit() and not before; a folder that holds anything that mapweave did
  // not write (no manifest.json in it) is refused even then.
  OutputFolder(std::filesystem::path path, bool force);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;
  const std::filesystem::path& staging() const { return staging_; }  // write here
  const std::filesystem::path& goal() const { return goal_; }
  void commit();

 private:
  std::filesystem::path goal_, staging_;
  bool force_, committed_ = false;
};

}  // namespace mapweave
