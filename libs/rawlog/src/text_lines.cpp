#include "text_lines.h"

#include <mapweave/core/log.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <system_error>
#include <utility>

namespace mapweave::rawlog {
namespace {

constexpr std::size_t kFirstLook = 1 << 14, kLongestLine = 1 << 24;

// For a message: a NUL would end it.
std::string quoted(std::string_view field) {
  std::string text(field.substr(0, 40));
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return "'" + text + "'";
}

}  // namespace

std::optional<std::string_view> Fields::next() {
  const auto begin = rest_.find_first_not_of(separators_);
  if (begin == std::string_view::npos) return std::nullopt;
  rest_.remove_prefix(begin);
  const auto field = rest_.substr(0, rest_.find_first_of(separators_));
  rest_.remove_prefix(field.size());
  return field;
}

std::string_view Fields::text(const char* name) {
  const auto field = next();
  if (field) return *field;
  if (!terminated_)
    throw Error(ErrorCode::kCorrupt, std::string("the file ends within this line; ") + name + " was expected", place_,
                "copy the log again, or remove the line");
  throw error(std::string("the line ends early; ") + name + " was expected");
}

double Fields::any_number(const char* name) {
  const auto field = text(name);
  double value = 0.0;
  const auto [end, problem] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (end != field.data() + field.size() || (problem != std::errc{} && problem != std::errc::result_out_of_range)) {
    throw error(quoted(field) + " is no number; " + name + " was expected");
  }
  // Out of range is what is too large, infinite here, or too small, and then zero.
  if (problem == std::errc::result_out_of_range) value = std::strtod(std::string(field).c_str(), nullptr);
  return value;
}

double Fields::number(const char* name) {
  const double value = any_number(name);
  if (!std::isfinite(value)) throw error(std::string(name) + " is not finite; a finite number was expected");
  return value;
}

std::size_t Fields::count(const char* name, std::size_t most) {
  const double value = number(name);
  if (value < 0 || value > static_cast<double>(most) || value != std::floor(value)) {
    throw error(std::string(name) + " is out of its range; a whole number in 0.." + std::to_string(most) +
                " was expected");
  }
  return static_cast<std::size_t>(value);
}

void Fields::expect_end(const char* what) {
  if (const auto more = next()) {
    throw error(quoted(*more) + " follows where " + what +
                " should end; does the number of readings announced fit the line?");
  }
}

Error Fields::error(const std::string& what) const {
  return Error(ErrorCode::kBadInput, what, place_, "correct or remove the line");
}

std::optional<Fields> LineReader::next() {
  bytes_.skip(taken_);
  taken_ = 0;
  std::size_t look = kFirstLook, searched = 0;
  for (;;) {
    const auto view = bytes_.ahead(look);
    const auto end = view.find('\n', searched);
    if (end != std::string_view::npos || view.size() < look) {
      if (end == std::string_view::npos) bytes_.throw_damage();
      if (view.empty()) return std::nullopt;
      const auto line = view.substr(0, end);
      taken_ = line.size() + (end != std::string_view::npos ? 1 : 0);
      ++line_;
      return Fields(line, place(line_), end != std::string_view::npos, separators_);
    }
    searched = view.size();
    look = 2 * view.size();
    if (look > kLongestLine) {
      throw Error(ErrorCode::kCorrupt,
                  "the line is longer than " + std::to_string(kLongestLine) + " bytes; a text log was expected",
                  place(line_ + 1), "check that the file is what its name says");
    }
  }
}

void DamagedLines::look_at(std::string_view keyword, std::uint64_t line) {
  const auto is_capital = [](char c) {
    return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == ':';
  };
  if (keyword.front() == '#' || std::all_of(keyword.begin(), keyword.end(), is_capital)) return;
  if (count_++ == 0) first_ = line;
}

void DamagedLines::report(const LineReader& lines) {
  if (const std::uint64_t count = std::exchange(count_, 0); count > 0)
    log(LogLevel::warning,
        lines.place(first_) + ": " +
            (count == 1 ? "a line is damaged and is left out"
                        : "the first of " + std::to_string(count) + " lines that are damaged and are left out"));
}

}  // namespace mapweave::rawlog
