#include "result_files.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>

#include <algorithm>

namespace mapweave::report {

bool ResultFiles::has(const std::string& name) const {
  std::error_code ignored;
  return std::filesystem::is_regular_file(folder_ / name, ignored);
}

Json ResultFiles::json(const std::string& name) {
  constexpr std::uint64_t kMostBytes = 1 << 28;
  if (!has(name)) {
    miss(name);
    return {};
  }
  Json result;
  attempt(name, [&] { result = Json::parse(read_file(folder_ / name, kMostBytes)); });
  return result;
}

bool ResultFiles::attempt(const std::string& name, const std::function<void()>& read) {
  try {
    read();
    return true;
  } catch (const Error& error) {  // without the folder, whose name is no matter of the page
    problems_.push_back(name + ": " + error.problem());
  } catch (const Json::exception& error) {
    problems_.push_back(name + ": it is damaged: " + error.what());
  }
  return false;
}

std::vector<std::string> ResultFiles::names_in(const std::string& name, bool folders) const {
  std::vector<std::string> names;
  std::error_code problem, ignored;
  for (std::filesystem::directory_iterator entry(folder_ / name, problem), end; !problem && entry != end;
       entry.increment(problem))
    if (folders ? entry->is_directory(ignored) : entry->is_regular_file(ignored))
      names.push_back(entry->path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace mapweave::report
