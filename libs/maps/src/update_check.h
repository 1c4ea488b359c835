#pragma once

#include <mapweave/maps/map_update.h>

#include <algorithm>

namespace mapweave {

// Whether an update fits a map: throws what updated() throws where it does not. Answers the landmarks that stay as they
// are but for sightings that removed nodes take along; one may come more than once. known: null, or of the map.
std::vector<LandmarkId> expect_fitting(const Map& map, const LandmarksByNode* known, const MapUpdate& update);

// In an update's lists, which ascend.
template <class Id>
bool is_among(const std::vector<Id>& ids, const Id& id) {
  return std::binary_search(ids.begin(), ids.end(), id);
}

template <class Value, class Id>
const Value* found(const std::vector<Value>& values, const Id& id) {
  const auto place = std::lower_bound(values.begin(), values.end(), id,
                                      [](const Value& value, const Id& wanted) { return value.id < wanted; });
  return place != values.end() && !(id < place->id) ? &*place : nullptr;
}

}  // namespace mapweave
