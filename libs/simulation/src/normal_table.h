#pragma once
// Normal numbers to be looked up by 12 random bits: five for each number of a stream. Mean 0 and standard deviation 1
// exactly.

#include <mapweave/simulation/random.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace mapweave::simulation {

class NormalTable {
 public:
  static constexpr std::size_t kSize = 4096;
  NormalTable() {
    RandomNumbers numbers(0x6e6f726d616cu);
    double sum = 0.0, squares = 0.0;
    std::array<double, kSize> drawn;
    for (double& number : drawn) {
      number = numbers.normal();
      sum += number;
    }
    for (double& number : drawn) {
      number -= sum / kSize;
      squares += number * number;
    }
    for (std::size_t i = 0; i < kSize; ++i) values_[i] = static_cast<float>(drawn[i] / std::sqrt(squares / kSize));
  }
  float operator[](std::size_t i) const { return values_[i]; }
  void fill(RandomNumbers numbers, float* out, int count) const {
    for (int i = 0; i < count;) {
      std::uint64_t bits = numbers.bits();
      for (const int end = std::min(count, i + 5); i < end; ++i, bits >>= 12) out[i] = values_[bits & (kSize - 1)];
    }
  }

 private:
  std::array<float, kSize> values_;
};

}  // namespace mapweave::simulation
