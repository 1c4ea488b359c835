#pragma once
// A sorted, flat table: iterates in key order, so everything that walks a map is deterministic.

#include <algorithm>
#include <utility>
#include <vector>

namespace mapweave {

template <class Key, class Value>
class Table {
 public:
  using Entry = std::pair<Key, Value>;
  using const_iterator = typename std::vector<Entry>::const_iterator;
  using iterator = typename std::vector<Entry>::iterator;

  // Keys that come in order cost O(1), others O(size). An existing key's value is replaced.
  void set(Key key, Value value) {
    if (entries_.empty() || entries_.back().first < key) {
      entries_.emplace_back(std::move(key), std::move(value));
      return;
    }
    auto place = lower(key);
    if (place != entries_.end() && !(key < place->first))
      place->second = std::move(value);
    else
      entries_.insert(place, Entry(std::move(key), std::move(value)));
  }
  const Value* find(const Key& key) const {
    const auto place = std::lower_bound(entries_.begin(), entries_.end(), key, [](const Entry& e, const Key& k) { return e.first < k; });
    return place != entries_.end() && !(key < place->first) ? &place->second : nullptr;
  }
  Value* find(const Key& key) { return const_cast<Value*>(static_cast<const Table&>(*this).find(key)); }
  bool erase(const Key& key) {
    const auto place = lower(key);
    if (place == entries_.end() || key < place->first) return false;
    entries_.erase(place);
    return true;
  }
  bool contains(const Key& key) const { return find(key) != nullptr; }
  std::size_t size() const { return entries_.size(); }
  bool empty() const { return entries_.empty(); }
  void reserve(std::size_t count) { entries_.reserve(count); }
  const_iterator begin() const { return entries_.begin(); }
  const_iterator end() const { return entries_.end(); }
  iterator begin() { return entries_.begin(); }  // keys must not be changed
  iterator end() { return entries_.end(); }
  const Entry& front() const { return entries_.front(); }
  const Entry& back() const { return entries_.back(); }

 private:
  iterator lower(const Key& key) {
    return std::lower_bound(entries_.begin(), entries_.end(), key, [](const Entry& e, const Key& k) { return e.first < k; });
  }
  std::vector<Entry> entries_;
};

}  // namespace mapweave
