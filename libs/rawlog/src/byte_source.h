#pragma once
// The bytes of a file, unpacked where it is gz, through one buffer.

#include "log_writer.h"

#include <mapweave/core/files.h>
#include <zlib.h>

#include <cstdint>
#include <cstring>
#include <exception>
#include <filesystem>
#include <memory>
#include <string_view>
#include <vector>

namespace mapweave::rawlog {

// gz is checked to its end (checksums, length); damage is thrown, as Error kCorrupt, once all that precedes it has been
// taken.
class ByteSource {
 public:
  // follows: its end is waited for while a GrowingLog writes it. Throws Error kMissing,
  // kBadInput for an empty file.
  explicit ByteSource(std::filesystem::path path, bool follows = false);
  ~ByteSource();
  ByteSource(const ByteSource&) = delete;
  ByteSource& operator=(const ByteSource&) = delete;

  // The next bytes, at least `wanted` of them unless the stream ends before. Valid until the next call.
  std::string_view ahead(std::size_t wanted) {
    while (end_ - begin_ < wanted && !ended_) fill();
    return {buffer_.data() + begin_, end_ - begin_};
  }
  void skip(std::size_t count);  // at most what ahead() showed
  // Copies `count` bytes; false where the stream ends before (then they are taken all the same).
  bool take(char* to, std::size_t count) {
    if (count > end_ - begin_) return take_slowly(to, count);
    std::memcpy(to, buffer_.data() + begin_, count);
    begin_ += count;
    position_ += count;
    return true;
  }
  // Nothing is left. Throws where nothing is left because of damage.
  bool at_end();
  // Throws the damage that ended the stream, if it was damage.
  void throw_damage() const {
    if (damage_) std::rethrow_exception(damage_);
  }
  // Something in this stream made no sense: was it the gz? Unpacks the rest, which is dropped, and answers `seen`, or
  // where the gz proves damaged an Error that says so first. Nothing is left afterwards. Throws where interrupted.
  std::exception_ptr cause_of(std::exception_ptr seen);
  void rewind();

  std::uint64_t position() const { return position_; }  // in the unpacked stream
  std::uint64_t file_bytes_read() const { return file_bytes_read_ - (packed_end_ - packed_begin_); }
  std::uint64_t file_bytes() const { return file_bytes_; }
  bool packed() const { return packed_; }
  const std::filesystem::path& path() const { return path_; }
  std::string place(std::uint64_t position) const;  // "a.rawlog at byte 17 of the unpacked stream"

 private:
  void fill();
  bool take_slowly(char* to, std::size_t count);
  std::size_t read_file(char* to, std::size_t count);
  std::size_t read_on(char* to, std::size_t count);
  void inflate_into(char* to, std::size_t count, std::size_t& got);

  std::filesystem::path path_;
  std::unique_ptr<ReadableFile> file_;
  std::unique_ptr<LogWriterWatch> writer_;  // where it is followed
  bool packed_ = false, ended_ = false, member_open_ = false;
  std::uint64_t file_bytes_ = 0, file_bytes_read_ = 0, position_ = 0;
  std::vector<char> buffer_, packed_buffer_;
  std::size_t begin_ = 0, end_ = 0, packed_begin_ = 0, packed_end_ = 0;
  z_stream inflater_{};
  std::exception_ptr damage_;
};

}  // namespace mapweave::rawlog
