#pragma once
// Where a camera map server puts what it keeps but does not want to hold in memory.

#include <cstdint>
#include <string>
#include <string_view>

namespace mapweave::tiers {

// Thread-safe. What lies on it is as good as in memory: it need not outlive the process.
class Shelf {
 public:
  virtual ~Shelf() = default;
  // A number to get it again by. Throws Error(kCannotWrite), with the free space when the disk is full; nothing is kept
  // of it then.
  virtual std::uint64_t put(std::string_view bytes) = 0;
  // Throws Error(kCorrupt) for what is not there any more.
  virtual std::string get(std::uint64_t number) const = 0;
};

}  // namespace mapweave::tiers
