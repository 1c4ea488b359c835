// Logs of lasers as text: CARMEN and g2o.

#include "logs.h"

#include <support/data.h>

namespace mapweave::fuzz {
namespace {

Kind log_named(const std::string& input, const std::vector<std::string>& sound) {
  Kind kind{[input](std::string_view bytes) { read_log(scratch_file(input, bytes)); }, {}};
  for (const std::string& name : sound) kind.seeds.push_back(file_bytes(test::own_data(name)));
  return kind;
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = {log_named("input.log", {"carmen_new.log", "carmen_old.log"}),
                                        log_named("input.g2o", {"g2o_scans.g2o"})};
  return all;
}

}  // namespace

std::vector<std::string> seeds() { return seeds_of(kinds()); }
void decode(std::string_view bytes) { decode_one_of(kinds(), bytes); }

}  // namespace mapweave::fuzz
