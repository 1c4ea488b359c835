#include "picture_lists.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <tuple>

namespace mapweave::rawlog {
namespace {

constexpr std::size_t kMostPartners = 1000;  // of one picture within the window
constexpr double kMostSeconds = 4e9;         // as far as MRPT's stamps are ours

struct Candidate {
  std::int64_t apart_ns;
  std::size_t first, second;
};

bool is_digit(char c) { return c >= '0' && c <= '9'; }

// Plain decimals; nullopt for anything else, as 1e-3.
std::optional<std::int64_t> decimal_ns(std::string_view text) {
  std::int64_t whole = 0, part = 0;
  std::size_t at = 0;
  for (; at < text.size() && is_digit(text[at]) && at < 11; ++at) whole = 10 * whole + (text[at] - '0');
  if (at == 0 || whole > static_cast<std::int64_t>(kMostSeconds)) return std::nullopt;
  if (at < text.size() && text[at] == '.') {
    std::int64_t digit_ns = 100'000'000;
    for (++at; at < text.size() && is_digit(text[at]); ++at, digit_ns /= 10) part += (text[at] - '0') * digit_ns;
  }
  if (at != text.size()) return std::nullopt;
  return whole * 1'000'000'000 + part;
}

}  // namespace

RowReader::RowReader(const std::filesystem::path& file, const char* separators)
    : bytes_(file), lines_(bytes_, separators) {}

std::optional<Fields> RowReader::next(std::string& first) {
  while (auto fields = lines_.next()) {
    const auto text = fields->next();
    if (!text || text->front() == '#') continue;
    first = *text;
    return fields;
  }
  return std::nullopt;
}

Stamp parse_stamp(const std::string& text, StampUnit unit, const Fields& fields) {
  const char* end = text.data() + text.size();
  if (unit == StampUnit::kNanoseconds) {
    std::int64_t ns = 0;
    const auto [stop, problem] = std::from_chars(text.data(), end, ns);
    if (stop == end && problem == std::errc{} && std::abs(static_cast<double>(ns)) <= kMostSeconds * 1e9)
      return Stamp{ns};
    throw fields.error("'" + text.substr(0, 40) + "' is no stamp; whole nanoseconds were expected");
  }
  if (const auto ns = decimal_ns(text)) return Stamp{*ns};
  double seconds = 0.0;
  const auto [stop, problem] = std::from_chars(text.data(), end, seconds);
  if (stop == end && problem == std::errc{} && std::abs(seconds) <= kMostSeconds) return stamp_from_seconds(seconds);
  throw fields.error("'" + text.substr(0, 40) + "' is no stamp; seconds were expected");
}

std::filesystem::path parse_picture(Fields& fields) {
  const std::filesystem::path name = std::filesystem::path(fields.text("the name of a picture")).lexically_normal();
  const bool leads_out = name.is_absolute() || *name.begin() == ".." || name == ".";
  if (leads_out || !name.has_filename()) throw fields.error("'" + name.string() + "' is no picture in the folder");
  return name;
}

std::optional<Error> for_each_row(const std::filesystem::path& list, const char* separators,
                                  const std::function<void(const std::string&, Fields&)>& row) {
  std::size_t rows = 0;
  try {
    RowReader reader(list, separators);
    for (std::string first; auto fields = reader.next(first); ++rows) row(first, *fields);
  } catch (const Error& error) {
    if (rows == 0) throw;
    return error;
  }
  if (rows == 0)
    throw Error(ErrorCode::kBadInput, "lists nothing; at least one row was expected", list.string(),
                "record again, or copy the file again");
  return std::nullopt;
}

void expect_rising(const std::optional<Stamp>& before, Stamp stamp, const Fields& fields) {
  if (!before || *before < stamp) return;
  throw fields.error("time runs backwards or stands still: " + std::to_string(stamp.seconds()) + " s comes after " +
                     std::to_string(before->seconds()) + " s; rising stamps were expected");
}

PictureList read_picture_list(const std::filesystem::path& list, const char* separators, StampUnit unit,
                              const std::filesystem::path& prefix) {
  PictureList found;
  found.trouble = for_each_row(list, separators, [&](const std::string& first, Fields& fields) {
    const Stamp stamp = parse_stamp(first, unit, fields);
    expect_rising(found.pictures.empty() ? std::nullopt : std::optional(found.pictures.back().stamp), stamp, fields);
    found.pictures.push_back({stamp, first, prefix / parse_picture(fields)});
  });
  return found;
}

std::vector<std::pair<std::size_t, std::size_t>> pair_by_stamp(const std::vector<ListedPicture>& first,
                                                               const std::vector<ListedPicture>& second,
                                                               double window_s, const std::filesystem::path& folder) {
  const auto window_ns = std::llround(window_s * 1e9);
  std::vector<Candidate> candidates;
  std::size_t begin = 0;
  for (std::size_t i = 0; i < first.size(); ++i) {
    const std::int64_t ns = first[i].stamp.ns;
    while (begin < second.size() && second[begin].stamp.ns <= ns - window_ns) ++begin;
    for (std::size_t j = begin; j < second.size() && second[j].stamp.ns < ns + window_ns; ++j) {
      if (j - begin == kMostPartners)
        throw Error(ErrorCode::kBadInput,
                    "more than " + std::to_string(kMostPartners) + " pictures within " + std::to_string(window_s) +
                        " s of " + first[i].stamp_text + "; stamps that advance were expected",
                    folder.string(), "repair the stamps");
      candidates.push_back({std::abs(second[j].stamp.ns - ns), i, j});
    }
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return std::tie(a.apart_ns, a.first, a.second) < std::tie(b.apart_ns, b.first, b.second);
  });
  std::vector<bool> first_taken(first.size()), second_taken(second.size());
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (const Candidate& candidate : candidates) {
    if (first_taken[candidate.first] || second_taken[candidate.second]) continue;
    first_taken[candidate.first] = second_taken[candidate.second] = true;
    pairs.emplace_back(candidate.first, candidate.second);
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace mapweave::rawlog
