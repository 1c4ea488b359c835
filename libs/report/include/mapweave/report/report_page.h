#pragma once
// One page that shows a folder of results: maps, pairs, times, options. A single HTML file that loads nothing.

#include <cstddef>
#include <filesystem>
#include <string>

namespace mapweave::report {

// What the folder itself does not hold.
struct PageContext {
  std::string default_options;      // YAML with every option's default; lists with one element. Empty: none is known
  std::filesystem::path reference;  // true trajectories: a TUM file, or a folder of them by robot; empty: none
};

// The page without its pictures stays below this, however large the run.
constexpr std::size_t kMostPageBytes = 2'000'000;

// Of a folder of results of `run`, `slam` or `merge`, of any version, whole or not: files that are missing or damaged
// are named on the page. Equal folders give equal pages; nothing in it depends on the folder's name or on clocks. Texts
// of the folder are never executed. Throws Error: kMissing where there is no folder of results, or no reference;
// kUsage for one reference file of several robots.
std::string report_page(const std::filesystem::path& results, const PageContext&);

}  // namespace mapweave::report
