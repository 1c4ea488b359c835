#pragma once
// Lines of a text log and the fields in them. Numbers are read without regard to the locale.

#include "byte_source.h"

#include <mapweave/core/error.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace mapweave::rawlog {

// Fields of one line, between blanks or other separators. What is wrong is thrown as Error kBadInput with file and
// line.
class Fields {
 public:
  Fields(std::string_view text, std::string place, bool terminated, const char* separators = " \t\r")
      : rest_(text), place_(std::move(place)), terminated_(terminated), separators_(separators) {}
  std::optional<std::string_view> next();   // nullopt at the end of the line
  std::string_view text(const char* name);  // throws at the end of the line
  double any_number(const char* name);      // infinite and NaN too
  double number(const char* name);          // finite
  std::size_t count(const char* name, std::size_t most);
  void expect_end(const char* what);               // throws where more follows
  bool terminated() const { return terminated_; }  // by a line break; else the last field may have lost its end
  Error error(const std::string& what) const;
  const std::string& place() const { return place_; }

 private:
  std::string_view rest_;
  std::string place_;
  bool terminated_;
  const char* separators_;
};

class LineReader {
 public:
  explicit LineReader(ByteSource& bytes, const char* separators = " \t\r") : bytes_(bytes), separators_(separators) {}
  // The next line's fields, valid until the next call; nullopt at the clean end. Throws Error kCorrupt.
  std::optional<Fields> next();
  std::uint64_t line() const { return line_; }  // of the last answer, from 1
  std::string place(std::uint64_t line) const { return bytes_.path().string() + ":" + std::to_string(line); }

 private:
  ByteSource& bytes_;
  const char* separators_;
  std::uint64_t line_ = 0;
  std::size_t taken_ = 0;  // bytes of the last answer
};

// Lines of a text log that are none of its messages: no word of capital letters stands first (VERTEX_SE3:QUAT), nor a
// comment's '#'.
class DamagedLines {
 public:
  void look_at(std::string_view keyword, std::uint64_t line);
  // Says once how many there were.
  void report(const LineReader& lines);

 private:
  std::uint64_t count_ = 0, first_ = 0;
};

// Calls what(keyword) with the first field of each line of `start`, until it answers true; whether it did.
template <class Function>
bool any_line(std::string_view start, Function&& what) {
  while (!start.empty()) {
    const auto line = start.substr(0, start.find('\n'));
    if (what(line.substr(0, line.find_first_of(" \t\r")), line)) return true;
    start.remove_prefix(std::min(start.size(), line.size() + 1));
  }
  return false;
}

}  // namespace mapweave::rawlog
