#pragma once
// The landmarks shared with a client, by number. Hundreds are looked up for each share, so that each lookup should
// touch one line of the cache.

#include <Eigen/Core>
#include <cstdint>
#include <utility>
#include <vector>

namespace mapweave::tiers {

class SharedLandmarkTable {
 public:
  struct Shared {
    std::uint64_t key = 0;  // not 0
    Eigen::Vector3d point_in_map = Eigen::Vector3d::Zero();
    float resent_m = 0.0F;     // is sent again once it lies farther off
    std::uint32_t wanted = 0;  // the share, counted, that it was in the view of last
  };

  std::size_t size() const { return size_; }
  Shared* find(std::uint64_t key) {
    if (size_ == 0) return nullptr;
    Shared& slot = slots_[place_of(key)];
    return slot.key == key ? &slot : nullptr;
  }
  // That it will be looked up soon.
  void expect(std::uint64_t key) const {
    if (size_ > 0) __builtin_prefetch(&slots_[first_place_of(key)], 1);
  }
  void set(const Shared& shared) {
    if (2 * (size_ + 1) > slots_.size())
      rebuild(slots_.empty() ? 64 : 2 * slots_.size(), [](const Shared&) { return true; });
    Shared& slot = slots_[place_of(shared.key)];
    size_ += slot.key == 0;
    slot = shared;
  }
  template <class Keeps>
  void keep(const Keeps& keeps) {
    if (size_ > 0) rebuild(slots_.size(), keeps);
  }
  void clear() {
    slots_.clear();
    size_ = 0;
  }

 private:
  // Of the key, or the free one where it would be; a power of two, half of it free.
  std::size_t place_of(std::uint64_t key) const {
    std::size_t place = first_place_of(key);
    while (slots_[place].key != 0 && slots_[place].key != key) place = (place + 1) & (slots_.size() - 1);
    return place;
  }
  std::size_t first_place_of(std::uint64_t key) const {
    return static_cast<std::size_t>((key * 0x9E3779B97F4A7C15ULL) >> 20) & (slots_.size() - 1);
  }
  template <class Keeps>
  void rebuild(std::size_t count, const Keeps& keeps) {
    const std::vector<Shared> before = std::exchange(slots_, std::vector<Shared>(count));
    size_ = 0;
    for (const Shared& shared : before)
      if (shared.key != 0 && keeps(shared)) {
        slots_[place_of(shared.key)] = shared;
        ++size_;
      }
  }

  std::vector<Shared> slots_;
  std::size_t size_ = 0;
};

}  // namespace mapweave::tiers
