#pragma once
// Options by what they are about.

#include <mapweave/core/options.h>

#include <string>
#include <vector>

namespace mapweave {

std::string found_in_fields(const OptionFields&, std::vector<std::string> words);  // untyped form

// The options whose key or meaning holds all of `words`, in any case: "section.key: value", meaning and range below it.
// Empty where there is none.
template <class Options>
std::string found_options(Options options, std::vector<std::string> words) {
  return found_in_fields(fields_of(options), std::move(words));
}

}  // namespace mapweave
