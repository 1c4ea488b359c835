#pragma once
// Writing so that nothing half-written is ever left: beside the goal first, then renamed into place.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave {

// False also where the system does not say.
bool is_file(const std::filesystem::path&);
bool is_folder(const std::filesystem::path&);

// A file to read, or a pipe that somebody writes to; one without a writer is not waited for longer than a second.
class ReadableFile {
 public:
  explicit ReadableFile(std::filesystem::path path);  // throws Error kMissing
  ~ReadableFile();
  ReadableFile(const ReadableFile&) = delete;
  ReadableFile& operator=(const ReadableFile&) = delete;
  // At most `count` bytes; 0 at the end. Throws Error kMissing; Interrupted while it waits for a pipe.
  std::size_t read(char* to, std::size_t count);
  bool rewind();                                  // false where it is a pipe
  std::uint64_t bytes() const { return bytes_; }  // as it was opened; of a pipe 0

 private:
  std::filesystem::path path_;
  int number_ = -1;
  std::uint64_t bytes_ = 0;
  std::optional<char> first_;  // was read to know whether there is a writer
};

// Throws Error kMissing, or kBadInput for a file larger than the caller is ready to hold.
std::string read_file(const std::filesystem::path&, std::uint64_t most_bytes = std::uint64_t{1} << 32);

// Writes beside `path`, syncs, renames. Throws Error kCannotWrite (with free space when the disk is full) and leaves
// neither a partial file nor a changed old one.
void write_file(const std::filesystem::path& path, std::string_view bytes);

// With its parents; nothing where it is there. Throws Error kCannotWrite, with `problem` and what the system says.
void make_folder(const std::filesystem::path&, const std::string& remedy,
                 const std::string& problem = "the folder cannot be made");

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
  // Where something is at the goal already, what was built goes beside it instead, to a new name: the goal's, the
  // suffix, and a number where that is taken, too. False where there is nothing.
  bool step_aside(const std::string& suffix);
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
