#pragma once
// Binary descriptors of 256 bits, as OpenCV's ORB makes them.

#include <array>
#include <cstddef>
#include <cstdint>

namespace mapweave::matching {

// Byte i of OpenCV's row is bits 8 (i % 8) .. 8 (i % 8) + 7 of word i / 8, on every machine.
using OrbDescriptor = std::array<std::uint64_t, 4>;

inline OrbDescriptor descriptor_of_bytes(const std::uint8_t* bytes) {
  OrbDescriptor descriptor{};
  for (std::size_t i = 0; i < 32; ++i) descriptor[i / 8] |= static_cast<std::uint64_t>(bytes[i]) << (8 * (i % 8));
  return descriptor;
}
inline std::uint8_t byte_of(const OrbDescriptor& descriptor, std::size_t i) {
  return static_cast<std::uint8_t>(descriptor[i / 8] >> (8 * (i % 8)));
}

// Bits that differ, 0..256.
inline int hamming(const OrbDescriptor& a, const OrbDescriptor& b) {
  return __builtin_popcountll(a[0] ^ b[0]) + __builtin_popcountll(a[1] ^ b[1]) + __builtin_popcountll(a[2] ^ b[2]) +
         __builtin_popcountll(a[3] ^ b[3]);
}

struct NearestDescriptors {
  std::uint32_t first = 0;    // index of the nearest; of equals the lowest
  int distance = 257;         // to it; 257 where there is none
  int second_distance = 257;  // to the nearest of the others
};
NearestDescriptors nearest_descriptors(const OrbDescriptor& query, const OrbDescriptor* among, std::size_t count);
// The same among those that `chosen` names; `first` is a place in `chosen`.
NearestDescriptors nearest_descriptors(const OrbDescriptor& query, const OrbDescriptor* among,
                                       const std::uint32_t* chosen, std::size_t count);

}  // namespace mapweave::matching
