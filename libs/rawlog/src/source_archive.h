#pragma once
// What MRPT reads objects from: the bytes of a log, counted and limited.

#include "byte_source.h"

#include <mapweave/core/error.h>
#include <mrpt/serialization/CArchive.h>

#include <exception>
#include <string>

namespace mapweave::rawlog {

// MRPT ignores short reads in places and rewrites exceptions in others. So a short read throws, and what was thrown is
// kept.
class SourceArchive final : public mrpt::serialization::CArchive {
 public:
  explicit SourceArchive(ByteSource& source) : source_(source) {}
  void start_object(std::uint64_t most_bytes) {
    most_ = source_.position() + most_bytes;
    failure_ = nullptr;
  }
  void rethrow_failure() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 protected:
  std::size_t read(void* to, std::size_t count) override {
    try {
      if (count > most_ - source_.position()) {
        throw Error(ErrorCode::kCorrupt, "an object is larger than any may be", source_.place(source_.position()),
                    "record again, or raise max_object_mb if it is meant to be that large");
      }
      if (!source_.take(static_cast<char*>(to), count)) {
        source_.throw_damage();
        throw Error(ErrorCode::kCorrupt,
                    "is cut short inside an object; " + std::to_string(count) + " more bytes were expected",
                    source_.place(source_.position()), "record or copy the log again");
      }
    } catch (const Error&) {
      failure_ = std::current_exception();
      throw;
    }
    return count;
  }
  std::size_t write(const void*, std::size_t) override {
    throw Error(ErrorCode::kInternal, "a log that is read cannot be written");
  }

 private:
  ByteSource& source_;
  std::uint64_t most_ = 0;
  std::exception_ptr failure_;
};

}  // namespace mapweave::rawlog
