#pragma once

#include <mapweave/core/error.h>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace mapweave {

// The upper of the two middle ones of an even count. Contract: not empty.
template <class Value>
Value median(std::vector<Value> values) {
  MAPWEAVE_EXPECT(!values.empty(), "no values, no median");
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

inline constexpr double kMedianOfNormal = 0.6745;  // of |x| where x is standard normal

}  // namespace mapweave
