#pragma once
// report.html: one page that shows a folder of results.

#include <filesystem>
#include <string>

namespace mapweave::runtime {

// Options are compared with this program's defaults. `reference`: true trajectories, a TUM file or a folder of
// <robot>.tum; may be empty. Throws what report::report_page() throws.
std::string results_page(const std::filesystem::path& results, const std::filesystem::path& reference);

}  // namespace mapweave::runtime
