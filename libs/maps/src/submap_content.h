#pragma once

#include <mapweave/maps/map.h>

#include <functional>

namespace mapweave {

// Of nodes wherever they are; null for one that is not there.
using NodeLookup = std::function<const Node*(const NodeId&)>;
Hash content_hash(const Submap& submap, const NodeLookup& find);

}  // namespace mapweave
