#include <mapweave/runtime/results_page.h>

#include <mapweave/core/options.h>
#include <mapweave/report/report_page.h>
#include <mapweave/runtime/run_configuration.h>

namespace mapweave::runtime {

std::string results_page(const std::filesystem::path& results, const std::filesystem::path& reference) {
  RunConfiguration defaults;
  defaults.robots.resize(1);
  defaults.edges.resize(1);
  defaults.network.links.resize(1);
  return report::report_page(results, {to_yaml(defaults), reference});
}

}  // namespace mapweave::runtime
