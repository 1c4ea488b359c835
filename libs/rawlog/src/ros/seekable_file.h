#pragma once
// A recording that is read at any place.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

namespace mapweave::rawlog::ros {

class SeekableFile {
 public:
  // Throws Error: kMissing, kBadInput for a folder, a pipe and an empty file.
  explicit SeekableFile(std::filesystem::path path);
  ~SeekableFile();
  SeekableFile(const SeekableFile&) = delete;
  SeekableFile& operator=(const SeekableFile&) = delete;

  // Whether the file has so many bytes there; they are copied. Throws Error kMissing where the disk fails.
  bool read_at(std::uint64_t offset, void* to, std::size_t count) const;
  std::uint64_t bytes() const { return bytes_; }  // as it was opened, or looked at last
  // Looks at it again. False: no GrowingLog writes it any more, and bytes() are all.
  bool look_again();
  // Looks again until it has so many bytes, or nobody writes it any more. Throws Interrupted.
  void await(std::uint64_t bytes);
  const std::filesystem::path& path() const { return path_; }
  std::string place(std::uint64_t offset) const;  // "a.mcap at byte 17"

 private:
  std::filesystem::path path_;
  int number_ = -1;
  std::uint64_t bytes_ = 0;
};

}  // namespace mapweave::rawlog::ros
