#include "ros1_folder.h"

#include "../say_once.h"
#include "bag_parts.h"
#include "ros1_bag.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

namespace mapweave::rawlog::ros {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostDigits = 5;                     // of a part's number: longer ones are dates and the like
constexpr std::string_view kTime = "0000-00-00-00-00-00";  // as the recorder writes it; 0: any digit
constexpr const char* kNumbering = "`rosbag record --split` numbers parts as NAME_0.bag, NAME_1.bag";

struct NamedPart {
  fs::path path;
  std::string recording;      // the name without time and number
  std::optional<int> number;  // nullopt: no part
};

bool is_digit(char letter) { return letter >= '0' && letter <= '9'; }

bool take_end(std::string_view& text, std::string_view end) {
  if (text.size() < end.size() || text.substr(text.size() - end.size()) != end) return false;
  text.remove_suffix(end.size());
  return true;
}

void take_time(std::string_view& text) {
  if (text.size() < kTime.size()) return;
  const std::string_view end = text.substr(text.size() - kTime.size());
  for (std::size_t i = 0; i < kTime.size(); ++i)
    if (kTime[i] == '0' ? !is_digit(end[i]) : end[i] != kTime[i]) return;
  text.remove_suffix(kTime.size());
  take_end(text, "_");
}

// Nullopt for what is not named as a bag.
std::optional<NamedPart> named_part(const fs::path& path) {
  const std::string name = path.filename().string();
  std::string_view rest = name;
  if (!take_end(rest, ".active")) take_end(rest, ".gz");
  if (!take_end(rest, ".bag")) return std::nullopt;
  const std::size_t digits =
      static_cast<std::size_t>(std::find_if_not(rest.rbegin(), rest.rend(), is_digit) - rest.rbegin());
  if (digits == 0 || digits > kMostDigits || digits == rest.size() || rest[rest.size() - digits - 1] != '_')
    return NamedPart{path, name, std::nullopt};
  const int number = std::stoi(std::string(rest.substr(rest.size() - digits)));
  rest.remove_suffix(digits + 1);
  take_time(rest);
  return NamedPart{path, std::string(rest), number};
}

std::vector<NamedPart> bags_in(const fs::path& folder) {
  std::vector<NamedPart> bags;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored))
    if (auto bag = entry.is_regular_file(ignored) ? named_part(entry.path()) : std::nullopt)
      bags.push_back(std::move(*bag));
  std::sort(bags.begin(), bags.end(), [](const NamedPart& a, const NamedPart& b) {
    return std::tie(a.number, a.path) < std::tie(b.number, b.path);
  });
  return bags;
}

std::string quoted(const NamedPart& part) { return "'" + part.path.filename().string() + "'"; }

void expect_one_recording(const fs::path& folder, const std::vector<NamedPart>& bags) {
  if (bags.size() < 2) return;
  for (std::size_t i = 0; i < bags.size(); ++i) {
    const NamedPart& here = bags[i];
    const NamedPart& other = bags[i == 0 ? 1 : i - 1];
    std::string what;
    if (!here.number)
      what = quoted(here) + " is no part of the recording of " + quoted(other);
    else if (here.recording != other.recording)
      what = quoted(other) + " and " + quoted(here) + " are of two recordings";
    else if (i > 0 && here.number == other.number)
      what = quoted(other) + " and " + quoted(here) + " are both part " + std::to_string(*here.number);
    if (!what.empty())
      throw Error(
          ErrorCode::kBadInput, "holds " + std::to_string(bags.size()) + " bags that are not of one recording: " + what,
          folder.string(), std::string("name one of the bags, or leave the parts of one in the folder; ") + kNumbering);
  }
}

std::string numbers_text(int first, int last) {
  return first == last ? "part " + std::to_string(first) + " of the recording is"
                       : "parts " + std::to_string(first) + " to " + std::to_string(last) + " of the recording are";
}

// Opens them in order; what is missing has a path of its own that no file has.
class Parts {
 public:
  Parts(const fs::path& folder, const std::vector<NamedPart>& bags) : folder_(folder) {
    for (std::size_t i = 0; i < bags.size(); ++i) {
      if (i > 0 && *bags[i].number != *bags[i - 1].number + 1) add_gap(bags[i - 1], bags[i]);
      paths_.push_back(bags[i].path);
    }
    if (bags.size() > 1 && *bags.front().number > 0)
      say_once(folder.string() + ": " + numbers_text(0, *bags.front().number - 1) +
               " missing, as with --max-splits; it is read from " + quoted(bags.front()) + " on");
  }

  const std::vector<fs::path>& paths() const { return paths_; }

  OpenedPart open(const fs::path& part, std::uint64_t most_bytes) const {
    if (const auto gap = gaps_.find(part); gap != gaps_.end())
      throw Error(ErrorCode::kMissing, gap->second, folder_.string(),
                  "copy it there, map what precedes it with --keep-going, or number the parts after it anew to read "
                  "the recording with the gap");
    return {nullptr, open_ros1_bag(part, most_bytes)};
  }

 private:
  void add_gap(const NamedPart& before, const NamedPart& after) {
    const std::string what = numbers_text(*before.number + 1, *after.number - 1) + " missing: " + quoted(after) +
                             " follows " + quoted(before);
    paths_.push_back(before.path / "next");
    gaps_[paths_.back()] = what;
    say_once(folder_.string() + ": " + what);
  }

  fs::path folder_;
  std::vector<fs::path> paths_;
  std::map<fs::path, std::string> gaps_;
};

}  // namespace

bool holds_ros1_bags(const fs::path& folder) {
  std::error_code ignored;
  return fs::is_directory(folder, ignored) && !bags_in(folder).empty();
}

std::unique_ptr<BagReader> open_ros1_folder(const fs::path& folder, std::uint64_t most_bytes) {
  const auto bags = bags_in(folder);
  expect_one_recording(folder, bags);
  Parts parts(folder, bags);
  const auto paths = parts.paths();
  return open_bag_parts(
      {paths,
       {},
       [parts = std::move(parts), most_bytes](const fs::path& part) { return parts.open(part, most_bytes); },
       [](const fs::path& part) -> std::string {
         return part.extension() == ".gz" ? " at unpacked byte " : " at byte ";
       }});
}

}  // namespace mapweave::rawlog::ros
