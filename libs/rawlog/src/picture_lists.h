#pragma once
// Lists of stamps and pictures, and which pictures belong together.

#include "byte_source.h"
#include "text_lines.h"

#include <mapweave/core/stamp.h>

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace mapweave::rawlog {

enum class StampUnit { kSeconds, kNanoseconds };
constexpr const char* kBlankSeparated = " \t\r";
constexpr const char* kCommaSeparated = ", \t\r";

// The rows of a text file one by one; blank ones and comments (#) are passed over.
class RowReader {
 public:
  RowReader(const std::filesystem::path& file, const char* separators);  // throws Error kMissing, kBadInput
  // The fields after the row's first, which `first` becomes. nullopt at the clean end.
  std::optional<Fields> next(std::string& first);
  std::uint64_t line() const { return lines_.line(); }
  const ByteSource& bytes() const { return bytes_; }

 private:
  ByteSource bytes_;
  LineReader lines_;
};

// A stamp as text to the nanosecond, which a double of seconds since 1970 does not hold. Throws Error kBadInput with
// file and line.
Stamp parse_stamp(const std::string& text, StampUnit unit, const Fields& fields);
// A picture's name; throws Error kBadInput for one that leads out of the folder.
std::filesystem::path parse_picture(Fields& fields);

struct ListedPicture {
  Stamp stamp;
  std::string stamp_text;
  std::filesystem::path file;
};
struct PictureList {
  std::vector<ListedPicture> pictures;
  std::optional<Error> trouble;  // ended the list
};

// Rows of a stamp and a picture in `prefix`. Throws Error for a list without pictures.
PictureList read_picture_list(const std::filesystem::path& list, const char* separators, StampUnit unit,
                              const std::filesystem::path& prefix = {});

// Calls `row(text, fields)` for each row. What is wrong with one ends the list: answered, or thrown where no row came
// before.
std::optional<Error> for_each_row(const std::filesystem::path& list, const char* separators,
                                  const std::function<void(const std::string& first, Fields& fields)>& row);
// Throws Error kBadInput for a stamp that does not come after `before`.
void expect_rising(const std::optional<Stamp>& before, Stamp stamp, const Fields& fields);

// One-to-one, nearest first, of those less than `window_s` apart; by the first index. Stamps rise in both. Throws Error
// kBadInput for stamps that stand still.
std::vector<std::pair<std::size_t, std::size_t>> pair_by_stamp(const std::vector<ListedPicture>& first,
                                                               const std::vector<ListedPicture>& second,
                                                               double window_s, const std::filesystem::path& folder);

}  // namespace mapweave::rawlog
