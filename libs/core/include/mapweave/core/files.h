#pragma once
// Writing so that nothing half-written is ever left: beside the goal first, then renamed into place.

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave {

// Throws Error kMissing, or kBadInput for a file larger than the caller is ready to hold.
std::string read_file(const std::filesystem::path&, std::uint64_t most_bytes = std::uint64_t{1} << 32);

// Writes beside `path`, syncs, renames. Throws Error kCannotWrite (with free space when the disk is full) and leaves
// neither a partial file nor a changed old one.
void write_file(const std::filesystem::path& path, std::string_view bytes);

// An input that a folder of results would replace is lost with --force: throws Error kUsage where one of them lies in
// `out_folder`, or is it.
void expect_outside(const std::filesystem::path& out_folder, const std::vector<std::filesystem::path>& inputs);

// A folder of results. It is built as "<path>.partial-<pid>" beside its goal; commit() renames it into place; a folder
// never committed is removed by the destructor, with the parents that were made for it. What crashed processes left
// beside the goal is removed first.
class OutputFolder {
 public:
  // Throws Error kCannotWrite when `path` exists and is not an empty folder and not `force`, or when its parent cannot
  // be written. With `force`, an old folder is replaced at commit() and not before; a folder that holds anything that
  // mapweave did not write (no manifest.json in it) is refused even then.
  OutputFolder(std::filesystem::path path, bool force);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;
  const std::filesystem::path& staging() const { return staging_; }  // write here
  const std::filesystem::path& goal() const { return goal_; }
  // Syncs, then renames. Throws Error kCannotWrite; then the goal is as it was.
  void commit();

 private:
  void remove_made_parents();
  std::filesystem::path goal_, staging_;
  std::vector<std::filesystem::path> made_parents_;  // innermost first
  int lock_ = -1;  // descriptor of the staging folder, locked: says to other processes that it is being built
  bool force_, committed_ = false;
};

}  // namespace mapweave
