#include <mapweave/core/error.h>
#include <mapweave/core/stamp.h>

#include <cmath>

namespace mapweave {

Stamp stamp_from_seconds(double seconds) {
  MAPWEAVE_EXPECT(std::abs(seconds) <= 9e9,
                  "a stamp must be finite and within +-9e9 s, but is " + std::to_string(seconds));
  // Whole seconds apart, so that the product with 1e9 does not lose the last digits that the argument has.
  const double whole = std::floor(seconds);
  return {static_cast<std::int64_t>(whole) * 1'000'000'000 + std::llround((seconds - whole) * 1e9)};
}

}  // namespace mapweave
