#include "number_lines.h"

#include <mapweave/core/error.h>

#include <charconv>
#include <cmath>
#include <optional>
#include <utility>

namespace mapweave::evaluation {
namespace {

constexpr double kLastStampS = 9e9;  // the contract of stamp_from_seconds

std::vector<std::string_view> words(std::string_view line) {
  constexpr std::string_view kBlank = " \t\r\v\f";
  std::vector<std::string_view> found;
  for (std::size_t begin = line.find_first_not_of(kBlank); begin != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(kBlank, begin), line.size());
    found.push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(kBlank, end);
  }
  return found;
}

std::string quoted(std::string_view word) {
  std::string shown = "'";
  for (const char c : word.substr(0, 40)) shown += c >= ' ' && c <= '~' ? c : '?';
  return shown + (word.size() > 40 ? "...'" : "'");
}

std::optional<double> parse_double(std::string_view word) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size()) return std::nullopt;
  return value;
}

// "1305031102.175304" to the nanosecond: a double has only 0.2 microseconds to give there.
std::optional<Stamp> parse_decimal_stamp(std::string_view word) {
  const bool negative = !word.empty() && word.front() == '-';
  if (negative) word.remove_prefix(1);
  const std::size_t point = std::min(word.find('.'), word.size());
  const std::string_view whole = word.substr(0, point);
  const std::string_view fraction = point < word.size() ? word.substr(point + 1) : std::string_view{};
  if (whole.empty() || whole.size() > 10 || fraction.size() > 9) return std::nullopt;
  std::int64_t ns = 0;
  for (std::size_t i = 0; i < whole.size() + 9; ++i) {
    const char c = i < whole.size() ? whole[i] : i - whole.size() < fraction.size() ? fraction[i - whole.size()] : '0';
    if (c < '0' || c > '9') return std::nullopt;
    if (i == 0 && whole.size() == 10 && c == '9') return std::nullopt;  // near the end of 64 bits
    ns = ns * 10 + (c - '0');
  }
  return Stamp{negative ? -ns : ns};
}

}  // namespace

NumberLines::NumberLines(std::string_view text, std::string where, std::string format)
    : rest_(text), where_(std::move(where)), format_(std::move(format)), columns_(words(format_).size()) {}

std::size_t NumberLines::columns_of(std::string_view line) { return words(line).size(); }

bool NumberLines::next() {
  while (!rest_.empty()) {
    const std::size_t end = std::min(rest_.find('\n'), rest_.size());
    const std::string_view line = rest_.substr(0, end);
    rest_.remove_prefix(std::min(end + 1, rest_.size()));
    ++line_;
    fields_ = words(line.substr(0, std::min(line.find('#'), line.size())));
    if (fields_.empty()) continue;
    if (fields_.size() != columns_)
      fail("a line has " + std::to_string(columns_) + " numbers (" + format_ + "), this one has " +
           std::to_string(fields_.size()) + (rest_.empty() ? " and is the last: the file is cut short" : ""));
    return true;
  }
  return false;
}

double NumberLines::number(std::size_t column) const {
  const auto value = parse_double(fields_[column]);
  if (!value) fail(quoted(fields_[column]) + " in column " + std::to_string(column + 1) + " is not a number");
  if (!std::isfinite(*value))
    fail(quoted(fields_[column]) + " in column " + std::to_string(column + 1) + " is not finite");
  return *value;
}

Stamp NumberLines::stamp(std::size_t column) const {
  if (const auto exact = parse_decimal_stamp(fields_[column])) return *exact;
  const double seconds = number(column);
  if (std::abs(seconds) > kLastStampS)
    fail("the stamp " + quoted(fields_[column]) + " is no time in seconds",
         "give stamps in seconds, not in nanoseconds");
  return stamp_from_seconds(seconds);
}

Stamp NumberLines::nanoseconds(std::size_t column) const {
  const std::string_view word = fields_[column];
  std::int64_t ns = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), ns);
  if (error != std::errc{} || end != word.data() + word.size() || std::abs(static_cast<double>(ns)) > kLastStampS * 1e9)
    fail("the stamp " + quoted(word) + " is no time in nanoseconds", "EuRoC's csv has whole nanoseconds first");
  return Stamp{ns};
}

void NumberLines::fail(const std::string& what, const std::string& remedy) const {
  throw Error(ErrorCode::kBadInput, what, where_ + ":" + std::to_string(line_), remedy);
}

Eigen::Quaterniond unit_quaternion(const Eigen::Quaterniond& q, const NumberLines& lines, const std::string& remedy) {
  constexpr double kUnitTolerance = 0.01;
  const double length = q.norm();
  if (!(std::abs(length - 1.0) <= kUnitTolerance))
    lines.fail("the quaternion's length is " + std::to_string(length) + " and must be 1", remedy);
  return q.normalized();
}

}  // namespace mapweave::evaluation
