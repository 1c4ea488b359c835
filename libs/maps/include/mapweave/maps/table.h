#pragma once
// A sorted, flat table: iterates in key order, so everything that walks a map is deterministic.

#include <algorithm>
#include <iterator>
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
    const auto place = std::lower_bound(entries_.begin(), entries_.end(), key,
                                        [](const Entry& e, const Key& k) { return e.first < k; });
    return place != entries_.end() && !(key < place->first) ? &place->second : nullptr;
  }
  Value* find(const Key& key) { return const_cast<Value*>(static_cast<const Table&>(*this).find(key)); }
  bool erase(const Key& key) {
    const auto place = lower(key);
    if (place == entries_.end() || key < place->first) return false;
    entries_.erase(place);
    return true;
  }
  // As set() for each of the entries, which come in ascending order, no key twice: what lies behind the first new key
  // moves once, else nothing does.
  void set_all(std::vector<Entry> entries) {
    auto fresh = entries.begin();
    for (Entry& entry : entries) {
      if (Value* known = find(entry.first)) {
        *known = std::move(entry.second);
      } else {
        if (&*fresh != &entry) *fresh = std::move(entry);
        ++fresh;
      }
    }
    if (fresh == entries.begin()) return;
    const auto begin = lower(entries.front().first) - entries_.begin(), middle = entries_.end() - entries_.begin();
    entries_.insert(entries_.end(), std::make_move_iterator(entries.begin()), std::make_move_iterator(fresh));
    std::inplace_merge(entries_.begin() + begin, entries_.begin() + middle, entries_.end(),
                       [](const Entry& a, const Entry& b) { return a.first < b.first; });
  }
  // As erase() for each of the keys, which come in ascending order: what lies behind the first moves once.
  void erase_all(const std::vector<Key>& keys) {
    if (keys.empty()) return;
    auto to = lower(keys.front()), from = to;
    const auto keep_up_to = [&](iterator place) {
      to = to == from ? place : std::move(from, place, to);
      from = place;
    };
    for (const Key& key : keys) {
      keep_up_to(lower(key, from));
      if (from != entries_.end() && !(key < from->first)) ++from;
    }
    keep_up_to(entries_.end());
    entries_.erase(to, entries_.end());
  }
  // For so many new keys: set() and set_all() take no memory for them then.
  void make_room(std::size_t count) {
    if (entries_.capacity() - entries_.size() < count)
      entries_.reserve(entries_.size() + std::max(count, entries_.size()));
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
  iterator lower(const Key& key) { return lower(key, entries_.begin()); }
  iterator lower(const Key& key, iterator from) {
    return std::lower_bound(from, entries_.end(), key, [](const Entry& e, const Key& k) { return e.first < k; });
  }
  std::vector<Entry> entries_;
};

}  // namespace mapweave
