#pragma once

#include "encoding.h"

namespace mapweave::report {

// The pairs of merges.json as the page shows them. Of many pairs only the best hypothesis is kept, of very many none.
Json pairs_json(const Json& merges);

}  // namespace mapweave::report
