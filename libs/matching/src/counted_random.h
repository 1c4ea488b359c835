#pragma once
// Random numbers by counter: a pure function of the key, so that no draw depends on what else was drawn, nor on
// threads.

#include <mapweave/core/mixed_bits.h>

#include <cstdint>

namespace mapweave::matching {

class CountedRandom {
 public:
  CountedRandom(std::uint64_t seed, std::uint64_t stream) : state_(mixed(mixed(seed + 0x9e3779b97f4a7c15u) ^ stream)) {}
  std::uint64_t bits() { return mixed(state_ += 0x9e3779b97f4a7c15u); }
  // 0 .. count - 1; the bias, count / 2^64, is of no account.
  std::uint64_t below(std::uint64_t count) { return bits() % count; }

 private:
  std::uint64_t state_;
};

}  // namespace mapweave::matching
