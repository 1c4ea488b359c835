#pragma once

#include <cstddef>
#include <vector>

namespace mapweave::evaluation {

// Of some errors, in their unit; `sse` in its square. All zero where count is 0.
struct Statistics {
  std::size_t count = 0;
  double mean = 0.0, std = 0.0;  // std: of the population, divided by count (as numpy and evo)
  double median = 0.0;           // mean of the two middle ones of an even count
  double rmse = 0.0, sse = 0.0, min = 0.0, max = 0.0;
};

Statistics statistics_of(std::vector<double> errors);

}  // namespace mapweave::evaluation
