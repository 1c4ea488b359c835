#pragma once
// Random numbers that are looked up, not drawn: a number is a pure function of (seed, purpose, owner, index, position),
// so no result depends on threads, on the order of robots, or on how many numbers something else has used. The
// distributions are our own, since those of the standard library differ between its makers.

#include <mapweave/core/mixed_bits.h>

#include <cmath>
#include <cstdint>
#include <string_view>

namespace mapweave::simulation {

// The numbers of one thing at one instant (one scan, one step, one building), in order of use.
class RandomNumbers {
 public:
  explicit RandomNumbers(std::uint64_t key) : state_(key) {}
  std::uint64_t bits() { return mixed(state_ += 0x9e3779b97f4a7c15u); }
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }  // [0, 1)
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  int integer(int low, int high) {  // both ends included
    return low + static_cast<int>(uniform() * (static_cast<double>(high) - low + 1.0));
  }
  bool chance(double probability) { return uniform() < probability; }
  double normal() {  // mean 0, standard deviation 1: Marsaglia's polar method, which gives two at a time
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    double u, v, square;
    do {
      u = uniform(-1.0, 1.0);
      v = uniform(-1.0, 1.0);
      square = u * u + v * v;
    } while (square >= 1.0 || square == 0.0);
    const double factor = std::sqrt(-2.0 * std::log(square) / square);
    spare_ = v * factor;
    has_spare_ = true;
    return u * factor;
  }

 private:
  std::uint64_t state_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

// What something is random about ("laser", "odometry", "tour"), for one owner (a robot's name; empty: the world).
class RandomStream {
 public:
  RandomStream(std::uint64_t seed, std::string_view purpose, std::string_view owner = {})
      : key_(mixed(mixed(mixed(seed + 0x9e3779b97f4a7c15u) ^ letters(purpose)) ^ letters(owner))) {}
  RandomNumbers at(std::uint64_t index) const {
    return RandomNumbers(mixed(key_ ^ mixed(index + 0x632be59bd9b4e019u)));
  }

 private:
  static std::uint64_t letters(std::string_view text) {  // FNV-1a
    std::uint64_t hash = 0xcbf29ce484222325u;
    for (const char letter : text) hash = (hash ^ static_cast<unsigned char>(letter)) * 0x100000001b3u;
    return hash;
  }
  std::uint64_t key_;
};

}  // namespace mapweave::simulation
