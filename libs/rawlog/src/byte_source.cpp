#include "byte_source.h"

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <string>
#include <thread>

namespace mapweave::rawlog {
namespace {

constexpr std::size_t kBufferBytes = 1 << 20, kPackedBytes = 1 << 18, kLeastBytes = 1 << 12;
constexpr int kGzOnly = 15 + 16;  // zlib's window bits, plus "a gz header is needed"
constexpr const char* kCopyAgain = "copy the log again, or record again";

}  // namespace

ByteSource::ByteSource(std::filesystem::path path, bool follows) : path_(std::move(path)) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path_, ignored))
    throw Error(ErrorCode::kBadInput, "is a folder; a log file was expected", path_.string(), "name the file in it");
  file_ = std::make_unique<ReadableFile>(path_);
  if (follows) writer_ = std::make_unique<LogWriterWatch>(path_);
  file_bytes_ = file_->bytes();
  const auto size = static_cast<std::size_t>(std::min<std::uint64_t>(file_bytes_, kBufferBytes));
  packed_buffer_.resize(std::clamp(size, kLeastBytes, kPackedBytes));
  buffer_.resize(std::clamp(8 * size, kLeastBytes, kBufferBytes));
  packed_end_ = read_on(packed_buffer_.data(), packed_buffer_.size());
  if (packed_end_ == 0)
    throw Error(ErrorCode::kBadInput, "is empty (0 bytes); a log was expected", path_.string(), "record again");
  packed_ = packed_end_ >= 2 && packed_buffer_[0] == '\x1f' && packed_buffer_[1] == '\x8b';
}

ByteSource::~ByteSource() {
  if (member_open_) ::inflateEnd(&inflater_);
}

void ByteSource::rewind() {
  if (member_open_) ::inflateEnd(&inflater_);
  member_open_ = ended_ = false;
  begin_ = end_ = packed_begin_ = packed_end_ = 0;
  file_bytes_read_ = position_ = 0;
  damage_ = nullptr;
  if (!file_->rewind()) {
    throw Error(ErrorCode::kBadInput, "cannot be read twice (a pipe?); a file was expected", path_.string(),
                "save it to a file first");
  }
}

std::size_t ByteSource::read_file(char* to, std::size_t count) {
  const std::size_t got = file_->read(to, count);
  file_bytes_read_ += got;
  return got;
}

// As the file grows. Whoever writes it is asked for before it is read, so that nothing is missed at its end.
std::size_t ByteSource::read_on(char* to, std::size_t count) {
  constexpr std::chrono::milliseconds kBetweenLooks{5};
  while (true) {
    const bool may_grow = writer_ && writer_->has_writer();
    const std::size_t got = read_file(to, count);
    if (got > 0 || !may_grow) return got;
    throw_if_interrupted();
    std::this_thread::sleep_for(kBetweenLooks);
  }
}

void ByteSource::inflate_into(char* to, std::size_t count, std::size_t& got) {
  const auto fail = [&](const std::string& what) {
    return Error(ErrorCode::kCorrupt, what,
                 path_.string() + " at byte " + std::to_string(file_bytes_read()) + " of the gz file", kCopyAgain);
  };
  while (got == 0) {
    if (packed_begin_ == packed_end_) {
      packed_begin_ = 0;
      packed_end_ = 0;  // should reading throw
      packed_end_ = read_on(packed_buffer_.data(), packed_buffer_.size());
      if (packed_end_ == 0) {
        if (member_open_) throw fail("the gz ends early; its checksum was expected");
        ended_ = true;
        return;
      }
    }
    if (!member_open_) {
      // Members may follow each other; tapes and some copiers pad with zeros.
      const auto first = std::find_if(packed_buffer_.begin() + static_cast<std::ptrdiff_t>(packed_begin_),
                                      packed_buffer_.begin() + static_cast<std::ptrdiff_t>(packed_end_),
                                      [](char c) { return c != 0; });
      packed_begin_ = static_cast<std::size_t>(first - packed_buffer_.begin());
      if (packed_begin_ == packed_end_) continue;
      inflater_ = {};
      if (::inflateInit2(&inflater_, kGzOnly) != Z_OK)
        throw Error(ErrorCode::kInternal, "zlib cannot start", path_.string());
      member_open_ = true;
    }
    inflater_.next_in = reinterpret_cast<Bytef*>(packed_buffer_.data() + packed_begin_);
    inflater_.avail_in = static_cast<uInt>(packed_end_ - packed_begin_);
    inflater_.next_out = reinterpret_cast<Bytef*>(to);
    inflater_.avail_out = static_cast<uInt>(count);
    const int answer = ::inflate(&inflater_, Z_NO_FLUSH);
    packed_begin_ = packed_end_ - inflater_.avail_in;
    got = count - inflater_.avail_out;
    if (answer == Z_STREAM_END) {
      ::inflateEnd(&inflater_);
      member_open_ = false;
    } else if (answer != Z_OK && answer != Z_BUF_ERROR) {
      throw fail(std::string("the gz is damaged (") + (inflater_.msg != nullptr ? inflater_.msg : "no reason given") +
                 ")");
    }
  }
}

void ByteSource::fill() {
  if (begin_ > 0) {
    std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
  }
  if (end_ == buffer_.size()) buffer_.resize(2 * buffer_.size());
  std::size_t got = 0;
  try {
    if (packed_) {
      inflate_into(buffer_.data() + end_, std::min<std::size_t>(buffer_.size() - end_, 1 << 30), got);
    } else if (packed_begin_ < packed_end_) {  // what the constructor read
      got = std::min(packed_end_ - packed_begin_, buffer_.size() - end_);
      std::memcpy(buffer_.data() + end_, packed_buffer_.data() + packed_begin_, got);
      packed_begin_ += got;
    } else {
      got = read_on(buffer_.data() + end_, buffer_.size() - end_);
      ended_ = got == 0;
    }
  } catch (const Error&) {
    damage_ = std::current_exception();
    ended_ = true;
  }
  end_ += got;
}

void ByteSource::skip(std::size_t count) {
  MAPWEAVE_EXPECT(count <= end_ - begin_, "more skipped than shown");
  begin_ += count;
  position_ += count;
}

bool ByteSource::take_slowly(char* to, std::size_t count) {
  while (count > 0) {
    const auto view = ahead(1);
    if (view.empty()) return false;
    const std::size_t some = std::min(count, view.size());
    std::memcpy(to, view.data(), some);
    skip(some);
    to += some;
    count -= some;
  }
  return true;
}

bool ByteSource::at_end() {
  if (!ahead(1).empty()) return false;
  throw_damage();
  return true;
}

std::exception_ptr ByteSource::cause_of(std::exception_ptr seen) {
  if (!packed_) return seen;
  while (!ahead(1).empty()) {
    throw_if_interrupted();
    skip(end_ - begin_);
  }
  if (!damage_ || damage_ == seen) return seen;
  try {
    std::rethrow_exception(damage_);
  } catch (const Error& damage) {
    try {
      std::rethrow_exception(seen);
    } catch (const Error& sign) {
      const std::string where = sign.where().empty() ? "" : " (" + sign.where() + ")";
      return std::make_exception_ptr(Error(damage.code(),
                                           damage.problem() + "; first seen as: " + sign.problem() + where,
                                           damage.where(), damage.remedy()));
    }
  }
}

std::string ByteSource::place(std::uint64_t position) const {
  return path_.string() + " at byte " + std::to_string(position) + (packed_ ? " of the unpacked stream" : "");
}

}  // namespace mapweave::rawlog
