#include <mapweave/evaluation/statistics.h>

#include <algorithm>
#include <cmath>

namespace mapweave::evaluation {

Statistics statistics_of(std::vector<double> errors) {
  Statistics result;
  result.count = errors.size();
  if (errors.empty()) return result;
  std::sort(errors.begin(), errors.end());
  const double count = static_cast<double>(errors.size());
  for (const double error : errors) {
    result.mean += error / count;
    result.sse += error * error;
  }
  for (const double error : errors) result.std += (error - result.mean) * (error - result.mean) / count;
  result.std = std::sqrt(result.std);
  result.rmse = std::sqrt(result.sse / count);
  result.median = 0.5 * (errors[(errors.size() - 1) / 2] + errors[errors.size() / 2]);
  result.min = errors.front();
  result.max = errors.back();
  return result;
}

}  // namespace mapweave::evaluation
