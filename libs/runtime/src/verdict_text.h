#pragma once
// How sure a verdict is, in words: the same on the console and in an explanation.

#include <mapweave/core/format.h>

namespace mapweave::runtime {

inline std::string numbers_in_words(double probability, double overlap, double conflict) {
  return format("probability %.2f, overlap %.0f %%, conflict %.1f %%", probability, 100.0 * overlap, 100.0 * conflict);
}

}  // namespace mapweave::runtime
