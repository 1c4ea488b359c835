#pragma once

#include "encoding.h"

#include <string>

namespace mapweave::report {

// Options of `yaml` whose value is not that of `defaults`: [{name: "robots.0.edge", value, default}], in the order of
// the file. An element of a list is compared with the defaults' first one. Throws Error kCorrupt for what is no YAML.
Json option_differences(const std::string& yaml, const std::string& defaults, const std::string& where);

}  // namespace mapweave::report
