#pragma once

#include "encoding.h"

#include <mapweave/maps/map.h>

namespace mapweave::report {

// Places that a pose graph says are the same: of one robot (loops), of two (joins), evenly picked where they are more
// than `most` of a kind: {has_links, loops: [[x, y, x, y] in centimetres], loop_count, joins, join_count}.
Json links_json(const Map& graph, std::size_t most);

}  // namespace mapweave::report
